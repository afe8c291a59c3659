//! From figures a person gives to the settings a device is told.

use firmware_protocol::messages::{
    Blanking, Capabilities, Identity, Settings,
    limits::{SHORT_BLANKING_TICKS_MIN, TICK_HZ},
};
use sonard_api::config::MotionKeys;
use thiserror::Error;

/// Blanking of the module when nothing shortens it, microseconds.
const INTERNAL_BLANKING_US: f64 = 2380.0;

/// Settings of motor and listening.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Listening window after each firing, milliseconds; `None`: the time to the maximum range.
    pub window_ms: Option<f64>,
    /// Settling time between the end of a step and firing, milliseconds.
    pub settle_ms: f64,
    /// Least time between firings, milliseconds.
    pub min_interval_ms: f64,
    /// Echoes to record for each firing, at most.
    pub max_echoes: u8,
    /// Largest motor speed, steps a second.
    pub speed: u16,
    /// Motor acceleration, steps a second squared.
    pub acceleration: u32,
}

impl From<&MotionKeys> for Motion {
    fn from(keys: &MotionKeys) -> Self {
        Self {
            window_ms: keys.window_ms,
            settle_ms: keys.settle_ms,
            min_interval_ms: keys.min_interval_ms,
            max_echoes: keys.max_echoes,
            speed: keys.speed,
            acceleration: keys.acceleration,
        }
    }
}

/// The range that listening must reach, and the blanking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Listening {
    /// Farthest range of interest, metres.
    pub max_range_m: f64,
    /// Speed of sound, metres a second.
    pub sound_speed_m_s: f64,
    /// When the sensor's receiver opens, microseconds after firing.
    pub blanking_us: f64,
}

/// A listening window that ends before the receiver opens: the ranger would be deaf.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error(
    "the listening window, {window_ms:.2} ms, ends before the receiver opens {blanking_ms:.2} ms after \
     firing: nothing could be heard"
)]
pub struct DeafWindow {
    /// The window, milliseconds.
    pub window_ms: f64,
    /// When the receiver opens, milliseconds after firing.
    pub blanking_ms: f64,
    /// Range that belongs to that time, metres.
    pub least_range_m: f64,
}

impl DeafWindow {
    /// What would be right.
    #[must_use]
    pub fn help(&self) -> String {
        let Self { blanking_ms, least_range_m, .. } = self;
        format!(
            "give a window of more than {blanking_ms:.2} ms, a maximum range of more than \
             {least_range_m:.2} m, or a shorter blanking"
        )
    }
}

/// A blanking that a device can't keep.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum BlankingError {
    /// The module's own can't be shortened there.
    #[error(
        "the device can't shorten the module's blanking: it listens from {INTERNAL_BLANKING_US} us on"
    )]
    Fixed,
    /// It can't be so short.
    #[error("the device's shortest blanking is {least_us} us")]
    TooShort {
        /// The least, microseconds.
        least_us: f64,
    },
}

/// Checks that a device of this identity can keep a blanking, microseconds.
///
/// # Errors
/// When it can't.
pub fn check_blanking(blanking_us: f64, identity: &Identity) -> Result<(), BlankingError> {
    let least_us = f64::from(SHORT_BLANKING_TICKS_MIN) * 1e6 / f64::from(TICK_HZ);
    if blanking_us >= INTERNAL_BLANKING_US {
        Ok(())
    } else if !identity.capabilities.has(Capabilities::SHORT_BLANKING) {
        Err(BlankingError::Fixed)
    } else if blanking_us < least_us {
        Err(BlankingError::TooShort { least_us })
    } else {
        Ok(())
    }
}

impl Motion {
    /// Checks that something can be heard at all.
    ///
    /// # Errors
    /// When the window is over before the receiver opens.
    pub fn check_window(&self, listening: &Listening) -> Result<(), DeafWindow> {
        let (window_ms, blanking_ms) = (self.window_ms(listening), listening.blanking_us / 1e3);
        if window_ms > blanking_ms {
            return Ok(());
        }
        let least_range_m = blanking_ms / 1e3 * listening.sound_speed_m_s / 2.0;
        Err(DeafWindow { window_ms, blanking_ms, least_range_m })
    }

    fn window_ms(&self, listening: &Listening) -> f64 {
        self.window_ms.unwrap_or(2e3 * listening.max_range_m / listening.sound_speed_m_s)
    }

    /// The settings for a device of this identity; what it can't do is left out.
    #[must_use]
    pub fn settings(&self, listening: &Listening, identity: &Identity) -> Settings {
        let can = |capability| identity.capabilities.has(capability);
        let shorter = listening.blanking_us < INTERNAL_BLANKING_US;
        Settings {
            window_ticks: ticks(self.window_ms(listening)),
            min_interval_ticks: ticks(self.min_interval_ms),
            settle_ticks: ticks(self.settle_ms),
            max_echoes: if can(Capabilities::MULTIPLE_ECHOES) { self.max_echoes } else { 1 },
            blanking: if shorter && can(Capabilities::SHORT_BLANKING) {
                let wanted = ticks(listening.blanking_us / 1e3);
                let ticks = u16::try_from(wanted).unwrap_or(u16::MAX);
                Blanking::Short { ticks: ticks.max(SHORT_BLANKING_TICKS_MIN) }
            } else {
                Blanking::Internal
            },
            speed: self.speed,
            acceleration: self.acceleration,
            hold_s: hold_s(identity),
        }
    }
}

/// How long a device holds idle coils for a host that says nothing, seconds: three times the
/// longest wait between two looks at a device without work. A board that can't let go of its coils
/// would lose its position for nothing.
#[must_use]
pub const fn hold_s(identity: &Identity) -> u16 {
    if identity.capabilities.has(Capabilities::COIL_RELEASE) { 180 } else { 0 }
}

fn ticks(ms: f64) -> u32 {
    (ms * f64::from(TICK_HZ) / 1e3).ceil() as u32
}

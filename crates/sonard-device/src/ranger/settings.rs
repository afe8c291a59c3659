//! Conversion of the user's motion and receiver options to device settings.

use firmware_protocol::messages::{
    Blanking, Capabilities, Identity, Settings,
    limits::{SHORT_BLANKING_TICKS_MIN, TICK_HZ},
};
use sonard_api::config::MotionKeys;
use thiserror::Error;

/// Internal blanking of the module, microseconds.
const INTERNAL_BLANKING_US: f64 = 2380.0;

/// Motor motion and receiver timing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Listening window after each firing, milliseconds; `None`: the time to the maximum range.
    pub window_ms: Option<f64>,
    /// Settling time between the end of a step and firing, milliseconds.
    pub settle_ms: f64,
    /// Minimum time between firings, milliseconds.
    pub min_interval_ms: f64,
    /// Maximum number of echoes to record for each firing.
    pub max_echoes: u8,
    /// Maximum motor speed, steps per second.
    pub speed: u16,
    /// Motor acceleration, steps per second squared.
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

/// Range that the listening window must cover, and the blanking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReceiverTiming {
    /// Maximum range of interest, metres.
    pub max_range_m: f64,
    /// Speed of sound, metres per second.
    pub sound_speed_m_s: f64,
    /// End of the receiver's blanking, microseconds after firing.
    pub blanking_us: f64,
}

/// Listening window that ends before blanking: no echo could be detected.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error(
    "the listening window of {window_ms:.2} ms ends before blanking ({blanking_ms:.2} ms after \
     firing): no echo could be detected"
)]
pub struct WindowTooShort {
    /// Length of the listening window, milliseconds.
    pub window_ms: f64,
    /// End of the receiver's blanking, milliseconds after firing.
    pub blanking_ms: f64,
    /// Minimum range due to the blanking, metres.
    pub min_range_m: f64,
}

impl WindowTooShort {
    /// Suggests valid settings.
    #[must_use]
    pub fn help(&self) -> String {
        let Self { blanking_ms, min_range_m, .. } = self;
        format!(
            "give a window of more than {blanking_ms:.2} ms, a maximum range of more than \
             {min_range_m:.2} m, or a shorter blanking"
        )
    }
}

/// Blanking that a device does not support.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum BlankingError {
    /// The device can't shorten the module's internal blanking.
    #[error("the device can't shorten the module's blanking of {INTERNAL_BLANKING_US} us")]
    Fixed,
    /// The blanking is shorter than the device's minimum.
    #[error("the device's minimum blanking is {min_us} us")]
    TooShort {
        /// Minimum blanking of the device, microseconds.
        min_us: f64,
    },
}

/// Checks that a device of the given identity supports a blanking, microseconds.
///
/// # Errors
/// If the blanking is shorter than the device allows.
pub fn check_blanking(blanking_us: f64, identity: &Identity) -> Result<(), BlankingError> {
    let min_us = f64::from(SHORT_BLANKING_TICKS_MIN) * 1e6 / f64::from(TICK_HZ);
    if blanking_us >= INTERNAL_BLANKING_US {
        Ok(())
    } else if !identity.capabilities.has(Capabilities::SHORT_BLANKING) {
        Err(BlankingError::Fixed)
    } else if blanking_us < min_us {
        Err(BlankingError::TooShort { min_us })
    } else {
        Ok(())
    }
}

impl Motion {
    /// Checks that the listening window extends beyond the blanking.
    ///
    /// # Errors
    /// If the window ends before the receiver opens.
    pub fn check_window(&self, listening: &ReceiverTiming) -> Result<(), WindowTooShort> {
        let (window_ms, blanking_ms) = (self.window_ms(listening), listening.blanking_us / 1e3);
        if window_ms > blanking_ms {
            return Ok(());
        }
        let min_range_m = blanking_ms / 1e3 * listening.sound_speed_m_s / 2.0;
        Err(WindowTooShort { window_ms, blanking_ms, min_range_m })
    }

    fn window_ms(&self, listening: &ReceiverTiming) -> f64 {
        self.window_ms.unwrap_or(2e3 * listening.max_range_m / listening.sound_speed_m_s)
    }

    /// Builds the settings for a device of the given identity, without unsupported features.
    #[must_use]
    pub fn settings(&self, listening: &ReceiverTiming, identity: &Identity) -> Settings {
        let can = |capability| identity.capabilities.has(capability);
        let shorter = listening.blanking_us < INTERNAL_BLANKING_US;
        Settings {
            window_ticks: ticks(self.window_ms(listening)),
            min_interval_ticks: ticks(self.min_interval_ms),
            settle_ticks: ticks(self.settle_ms),
            max_echoes: if can(Capabilities::MULTIPLE_ECHOES) { self.max_echoes } else { 1 },
            blanking: if shorter && can(Capabilities::SHORT_BLANKING) {
                let requested = ticks(listening.blanking_us / 1e3);
                let ticks = u16::try_from(requested).unwrap_or(u16::MAX);
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

/// Time for which a device holds idle coils without a message from the host, seconds: three times
/// the longest interval between two status polls of an idle device. 0 for a board that can't
/// release its coils, because it would lose its position without any benefit.
#[must_use]
pub const fn hold_s(identity: &Identity) -> u16 {
    if identity.capabilities.has(Capabilities::COIL_RELEASE) { 180 } else { 0 }
}

fn ticks(ms: f64) -> u32 {
    (ms * f64::from(TICK_HZ) / 1e3).ceil() as u32
}

//! From figures a person gives to the settings a device is told.

use firmware_protocol::messages::{
    Blanking, Capabilities, Identity, Settings,
    limits::{SHORT_BLANKING_TICKS_MIN, TICK_HZ},
};

/// Blanking of the module when nothing shortens it, microseconds.
const INTERNAL_BLANKING_US: f64 = 2380.0;

/// How the motor turns and the ranger listens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Listening window after each firing, milliseconds; `None`: the time to the maximum range.
    pub window_ms: Option<f64>,
    /// Rest between the end of a step and firing, milliseconds.
    pub settle_ms: f64,
    /// Least time from firing to firing, milliseconds.
    pub min_interval_ms: f64,
    /// Echoes to record for each firing, at most.
    pub max_echoes: u8,
    /// Largest motor speed, steps a second.
    pub speed: u16,
    /// Motor acceleration, steps a second squared.
    pub acceleration: u32,
}

/// What listening has to reach and where it begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Listening {
    /// Farthest range of interest, metres.
    pub max_range_m: f64,
    /// Speed of sound, metres a second.
    pub sound_speed_m_s: f64,
    /// When the sensor's receiver opens, microseconds after firing.
    pub blanking_us: f64,
}

impl Motion {
    /// The settings for a device of this identity; what it can't do is left out.
    #[must_use]
    pub fn settings(&self, listening: &Listening, identity: &Identity) -> Settings {
        let can = |capability| identity.capabilities.has(capability);
        let window_ms =
            self.window_ms.unwrap_or(2e3 * listening.max_range_m / listening.sound_speed_m_s);
        let shorter = listening.blanking_us < INTERNAL_BLANKING_US;
        Settings {
            window_ticks: ticks(window_ms),
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

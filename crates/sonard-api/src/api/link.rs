//! The link between the daemon and its device.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The link to the device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LinkReport {
    /// What it is doing or suffering.
    pub state: LinkState,
    /// Since when, by the wall clock.
    pub since: Timestamp,
    /// For how long, seconds, by a clock that is never set.
    #[serde(default)]
    pub for_s: Option<f64>,
    /// The port, as configured.
    pub port: String,
    /// What went wrong last and what to do, while the device can't be used.
    pub trouble: Option<String>,
    /// Failures since the device was last in proper use.
    pub failures: u32,
    /// Until the next try, seconds.
    pub retry_in_s: Option<f64>,
}

/// State of the link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinkState {
    /// The port is being opened.
    Opening,
    /// The device is asked who it is.
    Identifying,
    /// The motor is looking for its index.
    Homing,
    /// The device stands at home, without work.
    Ready,
    /// A scan is under way.
    Scanning,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// There was an emergency stop: nothing moves until somebody starts it.
    AwaitingStart,
    /// Stopped for good.
    Stopped,
    /// It can't be used, and why; in records the trouble stands for itself.
    #[serde(untagged)]
    Down(Trouble),
}

/// The reason why the link can't be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Trouble {
    /// The port is not there.
    Absent,
    /// Another program has the port.
    Busy,
    /// This user may not open the port, or it is no serial port.
    Forbidden,
    /// Nothing that speaks the protocol answers.
    NotAnswering,
    /// The device speaks another version of the protocol.
    WrongFirmware,
    /// The device is not the one with the configured serial number.
    WrongDevice,
    /// The line was lost while the device was in use.
    Lost,
    /// The device refused, or its motor or module failed.
    Fault,
}

impl LinkState {
    /// Whether the device can be used.
    #[must_use]
    pub const fn is_up(self) -> bool {
        matches!(self, Self::Ready | Self::Scanning)
    }

    /// Whether the link stays like this until something happens. The steps of a try are not
    /// settled: telling of each would flood a log while a device is away.
    #[must_use]
    pub const fn is_settled(self) -> bool {
        !matches!(self, Self::Opening | Self::Identifying | Self::Homing)
    }

    /// Its name in records and on the screen.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Opening => "opening",
            Self::Identifying => "identifying",
            Self::Homing => "homing",
            Self::Ready => "ready",
            Self::Scanning => "scanning",
            Self::EmergencyStop => "emergency_stop",
            Self::AwaitingStart => "awaiting_start",
            Self::Stopped => "stopped",
            Self::Down(trouble) => trouble.name(),
        }
    }
}

impl Trouble {
    /// Its name in records and on the screen.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Busy => "busy",
            Self::Forbidden => "forbidden",
            Self::NotAnswering => "not_answering",
            Self::WrongFirmware => "wrong_firmware",
            Self::WrongDevice => "wrong_device",
            Self::Lost => "lost",
            Self::Fault => "fault",
        }
    }
}

//! State of the link between the daemon and its device.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// State of the link to the device, with its recent failures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LinkReport {
    /// Current state of the link.
    pub state: LinkState,
    /// Time of the last change of state, by the wall clock.
    pub since: Timestamp,
    /// Time since the last change of state, seconds, by a monotonic clock.
    #[serde(default)]
    pub for_s: Option<f64>,
    /// Serial port, as configured.
    pub port: String,
    /// Last error and its remedy, while the device is unusable.
    pub error: Option<String>,
    /// Failures since the device was last usable.
    pub failures: u32,
    /// Time until the next attempt, seconds.
    pub retry_in_s: Option<f64>,
    /// Latency timer of the port's USB adapter above 1 ms, milliseconds. Times in records are late
    /// by up to half of it.
    #[serde(default)]
    pub latency_timer_ms: Option<u32>,
}

/// State of the link to the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinkState {
    /// The port is being opened.
    Opening,
    /// The device is being identified.
    Identifying,
    /// The motor is homing to its index.
    Homing,
    /// The device is homed and idle.
    Ready,
    /// A scan is in progress.
    Scanning,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// Emergency stop released; the device stays still until a start request.
    AwaitingStart,
    /// Permanently stopped, until the daemon exits.
    Stopped,
    /// Unusable, with the reason. Records contain the name of the reason alone.
    #[serde(untagged)]
    Down(Trouble),
}

/// Reason why the link is unusable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Trouble {
    /// The port does not exist.
    Absent,
    /// The port is in use by another program.
    Busy,
    /// The port is not accessible to this user, or is no serial port.
    Forbidden,
    /// No response in the protocol.
    NotAnswering,
    /// The device uses another protocol version.
    WrongFirmware,
    /// The device's serial number is not the configured one.
    WrongDevice,
    /// The connection was lost while the device was in use.
    Lost,
    /// The device rejected a request, or its motor or module failed.
    Fault,
}

impl LinkState {
    /// Returns `true` if the device is usable.
    #[must_use]
    pub const fn is_up(self) -> bool {
        matches!(self, Self::Ready | Self::Scanning)
    }

    /// Returns `true` if the state lasts until an external event. The transient steps of a
    /// connection attempt are excluded: logging them would flood the log while a device is absent.
    #[must_use]
    pub const fn is_settled(self) -> bool {
        !matches!(self, Self::Opening | Self::Identifying | Self::Homing)
    }

    /// Name in records and on displays.
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
    /// Name in records and on displays.
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

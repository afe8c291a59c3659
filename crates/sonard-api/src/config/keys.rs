//! Configuration keys of `sonard run`.
//!
//! Single definition of every key: the doc comment of a field is its text in `config/sonard.toml`,
//! its `range` is validated, and its default is shown in the file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::model::OptionKeys;

use super::{air::AirKeys, fleet::FleetKeys, foxglove::FoxgloveKeys, mqtt::MqttKeys, ros::RosKeys};

/// Configuration of `sonard run`, one field per section.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Keys {
    /// Serial port and identity of the ranger.
    pub device: DeviceKeys,
    /// Pose of the ranger, and scene for predictions.
    pub place: PlaceKeys,
    /// Azimuths of a scan.
    pub plan: PlanKeys,
    /// Scan mode and schedule.
    pub scanning: ScanningKeys,
    /// Motor motion and listening window.
    pub motion: MotionKeys,
    /// Sensor data, and prediction of echoes.
    pub model: ModelKeys,
    /// Simulated array of `sonard run --simulate`.
    pub simulate: SimulateKeys,
    /// Air data, which determine the speed of sound.
    pub air: AirKeys,
    /// Folder and size of the logs.
    pub log: LogKeys,
    /// Retries and timing of the link to the device.
    pub link: LinkKeys,
    /// Behaviour after an emergency stop.
    pub safety: SafetyKeys,
    /// HTTP API and live page.
    pub server: ServerKeys,
    /// Live messages for Foxglove and Lichtblick, at /foxglove/ of the server's address.
    pub foxglove: FoxgloveKeys,
    /// Name of this robot, and other robots to poll.
    pub fleet: FleetKeys,
    /// Messages and services for ROS 2 over DDS; only in a build with the feature ros.
    pub ros: RosKeys,
    /// Publication of log records to an MQTT broker; only in a build with the feature mqtt.
    pub mqtt: MqttKeys,
    /// Pins of a Raspberry Pi (BCM numbers); only in a build with the feature pi.
    pub gpio: GpioKeys,
}

/// Serial port and identity of the ranger.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DeviceKeys {
    /// Serial port: a name in /dev/serial/by-id (or an unambiguous part of one), a USB serial
    /// number, or a path. A stable name finds the ranger again after it was replugged.
    #[schemars(example = "usb-Arduino_Uno_75830")]
    pub port: Option<String>,
    /// Required serial number, as reported by the ranger; others are rejected.
    #[schemars(example = "SONARD-0001")]
    pub serial: Option<String>,
}

/// Pose of the ranger, and scene for predictions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlaceKeys {
    /// Scene file, or the name of a shipped scene. Without a scene there are no predictions.
    #[schemars(example = "simple-room")]
    pub scene: Option<String>,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene.
    pub pose: String,
}

/// Azimuths of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlanKeys {
    /// First azimuth, degrees counter-clockwise from the heading.
    #[schemars(range(min = -360, max = 360))]
    pub from_deg: f64,
    /// End of the azimuths, degrees, exclusive; at most 360 after from_deg.
    #[schemars(range(min = -360, max = 720))]
    pub to_deg: f64,
    /// Step between azimuths, degrees; a multiple of the motor's step.
    #[schemars(range(min = 0.01, max = 360))]
    pub step_deg: f64,
    /// Number of pings per azimuth.
    #[schemars(range(min = 1, max = 255))]
    pub pings_per_stop: u32,
}

/// Scan mode and schedule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScanningKeys {
    /// Continuous scans, scans on request only, or scheduled scans. With --simulate, continuous
    /// takes precedence over the default.
    #[schemars(extend("x-default-yields" = true))]
    pub mode: Mode,
    /// Interval between the starts of scans in mode schedule, seconds. A missed start is skipped.
    #[schemars(range(min = 1, max = 604_800))]
    pub every_s: f64,
}

/// Scan mode and schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Continuous scans without pause.
    Continuous,
    /// Scans on request only.
    #[default]
    OnRequest,
    /// Scans at a fixed interval.
    Schedule,
}

/// Motor motion and listening window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MotionKeys {
    /// Settling time between the end of a step and firing, milliseconds.
    #[schemars(range(min = 0, max = 8000))]
    pub settle_ms: f64,
    /// Minimum interval between firings, milliseconds, to protect the module.
    #[schemars(range(min = 0, max = 8000))]
    pub min_interval_ms: f64,
    /// Listening window after each firing, milliseconds; by default the time of flight to the
    /// maximum range.
    #[schemars(range(min = 1, max = 8000), example = 30)]
    pub window_ms: Option<f64>,
    /// Maximum number of echoes recorded per firing.
    #[schemars(range(min = 1, max = 8))]
    pub max_echoes: u8,
    /// Maximum motor speed, steps per second.
    #[schemars(range(min = 1, max = 10_000))]
    pub speed: u16,
    /// Motor acceleration, steps per second squared.
    #[schemars(range(min = 1, max = 200_000))]
    pub acceleration: u32,
}

/// Sensor data, and prediction of echoes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ModelKeys {
    /// Sensor preset, or a file with sensor data. With --simulate, the array's own sensors take
    /// precedence over the default.
    #[schemars(extend("x-default-yields" = true))]
    pub sensor: String,
    /// Options of the prediction.
    #[serde(flatten)]
    pub options: OptionKeys,
}

/// Simulated array of `sonard run --simulate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulateKeys {
    /// Array of rangers: a preset (`sonard array list`), or a file with array data. Unless
    /// model.sensor is set, its rangers use the sensors of that file.
    pub array: String,
    /// Interval between firings, milliseconds; by default that of the array.
    #[schemars(range(min = 1, max = 10_000), example = 40)]
    pub interval_ms: Option<f64>,
    /// File with the poses of the robot's course, one JSON object per line, with or without time_s;
    /// the first takes precedence over place.pose. A pose set through the API ends the drive.
    #[schemars(example = "/etc/sonard/course.jsonl")]
    pub course: Option<String>,
    /// Speed of the robot on a course without times, metres per second.
    #[schemars(range(min = 0.001, max = 10))]
    pub speed_m_s: f64,
    /// Standard deviation of the range noise, millimetres (the upper tail is longer).
    #[schemars(range(min = 0, max = 1000))]
    pub noise_mm: f64,
    /// Seed of the noise generator.
    #[schemars(range(min = 0, max = 9_007_199_254_740_991_i64))]
    pub seed: u64,
}

/// Folder and size of the logs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LogKeys {
    /// Folder of the logs (restart). systemd's STATE_DIRECTORY takes precedence over the default.
    #[schemars(extend("x-default-yields" = true))]
    pub folder: String,
    /// Size at which a new log file is started, megabytes.
    #[schemars(range(min = 0.01, max = 100_000))]
    pub rotate_mb: f64,
    /// Start a new log file each day (UTC).
    pub daily: bool,
    /// Maximum total size of the logs, megabytes: beyond it the oldest files are removed; 0 keeps
    /// everything.
    #[schemars(range(min = 0, max = 10_000_000))]
    pub keep_mb: f64,
    /// Maximum delay until a record is synced to disk, seconds.
    #[schemars(range(min = 0.1, max = 60))]
    pub sync_s: f64,
}

/// Retries and timing of the link to the device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinkKeys {
    /// Attempts per request until the device is considered disconnected.
    #[schemars(range(min = 1, max = 50))]
    pub attempts: u8,
    /// Delay before the second connection attempt, seconds; doubled after each attempt.
    #[schemars(range(min = 0.05, max = 60))]
    pub retry_min_s: f64,
    /// Maximum delay between connection attempts, seconds.
    #[schemars(range(min = 0.1, max = 600))]
    pub retry_max_s: f64,
    /// Interval between status requests to an idle device, seconds.
    #[schemars(range(min = 0.1, max = 60))]
    pub status_interval_s: f64,
}

/// Behaviour after an emergency stop.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SafetyKeys {
    /// Home and resume scanning automatically once an emergency stop is released. Otherwise the
    /// state is awaiting_start, and nothing moves until POST /v1/start or a restart of the daemon.
    pub resume_after_emergency_stop: bool,
}

/// HTTP API and live page.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ServerKeys {
    /// Path of the unix socket (restart); empty for none. systemd's RUNTIME_DIRECTORY takes
    /// precedence over the default. A socket whose file is removed is created again.
    #[schemars(extend("x-default-yields" = true))]
    pub socket: String,
    /// Permissions of the socket, three octal digits as for chmod (restart).
    pub socket_mode: String,
    /// TCP address of API and live page (restart). Off loopback, reading needs the token, too. An
    /// address that this computer does not have yet, or a port in use, is bound as soon as
    /// possible; scanning does not wait for it.
    #[schemars(example = "127.0.0.1:8765")]
    pub listen: Option<String>,
    /// File with the access token that writes over TCP require, readable by its owner only
    /// (restart); without one, writes over TCP are rejected.
    #[schemars(example = "/etc/sonard/token")]
    pub token_file: Option<String>,
    /// Host names that browsers may use in addition to those of loopback (restart).
    pub hosts: Vec<String>,
    /// Folder of the playground as built by `web/build.sh`, served at /playground/ (restart).
    #[schemars(example = "/usr/share/sonard/playground")]
    pub playground: Option<String>,
    /// Maximum number of simultaneous connections (restart), separately for the socket, TCP from
    /// this computer, and TCP from others.
    #[schemars(range(min = 1, max = 10_000))]
    pub max_clients: u32,
    /// Maximum request rate, requests per second (restart), separately for the socket, for requests
    /// with the token, and for all others. Rejected requests do not count.
    #[schemars(range(min = 1, max = 100_000))]
    pub max_requests_per_s: f64,
    /// Maximum size of a request body, kilobytes (restart).
    #[schemars(range(min = 1, max = 10_000))]
    pub max_body_kb: u32,
    /// Size of a slow subscriber's queue, readings; when it is full, the oldest readings are
    /// dropped and counted (restart).
    #[schemars(range(min = 16, max = 100_000))]
    pub queue: u32,
    /// Time after which a client that stops reading is disconnected, seconds (restart).
    #[schemars(range(min = 0.1, max = 600))]
    pub write_timeout_s: f64,
}

/// Pins of a Raspberry Pi.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GpioKeys {
    /// Output that resets the microcontroller, low for 50 ms (restart).
    #[schemars(range(min = 0, max = 27), example = 17)]
    pub reset_pin: Option<u8>,
    /// Output that powers the ranging module, high while the daemon runs (restart).
    #[schemars(range(min = 0, max = 27), example = 27)]
    pub power_pin: Option<u8>,
    /// Input with pull-up for the home switch, low while the motor is at home (restart).
    #[schemars(range(min = 0, max = 27), example = 22)]
    pub home_pin: Option<u8>,
    /// Input with pull-up for the emergency stop, high while it is pressed or its cable is broken
    /// (restart).
    #[schemars(range(min = 0, max = 27), example = 23)]
    pub stop_pin: Option<u8>,
    /// Output of the indicator light, high while the ranger is ready or scanning (restart).
    #[schemars(range(min = 0, max = 27), example = 24)]
    pub status_led_pin: Option<u8>,
}

impl Default for PlaceKeys {
    fn default() -> Self {
        Self { scene: None, pose: "0,0,0".into() }
    }
}

impl Default for PlanKeys {
    fn default() -> Self {
        Self { from_deg: 0.0, to_deg: 360.0, step_deg: 0.9, pings_per_stop: 1 }
    }
}

impl Default for ScanningKeys {
    fn default() -> Self {
        Self { mode: Mode::OnRequest, every_s: 60.0 }
    }
}

impl Default for MotionKeys {
    fn default() -> Self {
        Self {
            settle_ms: 5.0,
            min_interval_ms: 20.0,
            window_ms: None,
            max_echoes: 3,
            speed: 800,
            acceleration: 40_000,
        }
    }
}

impl Default for ModelKeys {
    fn default() -> Self {
        Self { sensor: "senscomp-6500".into(), options: OptionKeys::default() }
    }
}

impl Default for SimulateKeys {
    fn default() -> Self {
        Self {
            array: "pioneer-8".into(),
            interval_ms: None,
            course: None,
            speed_m_s: 0.3,
            noise_mm: 0.0,
            seed: 1,
        }
    }
}

impl Default for LogKeys {
    fn default() -> Self {
        Self {
            folder: "/var/lib/sonard".into(),
            rotate_mb: 64.0,
            daily: true,
            keep_mb: 0.0,
            sync_s: 2.0,
        }
    }
}

impl Default for LinkKeys {
    fn default() -> Self {
        Self { attempts: 7, retry_min_s: 0.2, retry_max_s: 5.0, status_interval_s: 5.0 }
    }
}

impl ServerKeys {
    /// Parses `socket_mode`; `None` if it is not three octal digits.
    #[must_use]
    pub fn socket_permissions(&self) -> Option<u32> {
        let digits = self.socket_mode.strip_prefix('0').unwrap_or(&self.socket_mode);
        let digits = if digits.len() == 3 { digits } else { &self.socket_mode };
        let octal = digits.len() == 3 && digits.bytes().all(|digit| (b'0'..=b'7').contains(&digit));
        u32::from_str_radix(digits, 8).ok().filter(|_| octal)
    }
}

impl Default for ServerKeys {
    fn default() -> Self {
        Self {
            socket: "/run/sonard/sonard.sock".into(),
            socket_mode: "0660".into(),
            listen: None,
            token_file: None,
            hosts: Vec::new(),
            playground: None,
            max_clients: 128,
            max_requests_per_s: 200.0,
            max_body_kb: 64,
            queue: 512,
            write_timeout_s: 10.0,
        }
    }
}

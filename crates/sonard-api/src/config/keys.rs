//! The keys of the configuration, as they stand in the file.
//!
//! The one place that says what there is: the doc comment of a field is its text in
//! `config/sonard.toml`, its `range` is what is checked, its default what the file shows.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::model::OptionKeys;

use super::{air::AirKeys, fleet::FleetKeys, foxglove::FoxgloveKeys, mqtt::MqttKeys, ros::RosKeys};

/// Configuration of `sonard run`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Keys {
    /// Which ranger.
    pub device: DeviceKeys,
    /// Where it stands, and in what.
    pub place: PlaceKeys,
    /// Which azimuths a scan measures.
    pub plan: PlanKeys,
    /// When scans are taken.
    pub scanning: ScanningKeys,
    /// How the motor turns and the ranger listens.
    pub motion: MotionKeys,
    /// What is known about the ranger, and how echoes are predicted.
    pub model: ModelKeys,
    /// What `sonard run --simulate` plays.
    pub simulate: SimulateKeys,
    /// The air, from which the speed of sound follows.
    pub air: AirKeys,
    /// Where records are kept.
    pub log: LogKeys,
    /// The line to the device.
    pub link: LinkKeys,
    /// After an emergency stop.
    pub safety: SafetyKeys,
    /// The HTTP API.
    pub server: ServerKeys,
    /// Live messages for Foxglove and Lichtblick, at /foxglove/ of the server's address.
    pub foxglove: FoxgloveKeys,
    /// This robot among others.
    pub fleet: FleetKeys,
    /// Messages and services for ROS 2, by DDS; only in a build with the feature ros.
    pub ros: RosKeys,
    /// Records to an MQTT broker, from the log; only in a build with the feature mqtt.
    pub mqtt: MqttKeys,
    /// Pins of a Raspberry Pi (BCM numbers); only in a build with the feature pi.
    pub gpio: GpioKeys,
}

/// Which ranger.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DeviceKeys {
    /// Serial port: a name in /dev/serial/by-id (or a part of one that fits no other), a USB
    /// serial number, or a path. A stable name finds the ranger again after it was replugged.
    #[schemars(example = "usb-Arduino_Uno_75830")]
    pub port: Option<String>,
    /// Accept only the ranger with this serial number, as it tells it itself.
    #[schemars(example = "SONARD-0001")]
    pub serial: Option<String>,
}

/// Where it stands, and in what.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlaceKeys {
    /// Scene file, or the name of a shipped scene. Without one nothing is predicted.
    #[schemars(example = "simple-room")]
    pub scene: Option<String>,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene.
    pub pose: String,
}

/// Which azimuths a scan measures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlanKeys {
    /// First azimuth, degrees counter-clockwise from the heading.
    #[schemars(range(min = -360, max = 360))]
    pub from_deg: f64,
    /// End of the azimuths, degrees, not itself fired at; at most 360 after from_deg.
    #[schemars(range(min = -360, max = 720))]
    pub to_deg: f64,
    /// From stop to stop, degrees; a multiple of the motor's step.
    #[schemars(range(min = 0.01, max = 360))]
    pub step_deg: f64,
    /// Firings at each stop.
    #[schemars(range(min = 1, max = 255))]
    pub pings_per_stop: u32,
}

/// When scans are taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScanningKeys {
    /// Scan after scan, only when asked to, or one every so often. With --simulate scan after scan
    /// goes before the default.
    #[schemars(extend("x-default-yields" = true))]
    pub mode: Mode,
    /// From the start of a scan to the start of the next, seconds, when the mode is schedule. A
    /// turn that is missed is left out.
    #[schemars(range(min = 1, max = 604_800))]
    pub every_s: f64,
}

/// When scans are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Scan after scan.
    Continuous,
    /// Only when asked to.
    #[default]
    OnRequest,
    /// One every so often.
    Schedule,
}

/// How the motor turns and the ranger listens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MotionKeys {
    /// Settling time between the end of a step and firing, milliseconds.
    #[schemars(range(min = 0, max = 8000))]
    pub settle_ms: f64,
    /// Least time between firings, milliseconds, to protect the module.
    #[schemars(range(min = 0, max = 8000))]
    pub min_interval_ms: f64,
    /// Listening window after each firing, milliseconds, instead of the time to the maximum range.
    #[schemars(range(min = 1, max = 8000), example = 30)]
    pub window_ms: Option<f64>,
    /// Echoes to record for each firing, at most.
    #[schemars(range(min = 1, max = 8))]
    pub max_echoes: u8,
    /// Largest motor speed, steps a second.
    #[schemars(range(min = 1, max = 10_000))]
    pub speed: u16,
    /// Motor acceleration, steps a second squared.
    #[schemars(range(min = 1, max = 200_000))]
    pub acceleration: u32,
}

/// What is known about the ranger, and how echoes are predicted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ModelKeys {
    /// Sensor preset, or a file with a sensor's data. With --simulate the array's own goes before the
    /// default.
    #[schemars(extend("x-default-yields" = true))]
    pub sensor: String,
    /// How echoes are predicted.
    #[serde(flatten)]
    pub options: OptionKeys,
}

/// What `sonard run --simulate` plays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulateKeys {
    /// Array of rangers: a preset (`sonard array list`), or a file with an array's data.
    /// Unless model.sensor is set, its rangers are what the array says.
    pub array: String,
    /// From one firing to the next, milliseconds, instead of the array's own interval.
    #[schemars(range(min = 1, max = 10_000), example = 40)]
    pub interval_ms: Option<f64>,
    /// File of poses that the robot drives along, one JSON object a line, with or without time_s;
    /// the first goes before place.pose. A pose set through the API ends the drive.
    #[schemars(example = "/etc/sonard/course.jsonl")]
    pub course: Option<String>,
    /// How fast it drives where the file has no times, metres a second.
    #[schemars(range(min = 0.001, max = 10))]
    pub speed_m_s: f64,
    /// Standard deviation of the range noise, millimetres (the far tail is longer).
    #[schemars(range(min = 0, max = 1000))]
    pub noise_mm: f64,
    /// Seed of the noise.
    #[schemars(range(min = 0, max = 9_007_199_254_740_991_i64))]
    pub seed: u64,
}

/// Where records are kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LogKeys {
    /// Folder of the logs (restart). systemd's STATE_DIRECTORY goes before the default.
    #[schemars(extend("x-default-yields" = true))]
    pub folder: String,
    /// Begin another file when this one is larger, megabytes.
    #[schemars(range(min = 0.01, max = 100_000))]
    pub rotate_mb: f64,
    /// Begin another file each day (UTC).
    pub daily: bool,
    /// Remove the oldest files when all together are larger, megabytes; 0 keeps everything.
    #[schemars(range(min = 0, max = 10_000_000))]
    pub keep_mb: f64,
    /// How long a record may wait for the disk, seconds.
    #[schemars(range(min = 0.1, max = 60))]
    pub sync_s: f64,
}

/// The line to the device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinkKeys {
    /// How often a request is sent before the device counts as gone.
    #[schemars(range(min = 1, max = 50))]
    pub attempts: u8,
    /// Wait before the second try to reach the device, seconds; doubled from try to try.
    #[schemars(range(min = 0.05, max = 60))]
    pub retry_min_s: f64,
    /// Longest wait from try to try, seconds.
    #[schemars(range(min = 0.1, max = 600))]
    pub retry_max_s: f64,
    /// How often a device without work is asked how it is, seconds.
    #[schemars(range(min = 0.1, max = 60))]
    pub check_s: f64,
}

/// After an emergency stop.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SafetyKeys {
    /// Home and scan again by itself once an emergency stop is released. Without it the state is
    /// awaiting_start, and nothing moves until POST /v1/start or a restart of the daemon.
    pub resume_after_emergency_stop: bool,
}

/// The HTTP API.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ServerKeys {
    /// Unix socket (restart); empty for none. systemd's RUNTIME_DIRECTORY goes before the default. A socket whose file is
    /// removed is made again.
    #[schemars(extend("x-default-yields" = true))]
    pub socket: String,
    /// Who may use the socket: its permissions, three octal digits, as of chmod (restart).
    pub socket_mode: String,
    /// TCP address of API and live page (restart). Off loopback, all data need a token. An address that this computer
    /// does not have yet, or a port in use, is bound once it can be; scanning does not wait for it.
    #[schemars(example = "127.0.0.1:8765")]
    pub listen: Option<String>,
    /// File with the token that writes over TCP must show, readable by its owner alone (restart);
    /// without one there are no writes over TCP.
    #[schemars(example = "/etc/sonard/token")]
    pub token_file: Option<String>,
    /// Host names, besides those of loopback, under which a browser may ask (restart).
    pub hosts: Vec<String>,
    /// Folder of the playground, as `web/build.sh` makes it, to be served at /playground/ (restart).
    #[schemars(example = "/usr/share/sonard/playground")]
    pub playground: Option<String>,
    /// Connections at a time (restart): so many by the socket, by TCP from this computer, and by TCP
    /// from others, each by itself.
    #[schemars(range(min = 1, max = 10_000))]
    pub max_clients: u32,
    /// Requests a second (restart): so many by the socket, with the token, and of all others, each by
    /// itself. What is refused counts nowhere.
    #[schemars(range(min = 1, max = 100_000))]
    pub max_requests_per_s: f64,
    /// Largest body of a request, kilobytes (restart).
    #[schemars(range(min = 1, max = 10_000))]
    pub max_body_kb: u32,
    /// Readings kept for a subscriber that is slow; older ones are dropped, with a count (restart).
    #[schemars(range(min = 16, max = 100_000))]
    pub queue: u32,
    /// A client that takes nothing for so long is cut off, seconds (restart).
    #[schemars(range(min = 0.1, max = 600))]
    pub stall_s: f64,
}

/// Pins of a Raspberry Pi.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GpioKeys {
    /// Output, low for 50 ms, that resets the microcontroller (restart).
    #[schemars(range(min = 0, max = 27), example = 17)]
    pub reset_pin: Option<u8>,
    /// Output, high while the daemon runs, that powers the ranging module (restart).
    #[schemars(range(min = 0, max = 27), example = 27)]
    pub power_pin: Option<u8>,
    /// Input with pull-up, low while the motor is at home (restart).
    #[schemars(range(min = 0, max = 27), example = 22)]
    pub home_pin: Option<u8>,
    /// Input with pull-up, high (also: cable broken) while the emergency stop is pressed (restart).
    #[schemars(range(min = 0, max = 27), example = 23)]
    pub stop_pin: Option<u8>,
    /// Output, high while the ranger is ready or scanning (restart).
    #[schemars(range(min = 0, max = 27), example = 24)]
    pub light_pin: Option<u8>,
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
        Self { attempts: 7, retry_min_s: 0.2, retry_max_s: 5.0, check_s: 5.0 }
    }
}

impl ServerKeys {
    /// The socket's permissions; `None` if they are not three octal digits.
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
            stall_s: 10.0,
        }
    }
}

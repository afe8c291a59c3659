//! Settings of the daemon: the configuration with the files that it names, validated.

use std::{
    collections::{BTreeMap, BTreeSet},
    net::{IpAddr, SocketAddr},
    sync::Arc,
    time::Duration,
};

use super::{link_state::RetryBounds, prediction_cache::listening};
use sonard_api::{
    Setup,
    config::{Keys, MAX_ROBOT_NAME_CHARS, is_robot_name},
};
use sonard_device::ranger::Motion;
use sonard_log::Rotation;
use sonard_model::{
    acoustics::{Air, Sensor},
    array::{RangerArray, RobotCourse},
    geometry::Pose,
    model::Options,
    scene::Scene,
};
use sonard_records::ScanPlan;

/// Configuration with the loaded scene, sensor and array.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Configuration keys, each within its range.
    pub keys: Keys,
    /// Scene of the predictions, if there is one.
    pub scene: Option<Arc<Scene>>,
    /// Acoustic data of the sensor.
    pub sensor: Sensor,
    /// Position and heading of the ranger.
    pub pose: Pose,
    /// Array simulated in place of a device, if there is one.
    pub simulated: Option<ArraySimulation>,
    /// Optional outputs supported by this build.
    pub outputs: OptionalOutputs,
    /// SHA-256 of the contents of files that are read only at the start, by the keys that name
    /// them.
    pub files: BTreeMap<&'static str, [u8; 32]>,
}

/// Outputs that are optional features of the program; configuring a missing one is an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OptionalOutputs {
    /// Publication of records to an MQTT broker.
    pub mqtt: bool,
    /// Publication of messages to ROS 2.
    pub ros: bool,
}

/// Simulated array and its motion.
#[derive(Debug, Clone, PartialEq)]
pub struct ArraySimulation {
    /// Array of fixed rangers.
    pub array: Arc<RangerArray>,
    /// Trajectory of the robot with times; `None` for a robot at rest.
    pub course: Option<Arc<RobotCourse>>,
}

/// Conflict between configuration values that are each in range.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingsConflict {
    /// Section of the conflicting key.
    pub section: &'static str,
    /// Name of the conflicting key.
    pub key: &'static str,
    /// Description of the conflict.
    pub message: String,
    /// Hint for the correction.
    pub help: String,
}

impl Settings {
    /// Azimuths of a scan.
    #[must_use]
    pub const fn plan(&self) -> ScanPlan {
        let plan = &self.keys.plan;
        ScanPlan {
            from_deg: plan.from_deg,
            to_deg: plan.to_deg,
            step_deg: plan.step_deg,
            pings_per_stop: plan.pings_per_stop,
        }
    }

    /// Motion profile and receive window.
    #[must_use]
    pub fn motion(&self) -> Motion {
        Motion::from(&self.keys.motion)
    }

    /// Setup of scans: sensor, model and motion.
    #[must_use]
    pub fn setup(&self) -> Setup {
        Setup {
            sensor: self.sensor.clone(),
            model: self.keys.model.clone(),
            motion: self.keys.motion.clone(),
            thermometer: self.keys.air.file.is_some(),
        }
    }

    /// Options of the model.
    #[must_use]
    pub fn options(&self) -> Options {
        // `check` rejects options that the engine does not support.
        self.keys.model.options.engine_options()
    }

    /// Maximum range of the model, metres.
    #[must_use]
    pub fn max_range_m(&self) -> f64 {
        self.keys.model.options.max_range_m.unwrap_or(self.sensor.max_range_m)
    }

    /// Limits of log files.
    #[must_use]
    pub fn rotation(&self) -> Rotation {
        let log = &self.keys.log;
        let bytes = |megabytes: f64| (megabytes * 1e6) as u64;
        Rotation {
            max_bytes: bytes(log.rotate_mb),
            daily: log.daily,
            keep_bytes: bytes(log.keep_mb),
            sync_interval: Duration::from_secs_f64(log.sync_s),
        }
    }

    /// Bounds of the wait between connection attempts.
    #[must_use]
    pub fn retry_bounds(&self) -> RetryBounds {
        let link = &self.keys.link;
        RetryBounds {
            min: Duration::from_secs_f64(link.retry_min_s),
            max: Duration::from_secs_f64(link.retry_max_s.max(link.retry_min_s)),
        }
    }

    /// Interval between the starts of scans in the schedule mode.
    #[must_use]
    pub fn every(&self) -> Duration {
        Duration::from_secs_f64(self.keys.scanning.every_s)
    }

    /// Checks constraints between values, beyond the range of each.
    ///
    /// # Errors
    /// The first conflict found.
    pub fn check(&self) -> Result<(), SettingsConflict> {
        let air = &self.keys.air;
        self.plan().check().map_err(|error| SettingsConflict {
            section: "plan",
            key: "to_deg",
            message: error.to_string(),
            help: "a full revolution is from_deg = 0, to_deg = 360, step_deg = 0.9".into(),
        })?;
        let air = Air::new(air.temperature_c, air.humidity_percent, air.pressure_kpa).map_err(
            |error| SettingsConflict {
                section: "air",
                key: "temperature_c",
                message: error.to_string(),
                help: String::new(),
            },
        )?;
        // A simulated ranger receives until the next ranger of its array fires.
        if self.simulated.is_none() {
            let has_window = self.keys.motion.window_ms.is_some();
            let checked = self.motion().check_window(&listening(self, &air));
            checked.map_err(|error| SettingsConflict {
                section: if has_window { "motion" } else { "model" },
                key: if has_window { "window_ms" } else { "max_range_m" },
                message: error.to_string(),
                help: error.help(),
            })?;
        }
        self.keys.model.options.options().map_err(|foreign| SettingsConflict {
            section: "model",
            key: foreign.option,
            message: foreign.to_string(),
            help: foreign.help(),
        })?;
        self.check_server()?;
        self.check_robot()?;
        for (section, checked) in [
            ("ros", self.keys.ros.check(self.outputs.ros)),
            ("mqtt", self.keys.mqtt.check(self.outputs.mqtt)),
        ] {
            checked.map_err(|(key, message, help)| SettingsConflict {
                section,
                key,
                message,
                help,
            })?;
        }
        if self.keys.link.retry_max_s < self.keys.link.retry_min_s {
            return Err(SettingsConflict {
                section: "link",
                key: "retry_max_s",
                message: "link.retry_max_s is less than link.retry_min_s".into(),
                help: "set link.retry_max_s to at least link.retry_min_s".into(),
            });
        }
        Ok(())
    }

    /// Returns `true` if the settings are valid with another sensor.
    #[must_use]
    pub fn is_valid_with(&self, sensor: &Sensor) -> bool {
        Self { sensor: sensor.clone(), ..self.clone() }.check().is_ok()
    }

    fn check_server(&self) -> Result<(), SettingsConflict> {
        let server = &self.keys.server;
        if server.socket_permissions().is_none() {
            return Err(SettingsConflict {
                section: "server",
                key: "socket_mode",
                message: format!("server.socket_mode is {}", server.socket_mode),
                help: "use three octal digits: 0660 for owner and group, 0600 for the owner only"
                    .into(),
            });
        }
        let Some(listen) = &server.listen else { return Ok(()) };
        let invalid = |message: String, help: &str| {
            Err(SettingsConflict { section: "server", key: "listen", message, help: help.into() })
        };
        let Ok(address) = listen.parse::<SocketAddr>() else {
            return invalid(
                format!("server.listen is {listen}"),
                "use an address with a port, such as 127.0.0.1:8765 or [::1]:8765",
            );
        };
        if let Some(why) = why_unbindable(&address) {
            let message = format!("server.listen {listen} {why}");
            return invalid(message, "use an address of this computer, such as 127.0.0.1:8765");
        }
        if !address.ip().is_loopback() && server.token_file.is_none() {
            return invalid(
                format!("server.listen {listen} can be reached from other computers"),
                "listen on 127.0.0.1, or set server.token_file",
            );
        }
        Ok(())
    }

    fn check_robot(&self) -> Result<(), SettingsConflict> {
        let robot = &self.keys.fleet.robot;
        if is_robot_name(robot) {
            return Ok(());
        }
        Err(SettingsConflict {
            section: "fleet",
            key: "robot",
            message: format!("fleet.robot is {robot:?}"),
            help: format!(
                "use at most {MAX_ROBOT_NAME_CHARS} letters, digits, `-`, `_` and `.`, as in kiwi-7"
            ),
        })
    }

    /// Differences from `before` that take effect only after a restart: keys marked `(restart)`, as
    /// their section or `section.key`, and files that such keys name, as `contents of section.key`.
    #[must_use]
    pub fn needs_restart(&self, before: &Self) -> Vec<String> {
        let (now, then) = (&self.keys, &before.keys);
        let changed = [
            ("log.folder", now.log.folder != then.log.folder),
            ("server", now.server != then.server),
            ("fleet", now.fleet != then.fleet),
            ("foxglove", now.foxglove != then.foxglove),
            ("ros", now.ros != then.ros),
            ("mqtt", now.mqtt != then.mqtt),
            ("gpio", now.gpio != then.gpio),
        ];
        let keys = changed.into_iter().filter(|(_, changed)| *changed).map(|(key, _)| key);
        let mut keys: Vec<String> = keys.map(str::to_owned).collect();
        let files: BTreeSet<_> = self.files.keys().chain(before.files.keys()).copied().collect();
        for key in files {
            // A changed section may name another file.
            let is_named = keys.iter().any(|section| key.starts_with(&format!("{section}.")));
            if !is_named && self.files.get(key) != before.files.get(key) {
                keys.push(format!("contents of {key}"));
            }
        }
        keys
    }
}

/// Reason why no computer can listen on an address, if there is one.
fn why_unbindable(address: &SocketAddr) -> Option<&'static str> {
    match address.ip() {
        ip if ip.is_multicast() => Some("is a multicast address"),
        IpAddr::V4(ip) if ip.is_broadcast() => Some("is the broadcast address"),
        IpAddr::V6(ip) if ip.is_unicast_link_local() => match address {
            SocketAddr::V6(address) if address.scope_id() != 0 => None,
            _ => Some("is valid only on one link: name its interface by number, as in [fe80::1%2]"),
        },
        _ => None,
    }
}

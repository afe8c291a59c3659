//! Everything the daemon works by, checked and loaded.

use std::{
    collections::{BTreeMap, BTreeSet},
    net::{IpAddr, SocketAddr},
    sync::Arc,
    time::Duration,
};

use super::{forecast::listening, machine::BackOff};
use sonard_api::{
    Setup,
    config::{Keys, MAX_ROBOT_NAME, is_robot_name},
};
use sonard_device::ranger::Motion;
use sonard_log::Rotation;
use sonard_model::{
    acoustics::{Air, Sensor},
    array::{Course, RangerArray},
    geometry::Pose,
    model::Options,
    scene::Scene,
};
use sonard_records::ScanPlan;

/// The configuration with what it names: scene and sensor.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The keys, each within its range.
    pub keys: Keys,
    /// The scene, if there is one.
    pub scene: Option<Arc<Scene>>,
    /// The sensor's data.
    pub sensor: Sensor,
    /// Where the ranger stands.
    pub pose: Pose,
    /// What the model plays in place of a device, if it does.
    pub simulated: Option<Simulated>,
    /// Optional outputs that this program was built with.
    pub outputs: OptionalOutputs,
    /// SHA-256 of the contents of files that are read only at the start, by the keys that name them.
    pub files: BTreeMap<&'static str, [u8; 32]>,
}

/// Outputs that are optional features of the program; configuring a missing one is an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OptionalOutputs {
    /// Records to an MQTT broker.
    pub mqtt: bool,
    /// Messages to ROS 2.
    pub ros: bool,
}

/// An array that the model plays.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulated {
    /// The array.
    pub array: Arc<RangerArray>,
    /// The way its robot takes, with times.
    pub course: Option<Arc<Course>>,
}

/// Values that are each in range but do not fit together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mismatch {
    /// The section of the key to look at.
    pub section: &'static str,
    /// That key.
    pub key: &'static str,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: String,
}

impl Settings {
    /// Which azimuths.
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

    /// How the motor turns and the ranger listens.
    #[must_use]
    pub fn motion(&self) -> Motion {
        Motion::from(&self.keys.motion)
    }

    /// What the configuration decides about every scan.
    #[must_use]
    pub fn setup(&self) -> Setup {
        Setup {
            sensor: self.sensor.clone(),
            model: self.keys.model.clone(),
            motion: self.keys.motion.clone(),
            thermometer: self.keys.air.file.is_some(),
        }
    }

    /// How echoes are predicted.
    #[must_use]
    pub fn options(&self) -> Options {
        // Options that the engine does not know are refused by `check`.
        self.keys.model.options.options_of_engine()
    }

    /// Farthest range of interest, metres.
    #[must_use]
    pub fn max_range_m(&self) -> f64 {
        self.keys.model.options.max_range_m.unwrap_or(self.sensor.max_range_m)
    }

    /// When another log is begun.
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

    /// Bounds of the wait from try to try.
    #[must_use]
    pub fn back_off(&self) -> BackOff {
        let link = &self.keys.link;
        BackOff {
            min: Duration::from_secs_f64(link.retry_min_s),
            max: Duration::from_secs_f64(link.retry_max_s.max(link.retry_min_s)),
        }
    }

    /// From the start of a scan to the next, if the mode is schedule.
    #[must_use]
    pub fn every(&self) -> Duration {
        Duration::from_secs_f64(self.keys.scanning.every_s)
    }

    /// Checks what ranges can't say.
    ///
    /// # Errors
    /// The first pair of values that do not go together.
    pub fn check(&self) -> Result<(), Mismatch> {
        let air = &self.keys.air;
        self.plan().check().map_err(|error| Mismatch {
            section: "plan",
            key: "to_deg",
            message: error.to_string(),
            help: "a full turn is from_deg = 0, to_deg = 360, step_deg = 0.9".into(),
        })?;
        let air = Air::new(air.temperature_c, air.humidity_percent, air.pressure_kpa).map_err(
            |error| Mismatch {
                section: "air",
                key: "temperature_c",
                message: error.to_string(),
                help: String::new(),
            },
        )?;
        // What the model plays listens until the next one of its rangers fires.
        if self.simulated.is_none() {
            let windowed = self.keys.motion.window_ms.is_some();
            let checked = self.motion().check_window(&listening(self, &air));
            checked.map_err(|deaf| Mismatch {
                section: if windowed { "motion" } else { "model" },
                key: if windowed { "window_ms" } else { "max_range_m" },
                message: deaf.to_string(),
                help: deaf.help(),
            })?;
        }
        self.keys.model.options.options().map_err(|foreign| Mismatch {
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
            checked.map_err(|(key, message, help)| Mismatch { section, key, message, help })?;
        }
        if self.keys.link.retry_max_s < self.keys.link.retry_min_s {
            return Err(Mismatch {
                section: "link",
                key: "retry_max_s",
                message: "the longest wait is shorter than the first one".into(),
                help: "give link.retry_max_s at least link.retry_min_s".into(),
            });
        }
        Ok(())
    }

    /// Whether a sensor in place of this one goes together with the rest.
    #[must_use]
    pub fn goes_with(&self, sensor: &Sensor) -> bool {
        Self { sensor: sensor.clone(), ..self.clone() }.check().is_ok()
    }

    fn check_server(&self) -> Result<(), Mismatch> {
        let server = &self.keys.server;
        if server.socket_permissions().is_none() {
            return Err(Mismatch {
                section: "server",
                key: "socket_mode",
                message: format!("server.socket_mode is {}", server.socket_mode),
                help: "three octal digits: 0660 for the socket's group, 0600 for its owner".into(),
            });
        }
        let Some(listen) = &server.listen else { return Ok(()) };
        let wrong = |message: String, help: &str| {
            Err(Mismatch { section: "server", key: "listen", message, help: help.into() })
        };
        let Ok(address) = listen.parse::<SocketAddr>() else {
            return wrong(
                format!("server.listen is {listen}"),
                "an address and a port, such as 127.0.0.1:8765 or [::1]:8765",
            );
        };
        if let Some(why) = never_bound(&address) {
            let message = format!("server.listen {listen} {why}");
            return wrong(message, "give an address of this computer, such as 127.0.0.1:8765");
        }
        if !address.ip().is_loopback() && server.token_file.is_none() {
            return wrong(
                format!("server.listen {listen} can be reached from other computers"),
                "listen on 127.0.0.1, or set server.token_file",
            );
        }
        Ok(())
    }

    fn check_robot(&self) -> Result<(), Mismatch> {
        let robot = &self.keys.fleet.robot;
        if is_robot_name(robot) {
            return Ok(());
        }
        Err(Mismatch {
            section: "fleet",
            key: "robot",
            message: format!("fleet.robot is {robot:?}"),
            help: format!("letters, digits, `-`, `_` and `.`, at most {MAX_ROBOT_NAME}: kiwi-7"),
        })
    }

    /// What differs from `before` and takes effect only after a restart: keys marked `(restart)`, as their section or
    /// `section.key`, and files that such keys name, as `contents of section.key`.
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
            // Where the section differs, the file may be another one.
            let is_named = keys.iter().any(|section| key.starts_with(&format!("{section}.")));
            if !is_named && self.files.get(key) != before.files.get(key) {
                keys.push(format!("contents of {key}"));
            }
        }
        keys
    }
}

/// Why no computer can ever listen on an address, if so.
fn never_bound(address: &SocketAddr) -> Option<&'static str> {
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

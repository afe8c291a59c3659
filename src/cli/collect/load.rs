//! From a plan's file to everything it names, checked.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::Args;
use crate::{
    acoustics::{Air, Sensor},
    cli::{Failure, options::load_sensor, scan::setup::Wish, scene_file},
    collect::{CollectionKeys, NamedPose, Order, PoseFault, read_file},
    config::{ConfigError, Layers},
    model::Options,
    ranger::Motion,
    scan::ScanPlan,
    scene::Scene,
};

/// Where poses come from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Poses {
    /// They are all known.
    Listed(Vec<NamedPose>),
    /// A person gives them.
    Prompt,
    /// A command that is run for each.
    Program(String),
    /// A command that prints them one by one.
    Stream(String),
}

/// A plan with everything it names.
pub(super) struct Loaded {
    pub(super) keys: CollectionKeys,
    pub(super) text: String,
    pub(super) folder: PathBuf,
    pub(super) scene: Arc<Scene>,
    pub(super) scene_text: String,
    pub(super) sensor: Sensor,
    pub(super) poses: Poses,
    pub(super) plan: ScanPlan,
    /// Motor steps a turn.
    pub(super) steps_per_revolution: u16,
    /// Where the keys were given.
    pub(super) layers: Layers<CollectionKeys>,
    /// The plan's file, as errors call it.
    pub(super) name: String,
}

impl Loaded {
    pub(super) fn new(args: &Args) -> Result<Self, Failure> {
        let path = args.plan.clone().unwrap_or_default();
        let text = fs::read_to_string(&path).map_err(|error| {
            Failure::input(
                format!("cannot read the plan {}: {error}", path.display()),
                "give a TOML file; `sonard collect --example` prints one",
            )
        })?;
        let name = path.display().to_string();
        let mut layers =
            Layers::<CollectionKeys>::new().file(&name, &text).map_err(|error| refuse(&error))?;
        for setting in &args.set {
            layers = layers.option("--set", setting).map_err(|error| refuse(&error))?;
        }
        let keys = layers.clone().keys().map_err(|error| refuse(&error))?;
        let at = Places { layers: &layers, file: &name };
        let scene_text = scene_file::read(&keys.place.scene)?;
        let scene = Arc::new(scene_file::load(&keys.place.scene)?);
        let sensor = sensor(load_sensor(&keys.sensor.sensor)?, &keys, &at)?;
        let plan = scan_plan(&keys, &at)?;
        air(&keys, keys.air.temperature_c)
            .map_err(|error| at.refuse("air", "temperature_c", error))?;
        let poses = poses(&keys, &scene, &at)?;
        if !matches!(poses, Poses::Listed(_)) && keys.collection.order != Order::ByPose {
            return Err(at.refuse(
                "collection",
                "order",
                Fault::new(
                    "poses that are asked for one by one can only be taken by pose",
                    "give all poses with poses.list or poses.file, or order = \"by-pose\"",
                ),
            ));
        }
        let given = args.port.is_some() || args.mock || args.emulator || args.daemon;
        let needed = !(args.check || args.plan_only);
        if needed && !given && keys.device.port.is_none() {
            return Err(Failure::input(
                "no device: the plan has no device.port",
                "set device.port, give --port or --daemon, or use --mock to try without one",
            ));
        }
        let folder = args
            .out
            .as_deref()
            .map_or_else(|| PathBuf::from(&keys.collection.folder), Path::to_path_buf);
        let steps_per_revolution = args.world.steps_per_revolution();
        Ok(Self {
            keys,
            text,
            folder,
            scene,
            scene_text,
            sensor,
            poses,
            plan,
            steps_per_revolution,
            layers,
            name,
        })
    }

    /// What is measured at a pose in this air.
    pub(super) fn wish(&self, pose: &NamedPose, air: Air) -> Wish {
        Wish {
            scene: Arc::clone(&self.scene),
            pose: pose.pose,
            pose_text: pose.label(),
            plan: self.plan,
            motion: self.motion(),
            sensor: self.sensor.clone(),
            air,
            options: self.options(),
        }
    }

    pub(super) fn air(&self, temperature_c: f64) -> Result<Air, Failure> {
        air(&self.keys, temperature_c).map_err(|fault| Failure::device(fault.message, fault.help))
    }

    pub(super) fn motion(&self) -> Motion {
        let keys = &self.keys.motion;
        Motion {
            window_ms: keys.window_ms,
            settle_ms: keys.settle_ms,
            min_interval_ms: keys.min_interval_ms,
            max_echoes: keys.max_echoes,
            speed: keys.speed,
            acceleration: keys.acceleration,
        }
    }

    fn options(&self) -> Options {
        let keys = &self.keys.sensor;
        Options {
            engine: keys.engine,
            max_range_m: keys.max_range_m,
            threshold: keys.threshold,
            ..Options::default()
        }
    }

    /// Poses that will be there, as far as that is known.
    pub(super) fn pose_count(&self) -> Option<u32> {
        match &self.poses {
            Poses::Listed(poses) => Some(poses.len() as u32),
            _ => Some(self.keys.poses.count).filter(|&count| count > 0),
        }
    }

    /// One screen about a plan that is right.
    pub(super) fn in_words(&self) -> String {
        let poses = match (&self.poses, self.pose_count()) {
            (Poses::Listed(poses), _) => {
                let names: Vec<_> = poses.iter().map(NamedPose::label).collect();
                format!("{} poses: {}", poses.len(), names.join("; "))
            }
            (_, Some(count)) => format!("at most {count} poses, asked for one by one"),
            (_, None) => "poses asked for one by one, until there are no more".into(),
        };
        format!(
            "The plan is right.\n  {}\n  {} scans at each, {} beams a scan, scene {}, sensor {}\n  \
             into {}\n",
            textwrap::fill(&poses, textwrap::Options::new(96).subsequent_indent("    ")),
            self.keys.collection.repeats,
            self.plan.beams(),
            self.scene.name,
            self.sensor.name,
            self.folder.display(),
        )
    }
}

/// What is wrong with a value, before it is said where.
pub(super) struct Fault {
    message: String,
    help: String,
}

impl Fault {
    fn new(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self { message: message.to_string(), help: help.to_string() }
    }
}

/// Where values were given.
pub(super) struct Places<'a> {
    pub(super) layers: &'a Layers<CollectionKeys>,
    pub(super) file: &'a str,
}

impl Places<'_> {
    fn refuse(&self, section: &str, key: &str, fault: Fault) -> Failure {
        let origin = self.layers.origin(section, key);
        let place = origin.map_or_else(|| self.file.to_owned(), ToString::to_string);
        Failure::input(format!("{place}: {section}.{key}: {}", fault.message), fault.help)
    }
}

fn air(keys: &CollectionKeys, temperature_c: f64) -> Result<Air, Fault> {
    let keys = &keys.air;
    Air::new(temperature_c, keys.humidity_percent, keys.pressure_kpa)
        .map_err(|error| Fault::new(error, "degrees Celsius, percent and kilopascals"))
}

fn scan_plan(keys: &CollectionKeys, at: &Places<'_>) -> Result<ScanPlan, Failure> {
    let keys = &keys.plan;
    let plan = ScanPlan {
        from_deg: keys.from_deg,
        to_deg: keys.to_deg,
        step_deg: keys.step_deg,
        pings_per_stop: keys.pings_per_stop,
    };
    let help = "a full turn is from_deg = 0, to_deg = 360, step_deg = 0.9";
    plan.check().map_err(|error| at.refuse("plan", "to_deg", Fault::new(error, help)))?;
    Ok(plan)
}

/// A sensor as the plan changes it.
pub(super) fn sensor(
    mut sensor: Sensor,
    keys: &CollectionKeys,
    at: &Places<'_>,
) -> Result<Sensor, Failure> {
    let keys = &keys.sensor;
    if keys.short_blanking {
        sensor.blanking_us = sensor.short_blanking_us.ok_or_else(|| {
            let message = format!("{} has no short_blanking_us", sensor.name);
            at.refuse("sensor", "short_blanking", Fault::new(message, "give blanking_us instead"))
        })?;
    }
    sensor.blanking_us = keys.blanking_us.unwrap_or(sensor.blanking_us);
    sensor.mounting.z_m = keys.height_m.or(sensor.mounting.z_m);
    sensor.mounting.tilt_deg = keys.tilt_deg.unwrap_or(sensor.mounting.tilt_deg);
    sensor.check().map_err(|error| {
        at.refuse("sensor", "sensor", Fault::new(error, "correct that figure of the sensor"))
    })?;
    Ok(sensor)
}

fn poses(keys: &CollectionKeys, scene: &Scene, at: &Places<'_>) -> Result<Poses, Failure> {
    let keys = &keys.poses;
    let given = [
        !keys.list.is_empty(),
        keys.file.is_some(),
        keys.program.is_some(),
        keys.stream.is_some(),
        keys.prompt,
    ];
    let help = "give exactly one of list, file, program, stream and prompt in [poses]";
    match given.iter().filter(|&&given| given).count() {
        1 => {}
        0 => return Err(at.refuse("poses", "list", Fault::new("no poses", help))),
        _ => {
            let fault = Fault::new("poses from more than one source", help);
            return Err(at.refuse("poses", "list", fault));
        }
    }
    if let Some(file) = &keys.file {
        return poses_of_file(Path::new(file), scene).map(Poses::Listed);
    }
    let listed = keys.list.iter().map(|text| {
        NamedPose::parse(text, scene)
            .map_err(|fault| at.refuse("poses", "list", Fault::new(&fault, &fault.help)))
    });
    Ok(match (&keys.program, &keys.stream) {
        (Some(command), _) => Poses::Program(command.clone()),
        (_, Some(command)) => Poses::Stream(command.clone()),
        _ if keys.prompt => Poses::Prompt,
        _ => Poses::Listed(listed.collect::<Result<_, _>>()?),
    })
}

fn poses_of_file(file: &Path, scene: &Scene) -> Result<Vec<NamedPose>, Failure> {
    let name = file.display();
    let text = fs::read_to_string(file).map_err(|error| {
        Failure::input(
            format!("cannot read the poses {name}: {error}"),
            "poses.file names a CSV or JSON lines file, seen from where sonard is started",
        )
    })?;
    read_file(&text, scene).map_err(|fault: PoseFault| {
        let line = fault.line.map_or_else(String::new, |line| format!("{line}:"));
        Failure::input(format!("{name}:{line} {fault}"), &fault.help)
    })
}

fn refuse(error: &ConfigError) -> Failure {
    Failure::input(error, &error.help)
}

//! Loads and validates a plan with the files that it names.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::Args;
use crate::{
    acoustics::{Air, Sensor},
    cli::{Failure, options::load_sensor, scene_file},
    collect::{
        CollectionKeys, CollectionPlan, NamedPose, Order, PoseFault, Poses, parse_pose_file,
    },
    config::{ConfigError, ConfigLayers},
    scan::ScanPlan,
    scene::Scene,
};

/// Loads the plan with the overrides of the options.
pub(super) fn load(args: &Args) -> Result<CollectionPlan, Failure> {
    let path = args.plan.clone().unwrap_or_default();
    let text = fs::read_to_string(&path).map_err(|error| {
        Failure::input(
            format!("cannot read the plan {}: {error}", path.display()),
            "give a TOML file; `sonard collect --example` prints one",
        )
    })?;
    let name = path.display().to_string();
    let mut layers = ConfigLayers::<CollectionKeys>::new()
        .with_file(&name, &text)
        .map_err(|error| failure_from(&error))?;
    for setting in &args.set {
        layers = layers.with_option("--set", setting).map_err(|error| failure_from(&error))?;
    }
    let mut keys: CollectionKeys =
        layers.clone().into_keys().map_err(|error| failure_from(&error))?;
    let at = Origins { layers: &layers, file: &name };
    let (scene_text, scene) = match keys.place.scene.as_str() {
        "" => {
            keys.checks.max_unexplained_share = 1.0;
            unknown_room(args)?
        }
        name => (scene_file::read(Path::new(name))?, scene_file::load(Path::new(name))?),
    };
    let scene = Arc::new(scene);
    let sensor = sensor(load_sensor(&keys.sensor.sensor)?, &keys, &at)?;
    let plan = scan_plan(&keys, &at)?;
    let poses = poses(&keys, &scene, &at)?;
    check(&keys, &poses, &at)?;
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
    Ok(CollectionPlan {
        keys,
        text,
        folder,
        scene,
        scene_text,
        sensor,
        poses,
        azimuths: plan,
        steps_per_revolution,
        layers,
        name,
    })
}

/// Text and scene of a room without known walls.
fn unknown_room(args: &Args) -> Result<(String, Scene), Failure> {
    if (args.mock || args.emulator) && !args.world.has_truth() {
        return Err(Failure::input(
            "the scene is empty: nothing reflects sound on the mock",
            "give the true room with --truth",
        ));
    }
    let room = Scene::builder("unknown room");
    let scene = room.build().map_err(|error| Failure::input(error, "report this as a bug"))?;
    Ok((room.text(), scene))
}

/// Validates combinations of keys.
fn check(keys: &CollectionKeys, poses: &Poses, at: &Origins<'_>) -> Result<(), Failure> {
    let air = &keys.air;
    Air::new(air.temperature_c, air.humidity_percent, air.pressure_kpa).map_err(|error| {
        let fault = Fault::new(error, "degrees Celsius, percent and kilopascals");
        at.failure_from("air", "temperature_c", fault)
    })?;
    keys.sensor.options.options().map_err(|foreign| {
        at.failure_from("sensor", foreign.option, Fault::new(foreign, foreign.help()))
    })?;
    if matches!(poses, Poses::Listed(_)) || keys.collection.order == Order::ByPose {
        return Ok(());
    }
    let fault = Fault::new(
        "poses that are requested one by one require order = \"by-pose\"",
        "give all poses with poses.list or poses.file, or order = \"by-pose\"",
    );
    Err(at.failure_from("collection", "order", fault))
}

/// Describes a valid plan in a few lines.
pub(super) fn describe(plan: &CollectionPlan) -> String {
    let poses = match (&plan.poses, plan.pose_count()) {
        (Poses::Listed(poses), _) => {
            let names: Vec<_> = poses.iter().map(NamedPose::label).collect();
            format!("{} poses: {}", poses.len(), names.join("; "))
        }
        (_, Some(count)) => format!("at most {count} poses, requested one by one"),
        (_, None) => "poses requested one by one, until there are no more".into(),
    };
    format!(
        "The plan is valid.\n  {}\n  {} scans per pose, {} beams per scan, scene {}, sensor {}\n  \
         output: {}\n",
        textwrap::fill(&poses, textwrap::Options::new(96).subsequent_indent("    ")),
        plan.keys.collection.repeats,
        plan.azimuths.beams(),
        plan.scene.name,
        plan.sensor.name,
        plan.folder.display(),
    )
}

/// Invalid value: message and advice, without its location.
pub(super) struct Fault {
    message: String,
    help: String,
}

impl Fault {
    fn new(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self { message: message.to_string(), help: help.to_string() }
    }
}

/// Origins of values: plan file, environment and options.
pub(super) struct Origins<'a> {
    pub(super) layers: &'a ConfigLayers<CollectionKeys>,
    pub(super) file: &'a str,
}

impl Origins<'_> {
    fn failure_from(&self, section: &str, key: &str, fault: Fault) -> Failure {
        let origin = self.layers.origin(section, key);
        let place = origin.map_or_else(|| self.file.to_owned(), ToString::to_string);
        Failure::input(format!("{place}: {section}.{key}: {}", fault.message), fault.help)
    }
}

fn scan_plan(keys: &CollectionKeys, at: &Origins<'_>) -> Result<ScanPlan, Failure> {
    let keys = &keys.plan;
    let plan = ScanPlan {
        from_deg: keys.from_deg,
        to_deg: keys.to_deg,
        step_deg: keys.step_deg,
        pings_per_stop: keys.pings_per_stop,
    };
    let help = "a full revolution is from_deg = 0, to_deg = 360, step_deg = 0.9";
    plan.check().map_err(|error| at.failure_from("plan", "to_deg", Fault::new(error, help)))?;
    Ok(plan)
}

/// Applies the plan's overrides to a sensor.
pub(super) fn sensor(
    mut sensor: Sensor,
    keys: &CollectionKeys,
    at: &Origins<'_>,
) -> Result<Sensor, Failure> {
    let keys = &keys.sensor;
    if keys.short_blanking {
        sensor.blanking_us = sensor.short_blanking_us.ok_or_else(|| {
            let message = format!("{} has no short_blanking_us", sensor.name);
            at.failure_from(
                "sensor",
                "short_blanking",
                Fault::new(message, "give blanking_us instead"),
            )
        })?;
    }
    sensor.blanking_us = keys.blanking_us.unwrap_or(sensor.blanking_us);
    sensor.mounting.z_m = keys.height_m.or(sensor.mounting.z_m);
    sensor.mounting.tilt_deg = keys.tilt_deg.unwrap_or(sensor.mounting.tilt_deg);
    sensor.check().map_err(|error| {
        at.failure_from("sensor", "sensor", Fault::new(error, "correct that figure of the sensor"))
    })?;
    Ok(sensor)
}

fn poses(keys: &CollectionKeys, scene: &Scene, at: &Origins<'_>) -> Result<Poses, Failure> {
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
        0 => return Err(at.failure_from("poses", "list", Fault::new("no poses", help))),
        _ => {
            let fault = Fault::new("poses from more than one source", help);
            return Err(at.failure_from("poses", "list", fault));
        }
    }
    if let Some(file) = &keys.file {
        return load_poses(Path::new(file), scene).map(Poses::Listed);
    }
    let listed = keys.list.iter().map(|text| {
        NamedPose::parse(text, scene)
            .map_err(|fault| at.failure_from("poses", "list", Fault::new(&fault, &fault.help)))
    });
    Ok(match (&keys.program, &keys.stream) {
        (Some(command), _) => Poses::Program(command.clone()),
        (_, Some(command)) => Poses::Stream(command.clone()),
        _ if keys.prompt => Poses::Prompt,
        _ => Poses::Listed(listed.collect::<Result<_, _>>()?),
    })
}

fn load_poses(file: &Path, scene: &Scene) -> Result<Vec<NamedPose>, Failure> {
    let name = file.display();
    let text = fs::read_to_string(file).map_err(|error| {
        Failure::input(
            format!("cannot read the poses {name}: {error}"),
            "poses.file names a CSV or JSON lines file, relative to the working directory",
        )
    })?;
    parse_pose_file(&text, scene).map_err(|fault: PoseFault| {
        let line = fault.line.map_or_else(String::new, |line| format!("{line}:"));
        Failure::input(format!("{name}:{line} {fault}"), &fault.help)
    })
}

fn failure_from(error: &ConfigError) -> Failure {
    Failure::input(error, &error.help)
}

//! From a plan's file to everything it names, checked.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::Args;
use crate::{
    acoustics::{Air, Sensor},
    cli::{Failure, options::load_sensor, scene_file},
    collect::{CollectionKeys, NamedPose, Order, Plan, PoseFault, Poses, read_file},
    config::{ConfigError, Layers},
    scan::ScanPlan,
    scene::Scene,
};

/// The plan that the options name.
pub(super) fn load(args: &Args) -> Result<Plan, Failure> {
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
    Ok(Plan {
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

/// Checks what the ranges of single keys can't say.
fn check(keys: &CollectionKeys, poses: &Poses, at: &Places<'_>) -> Result<(), Failure> {
    let air = &keys.air;
    Air::new(air.temperature_c, air.humidity_percent, air.pressure_kpa).map_err(|error| {
        let fault = Fault::new(error, "degrees Celsius, percent and kilopascals");
        at.refuse("air", "temperature_c", fault)
    })?;
    keys.sensor.options.options().map_err(|foreign| {
        at.refuse("sensor", foreign.option, Fault::new(foreign, foreign.help()))
    })?;
    if matches!(poses, Poses::Listed(_)) || keys.collection.order == Order::ByPose {
        return Ok(());
    }
    let fault = Fault::new(
        "poses that are asked for one by one can only be taken by pose",
        "give all poses with poses.list or poses.file, or order = \"by-pose\"",
    );
    Err(at.refuse("collection", "order", fault))
}

/// One screen about a plan that is right.
pub(super) fn in_words(plan: &Plan) -> String {
    let poses = match (&plan.poses, plan.pose_count()) {
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
        plan.keys.collection.repeats,
        plan.azimuths.beams(),
        plan.scene.name,
        plan.sensor.name,
        plan.folder.display(),
    )
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

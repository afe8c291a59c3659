//! What numbers of a specification can't be.

use std::collections::BTreeMap;

use sonard_model::{acoustics::Sensor, plan::ScanPlan, scene::Scene};

use super::{KeepKeys, SceneKeys, Shape, Spec, error::Fault};
use crate::spread::Spread;

/// Shards, scenes of one, and poses of a scene, at most.
const MOST_SHARDS: u32 = 1_000_000;
const MOST_SCENES: u32 = 100_000;
const MOST_POSES: u32 = 100_000;
/// Boxes, cylinders or partitions in a scene, at most.
const MOST_FURNITURE: f64 = 100.0;
/// A room is at most so wide, metres.
const MOST_ROOM_M: f64 = 1000.0;
/// Samples of a trace, at most.
const MOST_SAMPLES: f64 = 100_000.0;

pub(super) fn check(
    spec: &Spec,
    sensors: &[Sensor],
    scenes: &BTreeMap<String, Scene>,
) -> Result<(), Fault> {
    check_set(spec)?;
    if spec.scene.is_empty() {
        return Err(Fault::new("scene", "there is no kind of scenes", "give a [[scene]]"));
    }
    for (index, keys) in spec.scene.iter().enumerate() {
        check_scene(&format!("scene[{index}]"), keys, spec)?;
        let empty = keys.file.as_ref().and_then(|name| scenes.get(name));
        if empty.is_some_and(|scene| scene.walls.is_empty() && scene.cylinders.is_empty()) {
            let help = "give one with walls, between which a ranger can stand";
            return Err(Fault::new(format!("scene[{index}].file"), "the scene is empty", help));
        }
    }
    for (name, material) in &spec.materials {
        let of = |field: &str| format!("materials.{name}.{field}");
        within(of("reflectance"), &material.reflectance, 0.0, 1.0)?;
        within(of("roughness"), &material.roughness, 0.0, 1.0)?;
    }
    check_furniture(spec)?;
    if sensors.is_empty() {
        let help = "name a preset (`sonard sensor list`) or a file";
        return Err(Fault::new("sensor.any_of", "there is no sensor", help));
    }
    within("poses.heading_deg", &spec.poses.heading_deg, -360.0, 360.0)?;
    number("poses.clearance_m", spec.poses.clearance_m, 0.001, 100.0)?;
    let plan = ScanPlan::from(&spec.plan);
    plan.check().map_err(|error| Fault::new("plan", error.to_string(), "degrees, as in a scan"))?;
    // What the formulas of the air cover.
    within("air.temperature_c", &spec.air.temperature_c, -20.0, 50.0)?;
    within("air.humidity_percent", &spec.air.humidity_percent, 0.0, 100.0)?;
    within("air.pressure_kpa", &spec.air.pressure_kpa, 60.0, 110.0)?;
    within("noise.floor", &spec.noise.floor, 0.0, 1.0)?;
    within("noise.jitter_us", &spec.noise.jitter_us, 0.0, 1e4)?;
    spec.model.options().map_err(|error| {
        Fault::new(format!("model.{}", error.option), error.to_string(), error.help())
    })?;
    check_keep(&spec.keep)
}

fn check_set(spec: &Spec) -> Result<(), Fault> {
    let set = &spec.set;
    if set.name.trim().is_empty() || set.name.contains('\n') {
        return Err(Fault::new("set.name", "it is no name", "give a few words on one line"));
    }
    for (field, value, most) in [
        ("set.shards", set.shards, MOST_SHARDS),
        ("set.scenes", set.scenes, MOST_SCENES),
        ("set.poses", set.poses, MOST_POSES),
    ] {
        number(field, value.into(), 1.0, most.into())?;
    }
    Ok(())
}

fn check_scene(path: &str, keys: &SceneKeys, spec: &Spec) -> Result<(), Fault> {
    let of = |field: &str| format!("{path}.{field}");
    number(of("weight"), keys.weight, 0.0, 1e9)?;
    if keys.weight == 0.0 && spec.scene.len() == 1 {
        return Err(Fault::new(of("weight"), "it is 0, and there is no other", "give 1"));
    }
    let is_file = keys.shape == Shape::File;
    let has_notch = matches!(keys.shape, Shape::L | Shape::T);
    let shape = format!("{:?}", keys.shape).to_lowercase();
    for (field, is_there, belongs) in [
        ("file", keys.file.is_some(), is_file),
        ("width_m", keys.width_m.is_some(), !is_file),
        ("depth_m", keys.depth_m.is_some(), !is_file),
    ] {
        match (is_there, belongs) {
            (false, true) => {
                let message = format!("a scene of shape {shape} needs {field}");
                return Err(Fault::new(of("shape"), message, format!("give {field}")));
            }
            (true, false) => return Err(foreign(of(field), field, &shape)),
            _ => {}
        }
    }
    for (field, is_there, belongs) in [
        ("notch", keys.notch.is_some(), has_notch),
        ("corners", keys.corners.is_some(), keys.shape == Shape::Polygon),
        ("turn_deg", keys.turn_deg.is_some(), !is_file),
        ("walls", !keys.walls.is_empty(), !is_file),
    ] {
        if is_there && !belongs {
            return Err(foreign(of(field), field, &shape));
        }
    }
    for (field, spread, least, most) in [
        ("width_m", &keys.width_m, 0.1, MOST_ROOM_M),
        ("depth_m", &keys.depth_m, 0.1, MOST_ROOM_M),
        ("notch", &keys.notch, 0.05, 0.9),
        ("turn_deg", &keys.turn_deg, -360.0, 360.0),
    ] {
        spread.as_ref().map_or(Ok(()), |spread| within(of(field), spread, least, most))?;
    }
    if let Some(corners) = &keys.corners {
        count(of("corners"), corners, 3.0, MOST_FURNITURE)?;
    }
    materials(&of("walls"), &keys.walls, spec)
}

fn foreign(path: String, field: &str, shape: &str) -> Fault {
    Fault::new(path, format!("a scene of shape {shape} has no {field}"), "leave it out")
}

fn check_furniture(spec: &Spec) -> Result<(), Fault> {
    let keys = &spec.furniture;
    count("furniture.boxes", &keys.boxes, 0.0, MOST_FURNITURE)?;
    count("furniture.cylinders", &keys.cylinders, 0.0, MOST_FURNITURE)?;
    count("furniture.partitions", &keys.partitions, 0.0, MOST_FURNITURE)?;
    within("furniture.box_m", &keys.box_m, 0.01, MOST_ROOM_M)?;
    within("furniture.box_turn_deg", &keys.box_turn_deg, -360.0, 360.0)?;
    within("furniture.radius_m", &keys.radius_m, 0.001, MOST_ROOM_M)?;
    within("furniture.partition_m", &keys.partition_m, 0.01, MOST_ROOM_M)?;
    number("furniture.gap_m", keys.gap_m, 0.01, MOST_ROOM_M)?;
    materials("furniture.materials", &keys.materials, spec)?;
    if spec.materials.is_empty() {
        let help = "name one: plaster = { reflectance = 0.97 }";
        return Err(Fault::new("materials", "there is no material", help));
    }
    if let Some(height) = &keys.height_m {
        if spec.heights.is_none() {
            let help = "leave it out, or give the section [heights]";
            return Err(Fault::new("furniture.height_m", "scenes have no heights", help));
        }
        within("furniture.height_m", height, 0.01, MOST_ROOM_M)?;
    }
    let Some(heights) = &spec.heights else { return Ok(()) };
    within("heights.ceiling_m", &heights.ceiling_m, 0.1, MOST_ROOM_M)?;
    // The transducer has to be below every ceiling, whichever is drawn with it.
    within("heights.sensor_m", &heights.sensor_m, 0.01, heights.ceiling_m.least() - 0.01)?;
    materials("heights.floor", &heights.floor, spec)?;
    materials("heights.ceiling", &heights.ceiling, spec)
}

fn check_keep(keep: &KeepKeys) -> Result<(), Fault> {
    number("keep.echoes_down_to", keep.echoes_down_to, 0.0, 1.0)?;
    number("keep.trace_to_m", keep.trace_to_m, 0.0, 100.0)?;
    number("keep.trace_step_us", keep.trace_step_us, 1.0, 10_000.0)?;
    number("keep.occupancy_m", keep.occupancy_m, 0.0, 10.0)?;
    // There and back, at a speed that no air is slower than.
    let samples = 2e6 * keep.trace_to_m / 200.0 / keep.trace_step_us;
    if samples > MOST_SAMPLES {
        let message = format!("a trace would have {samples:.0} samples, more than {MOST_SAMPLES}");
        return Err(Fault::new("keep.trace_to_m", message, "give longer steps or a nearer end"));
    }
    Ok(())
}

fn materials(path: &str, names: &[String], spec: &Spec) -> Result<(), Fault> {
    for (index, name) in names.iter().enumerate() {
        if !spec.materials.contains_key(name) {
            let known: Vec<_> = spec.materials.keys().cloned().collect();
            let help = sonard_model::scene::suggest(name, &known, "materials");
            return Err(Fault::new(
                format!("{path}[{index}]"),
                format!("there is no material `{name}`"),
                help,
            ));
        }
    }
    Ok(())
}

fn count(path: impl Into<String>, spread: &Spread, least: f64, most: f64) -> Result<(), Fault> {
    let path = path.into();
    if spread.least().fract() != 0.0 || spread.most().fract() != 0.0 {
        return Err(Fault::new(path, "it counts things", "give whole numbers"));
    }
    within(path, spread, least, most)
}

fn within(path: impl Into<String>, spread: &Spread, least: f64, most: f64) -> Result<(), Fault> {
    match spread.least() >= least && spread.most() <= most {
        true => Ok(()),
        false => {
            let message = match spread.least() == spread.most() {
                true => format!("it is {}", spread.least()),
                false => format!("it can be {} to {}", spread.least(), spread.most()),
            };
            Err(Fault::new(path, message, format!("give {least} to {most}")))
        }
    }
}

/// Written so that NaN is refused too.
fn number(path: impl Into<String>, value: f64, least: f64, most: f64) -> Result<(), Fault> {
    match (least..=most).contains(&value) {
        true => Ok(()),
        false => Err(Fault::new(path, format!("it is {value}"), format!("give {least} to {most}"))),
    }
}

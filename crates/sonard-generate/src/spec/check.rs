//! Validation of the values of a specification.

use std::collections::BTreeMap;

use sonard_model::{acoustics::Sensor, scan_plan::ScanPlan, scene::Scene};

use super::{KeepKeys, RoomShape, Spec, SpecSceneKeys, error::SpecFault};
use crate::distribution::NumberDistribution;

/// Maximum numbers of shards, of scenes per shard, and of poses per scene.
const MAX_SHARDS: u32 = 1_000_000;
const MAX_SCENES: u32 = 100_000;
const MAX_POSES: u32 = 100_000;
/// Maximum number of boxes, cylinders or partitions per scene.
const MAX_FURNITURE: f64 = 100.0;
/// Maximum size of a room, metres.
const MAX_ROOM_M: f64 = 1000.0;
/// Maximum number of samples of an envelope.
const MAX_SAMPLES: f64 = 100_000.0;

pub(super) fn check(
    spec: &Spec,
    sensors: &[Sensor],
    scenes: &BTreeMap<String, Scene>,
) -> Result<(), SpecFault> {
    check_set(spec)?;
    if spec.scene.is_empty() {
        return Err(SpecFault::new("scene", "there is no kind of scenes", "give a [[scene]]"));
    }
    for (index, keys) in spec.scene.iter().enumerate() {
        check_scene(&format!("scene[{index}]"), keys, spec)?;
        let empty = keys.file.as_ref().and_then(|name| scenes.get(name));
        if empty.is_some_and(|scene| scene.walls.is_empty() && scene.cylinders.is_empty()) {
            let help = "give a scene with walls that enclose free space";
            return Err(SpecFault::new(format!("scene[{index}].file"), "the scene is empty", help));
        }
    }
    for (name, material) in &spec.materials {
        let field_path = |field: &str| format!("materials.{name}.{field}");
        within(field_path("reflectance"), &material.reflectance, 0.0, 1.0)?;
        within(field_path("roughness"), &material.roughness, 0.0, 1.0)?;
    }
    check_furniture(spec)?;
    if sensors.is_empty() {
        let help = "name a preset (`sonard sensor list`) or a file";
        return Err(SpecFault::new("sensor.any_of", "there is no sensor", help));
    }
    within("poses.heading_deg", &spec.poses.heading_deg, -360.0, 360.0)?;
    number("poses.clearance_m", spec.poses.clearance_m, 0.001, 100.0)?;
    let plan = ScanPlan::from(&spec.plan);
    plan.check()
        .map_err(|error| SpecFault::new("plan", error.to_string(), "degrees, as in a scan"))?;
    // Range of validity of the formulas of the air.
    within("air.temperature_c", &spec.air.temperature_c, -20.0, 50.0)?;
    within("air.humidity_percent", &spec.air.humidity_percent, 0.0, 100.0)?;
    within("air.pressure_kpa", &spec.air.pressure_kpa, 60.0, 110.0)?;
    within("noise.floor", &spec.noise.floor, 0.0, 1.0)?;
    within("noise.jitter_us", &spec.noise.jitter_us, 0.0, 1e4)?;
    spec.model.options().map_err(|error| {
        SpecFault::new(format!("model.{}", error.option), error.to_string(), error.help())
    })?;
    check_keep(&spec.keep)
}

fn check_set(spec: &Spec) -> Result<(), SpecFault> {
    let set = &spec.set;
    if set.name.trim().is_empty() || set.name.contains('\n') {
        return Err(SpecFault::new("set.name", "it is not a name", "give a few words on one line"));
    }
    for (field, value, max) in [
        ("set.shards", set.shards, MAX_SHARDS),
        ("set.scenes", set.scenes, MAX_SCENES),
        ("set.poses", set.poses, MAX_POSES),
    ] {
        number(field, value.into(), 1.0, max.into())?;
    }
    Ok(())
}

fn check_scene(path: &str, keys: &SpecSceneKeys, spec: &Spec) -> Result<(), SpecFault> {
    let field_path = |field: &str| format!("{path}.{field}");
    number(field_path("weight"), keys.weight, 0.0, 1e9)?;
    if keys.weight == 0.0 && spec.scene.len() == 1 {
        return Err(SpecFault::new(
            field_path("weight"),
            "it is 0, but there is no other kind",
            "give 1",
        ));
    }
    let is_file = keys.shape == RoomShape::File;
    let has_notch = matches!(keys.shape, RoomShape::L | RoomShape::T);
    let shape = format!("{:?}", keys.shape).to_lowercase();
    for (field, is_given, is_allowed) in [
        ("file", keys.file.is_some(), is_file),
        ("width_m", keys.width_m.is_some(), !is_file),
        ("depth_m", keys.depth_m.is_some(), !is_file),
    ] {
        match (is_given, is_allowed) {
            (false, true) => {
                let message = format!("a scene of shape {shape} needs {field}");
                return Err(SpecFault::new(field_path("shape"), message, format!("give {field}")));
            }
            (true, false) => return Err(not_allowed(field_path(field), field, &shape)),
            _ => {}
        }
    }
    for (field, is_given, is_allowed) in [
        ("notch", keys.notch.is_some(), has_notch),
        ("corners", keys.corners.is_some(), keys.shape == RoomShape::Polygon),
        ("turn_deg", keys.turn_deg.is_some(), !is_file),
        ("walls", !keys.walls.is_empty(), !is_file),
    ] {
        if is_given && !is_allowed {
            return Err(not_allowed(field_path(field), field, &shape));
        }
    }
    for (field, spread, min, max) in [
        ("width_m", &keys.width_m, 0.1, MAX_ROOM_M),
        ("depth_m", &keys.depth_m, 0.1, MAX_ROOM_M),
        ("notch", &keys.notch, 0.05, 0.9),
        ("turn_deg", &keys.turn_deg, -360.0, 360.0),
    ] {
        spread.as_ref().map_or(Ok(()), |spread| within(field_path(field), spread, min, max))?;
    }
    if let Some(corners) = &keys.corners {
        count(field_path("corners"), corners, 3.0, MAX_FURNITURE)?;
    }
    materials(&field_path("walls"), &keys.walls, spec)
}

fn not_allowed(path: String, field: &str, shape: &str) -> SpecFault {
    SpecFault::new(path, format!("a scene of shape {shape} has no {field}"), "leave it out")
}

fn check_furniture(spec: &Spec) -> Result<(), SpecFault> {
    let keys = &spec.furniture;
    count("furniture.boxes", &keys.boxes, 0.0, MAX_FURNITURE)?;
    count("furniture.cylinders", &keys.cylinders, 0.0, MAX_FURNITURE)?;
    count("furniture.partitions", &keys.partitions, 0.0, MAX_FURNITURE)?;
    within("furniture.box_m", &keys.box_m, 0.01, MAX_ROOM_M)?;
    within("furniture.box_turn_deg", &keys.box_turn_deg, -360.0, 360.0)?;
    within("furniture.radius_m", &keys.radius_m, 0.001, MAX_ROOM_M)?;
    within("furniture.partition_m", &keys.partition_m, 0.01, MAX_ROOM_M)?;
    number("furniture.gap_m", keys.gap_m, 0.01, MAX_ROOM_M)?;
    materials("furniture.materials", &keys.materials, spec)?;
    if spec.materials.is_empty() {
        let help = "name one: plaster = { reflectance = 0.97 }";
        return Err(SpecFault::new("materials", "there is no material", help));
    }
    if let Some(height) = &keys.height_m {
        if spec.heights.is_none() {
            let help = "leave it out, or give the section [heights]";
            return Err(SpecFault::new("furniture.height_m", "scenes have no heights", help));
        }
        within("furniture.height_m", height, 0.01, MAX_ROOM_M)?;
    }
    let Some(heights) = &spec.heights else { return Ok(()) };
    within("heights.ceiling_m", &heights.ceiling_m, 0.1, MAX_ROOM_M)?;
    // The transducer must be below every possible ceiling.
    within("heights.sensor_m", &heights.sensor_m, 0.01, heights.ceiling_m.min() - 0.01)?;
    materials("heights.floor", &heights.floor, spec)?;
    materials("heights.ceiling", &heights.ceiling, spec)
}

fn check_keep(keep: &KeepKeys) -> Result<(), SpecFault> {
    number("keep.min_echo_amplitude", keep.min_echo_amplitude, 0.0, 1.0)?;
    number("keep.envelope_range_m", keep.envelope_range_m, 0.0, 100.0)?;
    number("keep.envelope_step_us", keep.envelope_step_us, 1.0, 10_000.0)?;
    number("keep.occupancy_m", keep.occupancy_m, 0.0, 10.0)?;
    // Two-way, at a lower bound of the sound speed.
    let samples = 2e6 * keep.envelope_range_m / 200.0 / keep.envelope_step_us;
    if samples > MAX_SAMPLES {
        let message =
            format!("an envelope would have {samples:.0} samples, more than {MAX_SAMPLES}");
        return Err(SpecFault::new(
            "keep.envelope_range_m",
            message,
            "give longer steps or a shorter range",
        ));
    }
    Ok(())
}

fn materials(path: &str, names: &[String], spec: &Spec) -> Result<(), SpecFault> {
    for (index, name) in names.iter().enumerate() {
        if !spec.materials.contains_key(name) {
            let known: Vec<_> = spec.materials.keys().cloned().collect();
            let help = sonard_model::scene::suggest(name, &known, "materials");
            return Err(SpecFault::new(
                format!("{path}[{index}]"),
                format!("there is no material `{name}`"),
                help,
            ));
        }
    }
    Ok(())
}

fn count(
    path: impl Into<String>,
    spread: &NumberDistribution,
    min: f64,
    max: f64,
) -> Result<(), SpecFault> {
    let path = path.into();
    if spread.min().fract() != 0.0 || spread.max().fract() != 0.0 {
        return Err(SpecFault::new(path, "it counts things", "give whole numbers"));
    }
    within(path, spread, min, max)
}

fn within(
    path: impl Into<String>,
    spread: &NumberDistribution,
    min: f64,
    max: f64,
) -> Result<(), SpecFault> {
    match spread.min() >= min && spread.max() <= max {
        true => Ok(()),
        false => {
            let message = match spread.min() == spread.max() {
                true => format!("it is {}", spread.min()),
                false => format!("it can be {} to {}", spread.min(), spread.max()),
            };
            Err(SpecFault::new(path, message, format!("give {min} to {max}")))
        }
    }
}

/// Checks a number; also rejects NaN.
fn number(path: impl Into<String>, value: f64, min: f64, max: f64) -> Result<(), SpecFault> {
    match (min..=max).contains(&value) {
        true => Ok(()),
        false => {
            Err(SpecFault::new(path, format!("it is {value}"), format!("give {min} to {max}")))
        }
    }
}

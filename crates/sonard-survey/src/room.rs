//! World of a survey before its walls are known.

use std::sync::Arc;

use sonard_inverse::World;
use sonard_model::{
    acoustics::{Air, Sensor},
    model::Options,
    scene::{Material, Scene},
};

use crate::{error::SurveyError, result::MATERIAL};

/// World without walls. Its maximum range is the shortest of `max_range_m` and those of options and
/// sensor; longer ranges count as no echo.
///
/// # Errors
/// A maximum range outside of 0.3 to 20 m.
pub fn unknown_room(
    sensor: Sensor,
    air: Air,
    options: Options,
    max_range_m: f64,
) -> Result<World, SurveyError> {
    if !(0.3..=20.0).contains(&max_range_m) {
        let (name, expected) = ("max_range_m", "from 0.3 to 20");
        return Err(SurveyError::Option { name, value: max_range_m, expected });
    }
    let scene = Arc::new(Scene::builder("unknown room").material(MATERIAL, 1.0).build()?);
    let measured_m = options.max_range_m.unwrap_or(sensor.max_range_m);
    let max_range_m = Some(max_range_m.min(measured_m));
    Ok(World::new(scene, sensor, air, Options { max_range_m, ..options }))
}

/// World of an empty scene with the material of the walls, the transducer on the axis: ranges are
/// from there.
pub(crate) fn empty_world(world: &World, reflectance: f64) -> World {
    let mut world = empty_scene_of(world, reflectance);
    // Rounded predictions have no derivatives; the step is part of the errors of ranges.
    world.sensor.range_step_m = 0.0;
    let mounting = &mut world.sensor.mounting;
    world.delay_m -= mounting.ahead_m;
    (mounting.ahead_m, mounting.left_m, mounting.separation_m) = (0.0, 0.0, 0.0);
    world
}

/// World with an empty scene that has the material of the walls.
pub(crate) fn empty_scene_of(world: &World, reflectance: f64) -> World {
    let mut world = world.clone();
    let mut scene = Scene::clone(&world.scene);
    scene.walls.clear();
    scene.cylinders.clear();
    scene.robot = None;
    scene.materials = [(MATERIAL.to_owned(), Material::smooth(reflectance))].into();
    world.scene = Arc::new(scene);
    world
}

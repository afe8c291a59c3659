//! World of a survey before its walls are known.

use std::sync::Arc;

use sonard_inverse::World;
use sonard_model::{
    acoustics::{Air, Sensor},
    model::Options,
    scene::Scene,
};

use crate::error::SurveyError;

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
    let scene = Arc::new(Scene::builder("unknown room").material("wall", 1.0).build()?);
    let measured_m = options.max_range_m.unwrap_or(sensor.max_range_m);
    let max_range_m = Some(max_range_m.min(measured_m));
    Ok(World::new(scene, sensor, air, Options { max_range_m, ..options }))
}

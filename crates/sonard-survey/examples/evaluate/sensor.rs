//! Ranger and air that differ from those assumed.

use std::{collections::BTreeMap, sync::Arc};

use sonard_inverse::{World, WorldError};
use sonard_model::{acoustics::Air, scene::Scene};
use sonard_survey::{FittedNumber, Survey};

/// Reflectance that a survey assumes.
const ASSUMED_REFLECTANCE: f64 = 0.97;

/// Ranger and air of the simulated sweeps, as differences from those assumed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TrueSensor {
    pub(crate) threshold_db: f64,
    /// Amplitude reflection coefficient of all surfaces.
    pub(crate) reflectance: f64,
    pub(crate) temperature_c: f64,
    pub(crate) ahead_m: f64,
    pub(crate) left_m: f64,
}

impl Default for TrueSensor {
    fn default() -> Self {
        let temperature_c = Air::default().temperature_c();
        let reflectance = ASSUMED_REFLECTANCE;
        Self { threshold_db: 0.0, reflectance, temperature_c, ahead_m: 0.0, left_m: 0.0 }
    }
}

/// Error of a fitted number.
#[derive(Debug, Clone)]
pub(crate) struct Deviation {
    name: String,
    error: f64,
    sigma: f64,
    is_within: bool,
    is_determined: bool,
}

impl TrueSensor {
    /// World with the ranger and the air of the simulation.
    pub(crate) fn applied(&self, assumed: &World) -> Result<World, WorldError> {
        let mut world = assumed.clone();
        world.sensor.threshold *= 10f64.powf(self.threshold_db / 20.0);
        world.sensor.mounting.ahead_m += self.ahead_m;
        world.sensor.mounting.left_m += self.left_m;
        let [humidity, pressure_kpa] = [world.air.humidity_percent(), world.air.pressure_kpa()];
        world.air = Air::new(self.temperature_c, humidity, pressure_kpa)?;
        let mut scene = Scene::clone(&world.scene);
        for wall in &mut scene.walls {
            wall.material.reflectance = self.reflectance;
        }
        for post in &mut scene.cylinders {
            post.material.reflectance = self.reflectance;
        }
        world.scene = Arc::new(scene);
        Ok(world)
    }

    /// Errors of the numbers that a survey fitted.
    pub(crate) fn deviations(&self, found: &Survey) -> Vec<Deviation> {
        let numbers = found.fitted.iter().flat_map(|fitted| &fitted.numbers);
        numbers.filter_map(|of| self.deviation(of)).collect()
    }

    fn deviation(&self, of: &FittedNumber) -> Option<Deviation> {
        let truth = match of.name.as_str() {
            "threshold_db" => of.assumed + self.threshold_db,
            "ahead_m" => of.assumed + self.ahead_m,
            "left_m" => of.assumed + self.left_m,
            "sound_speed" => Air::new(self.temperature_c, 50.0, 101.325).ok()?.sound_speed_m_s(),
            name if name.starts_with("reflectance") => self.reflectance,
            _ => return None,
        };
        let [low, high] = of.interval;
        Some(Deviation {
            name: of.name.clone(),
            error: of.value - truth,
            sigma: of.sigma,
            is_within: (low..=high).contains(&truth),
            is_determined: of.is_determined,
        })
    }
}

/// Prints the errors of fitted numbers by name.
pub(crate) fn print_deviations<'a>(all: impl Iterator<Item = &'a Deviation>) {
    let mut by_name: BTreeMap<&str, Vec<&Deviation>> = BTreeMap::new();
    for of in all {
        by_name.entry(&of.name).or_default().push(of);
    }
    for (name, all) in by_name {
        let count = all.len() as f64;
        let rms = (all.iter().map(|of| of.error * of.error).sum::<f64>() / count).sqrt();
        let sigma = all.iter().map(|of| of.sigma).sum::<f64>() / count;
        let within = all.iter().filter(|of| of.is_within).count();
        let determined = all.iter().filter(|of| of.is_determined).count();
        println!(
            "# {name}: rms error {rms:.5}, mean standard deviation {sigma:.5}, {within} of {} in their 95 % intervals, \
             {determined} determined",
            all.len()
        );
    }
}

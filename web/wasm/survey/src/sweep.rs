//! Sweeps of a noisy ranger on a course with noisy odometry.

use std::sync::Arc;

use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use sonard_inverse::{FiringOutcome, FitSweep, SweepFiring, World};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::Options,
    reading::PingStatus,
    scene::Scene,
};
use sonard_survey::{
    OdometrySigma,
    trial::{ReadingNoise, drift, simulate_sweeps},
};
use sonard_wasm_module::RequestError;
use uuid::Uuid;

/// Sensor preset of the robot.
const SENSOR: &str = "senscomp-6500";
/// Maximum range, metres.
pub(crate) const MAX_RANGE_M: f64 = 4.0;
/// Number of beams of a sweep.
const BEAMS: usize = 200;
const NOISE: ReadingNoise = ReadingNoise { sigma_db: 0.5, sigma_m: 0.001 };
/// Maximum number of stops of a course.
pub(crate) const MAX_STOPS: usize = 40;
/// Maximum number of readings of a sweep.
const MAX_READINGS: usize = 4000;

/// Sweep with its pose by odometry.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Pose by odometry.
    pub(crate) pose: Pose,
    /// Readings in order of azimuth.
    pub(crate) readings: Vec<Reading>,
}

/// Reading of a sweep.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Reading {
    /// Azimuth, degrees counter-clockwise from the heading.
    azimuth_deg: f64,
    status: PingStatus,
    /// Range of an echo, or the minimum range, metres.
    range_m: Option<f64>,
}

pub(crate) fn sensor() -> Result<Sensor, RequestError> {
    Ok(Sensor::preset(SENSOR)?)
}

/// World of a scene with the robot's ranger.
pub(crate) fn world_of(scene: Scene) -> Result<World, RequestError> {
    let options = Options { max_range_m: Some(MAX_RANGE_M), ..Options::default() };
    Ok(World::new(Arc::new(scene), sensor()?, Air::default(), options))
}

/// Random numbers of an event of a course.
fn generator(seed: u64, stream: u64, number: u64) -> Pcg64 {
    Pcg64::seed_from_u64((seed << 20) ^ (stream << 16) ^ number)
}

/// Move of a robot, in the frame of the pose before, whose odometry reports `by`.
pub(crate) fn drive(by: Pose, seed: u64, number: u64) -> Pose {
    const ORIGIN: Pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
    let OdometrySigma { m_per_m, deg_per_m, .. } = OdometrySigma::default();
    let mut random = generator(seed, 1, number);
    drift(&[ORIGIN, by], [m_per_m, deg_per_m], &mut random).last().copied().unwrap_or(by)
}

/// Measures a sweep; returns its readings.
pub(crate) fn take_sweep(
    scene: Scene,
    pose: &Pose,
    seed: u64,
    number: u64,
) -> Result<Vec<Reading>, RequestError> {
    scene.check_pose(pose)?;
    let world = world_of(scene)?;
    let mut random = generator(seed, 2, number);
    let sweeps = simulate_sweeps(&world, std::slice::from_ref(pose), BEAMS, NOISE, &mut random);
    let sweeps = sweeps.map_err(|error| RequestError::new(&error, ""))?;
    let sound_speed_m_s = world.air.sound_speed_m_s();
    let min_range_m = 0.5e-6 * world.sensor.blanking_us * sound_speed_m_s;
    let reading = |firing: &SweepFiring| {
        let (status, range_m) = match firing.outcome {
            FiringOutcome::BelowMinRange => (PingStatus::MinRange, Some(min_range_m)),
            _ => match firing.range_m(sound_speed_m_s) {
                Some(range_m) => (PingStatus::Echo, Some(range_m)),
                None => (PingStatus::NoEcho, None),
            },
        };
        Reading { azimuth_deg: firing.azimuth_deg, status, range_m }
    };
    Ok(sweeps.iter().flat_map(|sweep| &sweep.beams).map(reading).collect())
}

impl Sweep {
    /// Sweep of a survey; `number` counts from 1.
    pub(crate) fn to_fit(&self, number: usize) -> Result<FitSweep, RequestError> {
        let Pose { x_m, y_m, heading_deg } = self.pose;
        let is_finite = [x_m, y_m, heading_deg].iter().all(|value| value.is_finite());
        if !is_finite || self.readings.len() > MAX_READINGS {
            let help = format!("a pose is finite, and a sweep has at most {MAX_READINGS} readings");
            return Err(RequestError::new(&format!("sweep {number} is invalid"), help));
        }
        let us_per_m = 2e6 / Air::default().sound_speed_m_s();
        let firing = |reading: &Reading| {
            let outcome = match (reading.status, reading.range_m) {
                (PingStatus::Echo, Some(range_m)) => {
                    FiringOutcome::Echo { tof_us: range_m * us_per_m }
                }
                (PingStatus::MinRange, _) => FiringOutcome::BelowMinRange,
                _ => FiringOutcome::NoEcho,
            };
            SweepFiring { azimuth_deg: reading.azimuth_deg, outcome }
        };
        let beams = self.readings.iter().map(firing).collect();
        Ok(FitSweep { scan: Uuid::from_u128(number as u128), pose: self.pose, beams })
    }
}

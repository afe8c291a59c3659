//! Simulated sweeps with the noise of a real receiver.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StudentT};
use sonard_inverse::{
    ArrayFiring, ArrayRound, FiringOutcome, FitSweep, SweepFiring, World, WorldError,
};
use sonard_model::{
    acoustics::{Air, Sensor, SensorError},
    array::RangerArray,
    geometry::{DVec2, Pose},
    model::{Options, Simulator},
    reading::PingStatus,
    scene::Scene,
};
use uuid::Uuid;

use super::rooms::normal;

/// Noise of readings.
#[derive(Debug, Clone, Copy)]
pub struct ReadingNoise {
    /// Standard deviation of the threshold from firing to firing, decibels.
    pub sigma_db: f64,
    /// Standard deviation of ranges, metres; one in fifty has a far tail.
    pub sigma_m: f64,
}

/// Maximum range of a trial's ranger, metres.
const MAX_RANGE_M: f64 = 4.0;

/// World of a trial: a scene with a SensComp 6500 that measures up to 4 m in usual air.
///
/// # Errors
/// None with the shipped sensor.
pub fn trial_world(scene: Scene) -> Result<World, SensorError> {
    let options = Options { max_range_m: Some(MAX_RANGE_M), ..Options::default() };
    Ok(World::new(scene.into(), Sensor::preset("senscomp-6500")?, Air::default(), options))
}

/// Thresholds at which sweeps are predicted, in standard deviations.
const STEPS: [f64; 5] = [-1.8, -0.9, 0.0, 0.9, 1.8];

/// Simulates sweeps of `beams` beams from each pose.
///
/// # Errors
/// Invalid sensor, or more paths than can be found.
pub fn simulate_sweeps(
    world: &World,
    poses: &[Pose],
    beams: usize,
    noise: ReadingNoise,
    random: &mut impl Rng,
) -> Result<Vec<FitSweep>, WorldError> {
    let simulators: Result<Vec<Simulator>, _> = STEPS
        .iter()
        .map(|step| {
            let mut world = world.clone();
            world.sensor.threshold *= 10_f64.powf(step * noise.sigma_db / 20.0);
            world.simulator(&Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 })
        })
        .collect();
    let simulators = simulators?;
    let weights = STEPS.map(|step| (-0.5 * step * step).exp());
    let mut found = Vec::with_capacity(poses.len());
    for (pose, number) in poses.iter().zip(1u128..) {
        let points: Vec<_> = simulators.iter().map(|of| of.at(pose.position())).collect();
        let mut fired = Vec::with_capacity(beams);
        for at in 0..beams {
            let azimuth_deg = at as f64 * 360.0 / beams as f64;
            let point = &points[pick(&weights, random)];
            let reading = point.ping(pose.direction_rad(azimuth_deg))?;
            let outcome = match (reading.status, reading.range_m) {
                (PingStatus::Echo, Some(range_m)) => {
                    let range_m = range_m + range_error_m(noise.sigma_m, random);
                    FiringOutcome::Echo { tof_us: 2e6 * range_m / world.air.sound_speed_m_s() }
                }
                (PingStatus::MinRange, _) => FiringOutcome::BelowMinRange,
                _ => FiringOutcome::NoEcho,
            };
            fired.push(SweepFiring { azimuth_deg, outcome });
        }
        found.push(FitSweep { scan: Uuid::from_u128(number), pose: *pose, beams: fired });
    }
    Ok(found)
}

/// Simulates a round of an array from each pose, at which the robot rests; its body is left out.
///
/// # Errors
/// Invalid sensor, or more paths than can be found.
pub fn simulate_rounds(
    world: &World,
    array: &RangerArray,
    poses: &[Pose],
    noise: ReadingNoise,
    random: &mut impl Rng,
) -> Result<Vec<ArrayRound>, WorldError> {
    let mut rounds = Vec::with_capacity(poses.len());
    for (pose, number) in poses.iter().zip(1u128..) {
        let mut firings = Vec::with_capacity(array.rangers.len());
        for ranger in &array.rangers {
            let own = [ranger.world_pose(pose)];
            let swept = simulate_sweeps(world, &own, 1, noise, random)?;
            let beams = swept.iter().flat_map(|sweep| &sweep.beams);
            firings.extend(beams.map(|beam| ArrayFiring {
                position: DVec2::new(ranger.x_m, ranger.y_m),
                azimuth_deg: ranger.azimuth_deg(),
                outcome: beam.outcome,
            }));
        }
        rounds.push(ArrayRound { scan: Uuid::from_u128(number), pose: *pose, firings });
    }
    Ok(rounds)
}

fn pick(weights: &[f64], random: &mut impl Rng) -> usize {
    let mut rest = random.random::<f64>() * weights.iter().sum::<f64>();
    let taken = weights.iter().position(|weight| {
        rest -= weight;
        rest < 0.0
    });
    taken.unwrap_or(0)
}

fn range_error_m(sigma_m: f64, random: &mut impl Rng) -> f64 {
    const FAR_SHARE: f64 = 0.02;
    const FAR_M: f64 = 0.005;
    if random.random::<f64>() < FAR_SHARE {
        StudentT::new(2.0).map_or(0.0, |tail| FAR_M * tail.sample(random))
    } else {
        sigma_m * normal(random)
    }
}

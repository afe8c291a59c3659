//! Evaluation of mapping methods with simulated readings.
//!
//! A robot drives at random through a scene. At each position it takes a set of readings with an
//! array of rangers or a stepper. The readings are mapped without and with Feature Prediction, and
//! both maps are scored against the ideal map.

mod rooms;
#[cfg(test)]
mod tests;

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

pub use rooms::{gallery, random_room};

use sonard_interpret::interpret::{
    BeamOutcome, Extents, Sweep, SweepBeam,
    grid::{
        BeamModel, GaussianBeam, Grid, GridShape, MapScore, PathSettings, ScoreError, Trust, ideal,
        score,
    },
    prediction::{FeaturePrediction, PredictionSettings},
};
use sonard_model::{
    array::RangerArray,
    geometry::{DVec2, Pose},
    model::{Prediction, Simulator, TooCostly},
    scene::Scene,
};
use sonard_records::PingStatus;

/// Arrangement of the readings of a set.
#[derive(Debug, Clone, PartialEq)]
pub enum Arrangement {
    /// Single round of an array's rangers.
    Ring(Box<RangerArray>),
    /// A full turn in steps of 0.9 degrees.
    Stepper,
}

/// Settings of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialSettings {
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Number of sets of readings.
    pub places: usize,
    /// Distance between successive positions, metres.
    pub stride_m: f64,
    /// Minimum distance of the robot from walls, metres.
    pub clearance_m: f64,
    /// Arrangement of the readings in a set.
    pub arrangement: Arrangement,
    /// Standard deviation of a range, metres.
    pub range_sigma_m: f64,
    /// Exponent of Feature Prediction's confidence with distance.
    pub exponent: f64,
    /// Extension of predicted walls in Feature Prediction, metres.
    pub extend_m: f64,
    /// Use of the confidences of Feature Prediction.
    pub trust: Trust,
}

/// Readings of a robot along a course through a scene.
#[derive(Debug, Clone)]
pub struct SimulatedCourse {
    /// Ideal map of the scene.
    pub ideal: Grid,
    /// Sets of readings in order of time.
    pub sweeps: Vec<Sweep>,
}

/// Maps of one course without and with Feature Prediction.
#[derive(Debug, Clone)]
pub struct MappingTrial {
    /// Maps without and with Feature Prediction.
    pub maps: [Grid; 2],
    /// Scores of both maps.
    pub scores: [MapScore; 2],
}

impl SimulatedCourse {
    /// Simulates a robot that drives through a scene from a start position; `None` if it can't move
    /// there.
    ///
    /// # Errors
    /// [`TooCostly`] for more paths than the model can find.
    pub fn through(
        simulator: &Simulator,
        start: DVec2,
        settings: &TrialSettings,
        rng: &mut impl Rng,
    ) -> Result<Option<Self>, TooCostly> {
        let Some((ideal, poses)) = plan_course(simulator.scene(), start, settings, rng) else {
            return Ok(None);
        };
        let sweeps = poses.iter().map(|pose| read(simulator, pose, settings, rng));
        Ok(Some(Self { sweeps: sweeps.collect::<Result<_, _>>()?, ideal }))
    }

    /// Maps the course with both methods and scores the maps.
    ///
    /// # Errors
    /// [`ScoreError`] if the shape of `ideal` was changed after construction.
    pub fn map(
        &self,
        extents: &Extents,
        max_range_m: f64,
        settings: &TrialSettings,
    ) -> Result<MappingTrial, ScoreError> {
        let extent_deg = extents.plane_corner_deg(1.0, 1.0);
        let (prediction, beam_deg) = match settings.arrangement {
            Arrangement::Ring(_) => (PredictionSettings::ring(max_range_m), 25.0),
            Arrangement::Stepper => {
                (PredictionSettings::stepper(extent_deg, max_range_m), extent_deg)
            }
        };
        let prediction = PredictionSettings {
            exponent: settings.exponent,
            extend_m: settings.extend_m,
            ..prediction
        };
        let model = BeamModel::Gaussian(GaussianBeam::new(beam_deg, max_range_m));
        let mut maps = [Grid::new(*self.ideal.shape()), Grid::new(*self.ideal.shape())];
        let mut predictor = FeaturePrediction::new(prediction);
        for sweep in &self.sweeps {
            let assessments = predictor.assess(sweep);
            maps[0].add(sweep, None, &model, &settings.trust);
            maps[1].add(sweep, Some(&assessments), &model, &settings.trust);
        }
        let paths = PathSettings::default();
        let scores = [score(&maps[0], &self.ideal, &paths)?, score(&maps[1], &self.ideal, &paths)?];
        Ok(MappingTrial { maps, scores })
    }
}

/// Ideal map of a scene, and poses of a course through it.
fn plan_course(
    scene: &Scene,
    start: DVec2,
    settings: &TrialSettings,
    rng: &mut impl Rng,
) -> Option<(Grid, Vec<Pose>)> {
    let margin = DVec2::splat(0.5);
    let ends = || scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let (low, high) = (ends().reduce(DVec2::min)? - margin, ends().reduce(DVec2::max)? + margin);
    let shape = GridShape::covering(low, high, settings.resolution_m).ok()?;
    let ideal = ideal(scene, shape, &[start]);
    let poses = wander(scene, &ideal, start, settings, rng)?;
    Some((ideal, poses))
}

/// Random course through free space with a minimum clearance, turning at obstacles.
fn wander(
    scene: &Scene,
    ideal: &Grid,
    start: DVec2,
    settings: &TrialSettings,
    rng: &mut impl Rng,
) -> Option<Vec<Pose>> {
    let is_free = |at: DVec2| {
        let reached = ideal.shape().index_at(at).is_some_and(|cell| ideal.probability(cell) < 0.5);
        reached && scene.clearance_m(at) >= settings.clearance_m
    };
    // The start may lack the clearance: the nearest position with clearance replaces it.
    let mut at = (0..400)
        .map(|i| start + 0.01 * f64::from(i) * DVec2::from_angle(2.4 * f64::from(i)))
        .find(|place| is_free(*place))?;
    let mut heading = rng.random_range(0.0..std::f64::consts::TAU);
    let mut poses = Vec::with_capacity(settings.places);
    while poses.len() < settings.places {
        poses.push(Pose { x_m: at.x, y_m: at.y, heading_deg: heading.to_degrees() });
        let next = (0..60).find_map(|tries| {
            let turn = (0.3 + 0.05 * f64::from(tries)) * rng.random_range(-1.0..1.0);
            let stride_m = settings.stride_m * if tries < 40 { 1.0 } else { 0.3 };
            let place = at + stride_m * DVec2::from_angle(heading + turn);
            let half_way = (at + place) / 2.0;
            (is_free(place) && is_free(half_way)).then_some((place, heading + turn))
        });
        match next {
            Some((place, turned)) => (at, heading) = (place, turned),
            None => heading += rng.random_range(1.0..5.0),
        }
    }
    Some(poses)
}

/// Simulates a set of readings at a pose.
fn read(
    simulator: &Simulator,
    pose: &Pose,
    settings: &TrialSettings,
    rng: &mut impl Rng,
) -> Result<Sweep, TooCostly> {
    let mut reading =
        |prediction: &Prediction| simulate_reading(prediction, settings.range_sigma_m, rng);
    let (mut beams, step_deg): (Vec<SweepBeam>, f64) = match &settings.arrangement {
        Arrangement::Ring(array) => {
            let beam = |(index, at): (u32, usize)| {
                let ranger = &array.rangers[at];
                let (azimuth_deg, mount) =
                    (ranger.azimuth_deg(), DVec2::new(ranger.x_m, ranger.y_m));
                let mounted = ranger.world_pose(pose);
                let point = simulator.at(mounted.position());
                let outcome = reading(&point.ping(mounted.direction_rad(0.0))?);
                Ok(SweepBeam { azimuth_deg, index, outcome, mount })
            };
            let beams = (0..).zip(array.round()).map(beam);
            (beams.collect::<Result<_, TooCostly>>()?, RING_STEP_DEG)
        }
        Arrangement::Stepper => {
            let point = simulator.at(pose.position());
            let beam = |index: u32| {
                let azimuth_deg = 0.9 * f64::from(index);
                let outcome = reading(&point.ping(pose.direction_rad(azimuth_deg))?);
                Ok(SweepBeam { azimuth_deg, index, outcome, mount: DVec2::ZERO })
            };
            ((0..400).map(beam).collect::<Result<_, TooCostly>>()?, 0.9)
        }
    };
    beams.sort_by(|a, b| a.azimuth_deg.total_cmp(&b.azimuth_deg));
    let closed = settings.arrangement == Arrangement::Stepper;
    Ok(Sweep { pose: *pose, step_deg, beams, closed })
}

/// Angular step of a ring, degrees: larger than a beam, so that each ranger forms its own region.
const RING_STEP_DEG: f64 = 25.0;

/// Reading of a prediction with range noise.
pub(crate) fn simulate_reading(
    prediction: &Prediction,
    sigma_m: f64,
    rng: &mut impl Rng,
) -> BeamOutcome {
    match (prediction.status, prediction.range_m) {
        (PingStatus::Echo, Some(range_m)) => {
            let unit: f64 = StandardNormal.sample(rng);
            BeamOutcome::Echo((range_m + sigma_m * unit).max(0.01))
        }
        (PingStatus::MinRange, _) => BeamOutcome::BelowMinRange,
        _ => BeamOutcome::NoEcho,
    }
}

//! Diagnosis of a sweep that the scene does not explain.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::{geometry::Pose, reading::PingStatus};

use crate::{
    coarse_grid::{CoarseGrid, MARGIN_M, extent},
    locate::PoseMode,
    sweep::{FiringOutcome, FitSweep, SweepFiring},
    world::{SimulatorSet, World},
};

/// Likely cause of a poor fit of a sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Misfit {
    /// Scene that explains few of the readings whatever is changed: another place, or another time.
    OtherPlace {
        /// Fraction of the readings that are explained.
        explained: f64,
    },
    /// Azimuths recorded clockwise instead of counter-clockwise.
    Clockwise,
    /// Azimuths recorded in radians instead of degrees.
    Radians,
    /// Ranges in another unit.
    Unit {
        /// Factor that converts the ranges.
        factor: f64,
    },
    /// Ranges that the sensor cannot measure: those of another sensor, or in another unit.
    SensorLimits {
        /// Fraction of the readings outside the limits.
        share: f64,
        /// Minimum range of the sensor, metres.
        min_range_m: f64,
        /// Maximum range of the sensor, metres.
        max_range_m: f64,
    },
    /// Ranges longer than the scene is wide: those of a larger place, or in another unit.
    BeyondScene {
        /// Fraction of the readings beyond that length.
        share: f64,
        /// Diagonal of the scene's bounding box, metres.
        diagonal_m: f64,
    },
    /// Beams in which only one of reading and prediction from the best pose is an echo: another
    /// sensitivity, or objects that the scene lacks.
    Sensitivity {
        /// Fraction of the readings without the predicted echo.
        missed: f64,
        /// Fraction of the readings with an echo where none is predicted.
        unexpected: f64,
    },
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| 100.0 * share;
        match *self {
            Self::OtherPlace { explained } => write!(
                f,
                "no pose in this scene explains more than {:.0} % of the readings",
                percent(explained)
            ),
            Self::Clockwise => f.write_str(
                "the readings fit far better with reversed azimuths: they may be clockwise",
            ),
            Self::Radians => f.write_str(
                "the readings fit far better with azimuths in radians: they may not be in degrees",
            ),
            Self::Unit { factor } => write!(
                f,
                "the readings fit far better with ranges multiplied by {factor}: they may be in another unit"
            ),
            Self::SensorLimits { share, min_range_m, max_range_m } => write!(
                f,
                "the sensor measures {min_range_m:.2} to {max_range_m:.2} m, but {:.0} % of the readings are outside: \
                 it may be another sensor",
                percent(share)
            ),
            Self::BeyondScene { share, diagonal_m } => write!(
                f,
                "the scene is {diagonal_m:.2} m across, but {:.0} % of the ranges are longer: it may be a larger place",
                percent(share)
            ),
            Self::Sensitivity { missed, unexpected } => write!(
                f,
                "compared with the best pose, {:.0} % of the readings lack an echo and {:.0} % have one too many: the \
                 sensor's threshold may be wrong",
                percent(missed),
                percent(unexpected)
            ),
        }
    }
}

impl Misfit {
    /// Advice on what to check or to change, one sentence without a full stop.
    #[must_use]
    pub const fn advice(&self) -> &'static str {
        match self {
            Self::OtherPlace { .. } => {
                "check the scene (the right room, doors, furniture), the sensor, the sense of the azimuths, the unit \
                 of the ranges, and that the robot was at most a metre outside the walls"
            }
            Self::Clockwise => "import the readings with --clockwise",
            Self::Radians => "import the azimuths in their unit: --columns azimuth_rad=NAME",
            Self::Unit { .. } => {
                "import the ranges in their unit, as with --columns range_cm=NAME; a range is half the path"
            }
            Self::SensorLimits { .. } => "select the sensor that took the readings",
            Self::BeyondScene { .. } => {
                "select the scene of that place, or check the unit of the ranges"
            }
            Self::Sensitivity { .. } => {
                "select the sensor that took the readings, or fit its threshold: sonard locate --fit threshold"
            }
        }
    }
}

/// Fraction of explained readings below which a sweep is diagnosed.
const MIN_EXPLAINED: f64 = 0.7;
/// Maximum cost of the coarse match after a correction, relative to that before.
const FAR_BETTER: f32 = 0.6;
/// Factors of unit errors: centimetres, millimetres, inches, feet, and two-way ranges.
const FACTORS: [f64; 8] = [0.01, 100.0, 0.001, 1000.0, 0.0254, 0.3048, 0.5, 2.0];
/// Minimum number of echoes that distinguish a correction from chance.
const MIN_ECHOES: usize = 20;
/// Minimum fraction of readings outside the sensor's limits; fewer are errors of single readings.
const MIN_OUTSIDE: f64 = 0.05;
/// Tolerance of these limits, metres: more than the resolution of common modules.
const LIMIT_TOLERANCE_M: f64 = 0.02;
/// Minimum fraction of ranges beyond the scene. Multiple reflections make some.
const MIN_BEYOND: f64 = 0.3;
/// Minimum fraction of readings of which only one of measurement and prediction is an echo.
const MIN_DIFFERENT: f64 = 0.2;

/// Diagnoses a sweep whose best pose explains little of it; empty for others. A correction that
/// fits far better is the only cause; otherwise the first is [`Misfit::OtherPlace`].
#[must_use]
pub fn diagnose(
    world: &World,
    atlas: &CoarseGrid,
    sweep: &FitSweep,
    modes: &[PoseMode],
) -> Vec<Misfit> {
    let explained = modes.iter().map(|mode| mode.explained).fold(0.0, f64::max);
    if explained >= MIN_EXPLAINED {
        return Vec::new();
    }
    if let Some(correction) = best_correction(world, atlas, sweep) {
        return vec![correction];
    }
    let best = modes.first().map(PoseMode::pose);
    let evidence = [
        outside_sensor_limits(world, sweep),
        beyond_scene(world, sweep),
        best.and_then(|pose| differing_echoes(world, sweep, &pose)),
    ];
    [Some(Misfit::OtherPlace { explained })].into_iter().chain(evidence).flatten().collect()
}

/// Correction of azimuths or ranges that fits far better than the readings as they are.
fn best_correction(world: &World, atlas: &CoarseGrid, sweep: &FitSweep) -> Option<Misfit> {
    if sweep.beams.iter().filter(|beam| beam.is_echo()).count() < MIN_ECHOES {
        return None;
    }
    let cost = |sweep: &FitSweep| {
        let best = atlas.matches(world, sweep, 1);
        best.first().map_or(f32::INFINITY, |best| best.cost)
    };
    let now = cost(sweep);
    let changed = |change: &dyn Fn(SweepFiring) -> SweepFiring| FitSweep {
        beams: sweep.beams.iter().copied().map(change).collect(),
        ..sweep.clone()
    };
    let turned = |factor: f64| {
        cost(&changed(&|beam| SweepFiring { azimuth_deg: factor * beam.azimuth_deg, ..beam }))
    };
    let scaled = |factor: f64| {
        cost(&changed(&|beam| match beam.outcome {
            FiringOutcome::Echo { tof_us } => {
                SweepFiring { outcome: FiringOutcome::Echo { tof_us: factor * tof_us }, ..beam }
            }
            FiringOutcome::NoEcho | FiringOutcome::BelowMinRange => beam,
        }))
    };
    let tried = [(Misfit::Clockwise, turned(-1.0)), (Misfit::Radians, turned(1f64.to_degrees()))];
    let units = FACTORS.map(|factor| (Misfit::Unit { factor }, scaled(factor)));
    let best = tried.into_iter().chain(units).min_by(|a, b| a.1.total_cmp(&b.1));
    best.filter(|(_, cost)| *cost < FAR_BETTER * now).map(|(cause, _)| cause)
}

/// Fraction of a sweep's readings that satisfy a condition.
fn share(sweep: &FitSweep, condition: impl Fn(&SweepFiring) -> bool) -> f64 {
    let count = sweep.beams.iter().filter(|beam| condition(beam)).count();
    count as f64 / sweep.beams.len().max(1) as f64
}

fn outside_sensor_limits(world: &World, sweep: &FitSweep) -> Option<Misfit> {
    let simulator = world.simulator(&sweep.pose).ok()?;
    let min_range_m = simulator.receiver().min_range_m();
    let max_range_m = world.sensor.max_range_m;
    let measurable = min_range_m - LIMIT_TOLERANCE_M..=max_range_m + LIMIT_TOLERANCE_M;
    let speed_m_s = world.air.sound_speed_m_s();
    let share =
        share(sweep, |beam| beam.range_m(speed_m_s).is_some_and(|m| !measurable.contains(&m)));
    (share > MIN_OUTSIDE).then_some(Misfit::SensorLimits { share, min_range_m, max_range_m })
}

fn beyond_scene(world: &World, sweep: &FitSweep) -> Option<Misfit> {
    let (low, high) = extent(&world.scene)?;
    let diagonal_m = (low + MARGIN_M).distance(high - MARGIN_M);
    let speed_m_s = world.air.sound_speed_m_s();
    let share = share(sweep, |beam| beam.range_m(speed_m_s).is_some_and(|m| m > diagonal_m));
    (share > MIN_BEYOND).then_some(Misfit::BeyondScene { share, diagonal_m })
}

/// Compares the readings with the predictions from a pose, echo or none.
fn differing_echoes(world: &World, sweep: &FitSweep, pose: &Pose) -> Option<Misfit> {
    let models = SimulatorSet::new(&world.with_face_on_axis()).ok()?;
    let predicted = models.at(pose, |_, point| {
        let direction_rad = |beam: &SweepFiring| world.direction_rad(pose, beam.azimuth_deg);
        let predictions = sweep.beams.iter().map(|beam| point.ping(direction_rad(beam)));
        Ok(predictions.collect::<Result<Vec<_>, _>>()?)
    });
    let predicted = predicted.ok()?;
    let fraction = |measured: bool| {
        let pairs = sweep.beams.iter().zip(&predicted);
        let differ = pairs.filter(|(beam, prediction)| match beam.outcome {
            FiringOutcome::Echo { .. } => measured && prediction.status == PingStatus::NoEcho,
            FiringOutcome::NoEcho => !measured && prediction.status == PingStatus::Echo,
            FiringOutcome::BelowMinRange => false,
        });
        differ.count() as f64 / sweep.beams.len().max(1) as f64
    };
    let (missed, unexpected) = (fraction(false), fraction(true));
    (missed + unexpected > MIN_DIFFERENT).then_some(Misfit::Sensitivity { missed, unexpected })
}

//! Standard range-based localization methods for comparison.

use rand::RngExt as _;
use rand_pcg::Pcg64;
use sonard_inverse::{FiringOutcome, FitSweep, World};
use sonard_model::{
    geometry::{DVec2, Pose, wrap_180},
    model::Simulator,
};

use crate::rooms::readings;

/// Directions per position, 3 degrees apart.
const DIRECTIONS: usize = 120;
const STEP_DEG: f64 = 360.0 / DIRECTIONS as f64;
const SPACING_M: f64 = 0.1;
/// Number of grid poses that are refined.
const REFINED: usize = 4;
/// Initial steps of the pattern search, metres and degrees, and number of halvings.
const SEARCH: (f64, f64, u32) = (0.05, 1.5, 5);

/// Ranges by direction, metres; `None` without a return.
type Ranges = Vec<Option<f64>>;
/// Log-likelihood of a reading for an expected range.
pub(crate) type Likelihood<'a> = &'a dyn Fn(Option<f64>, Option<f64>) -> f64;

/// Ranges to the nearest hit on a grid of positions.
pub(crate) struct Grid {
    simulator: Simulator,
    sound_speed_m_s: f64,
    reach_m: f64,
    pub(crate) places: Vec<(DVec2, Ranges)>,
}

impl Grid {
    /// Grid of nearest hits in a world.
    pub(crate) fn new(world: &World, reach_m: f64) -> Self {
        let origin = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        let simulator = world.simulator(&origin).expect("a world");
        let sound_speed_m_s = simulator.sound_speed_m_s();
        let mut grid = Self { simulator, sound_speed_m_s, reach_m, places: Vec::new() };
        grid.places = free_positions(world).map(|at| (at, grid.expected(at))).collect();
        grid
    }

    fn expected(&self, at: DVec2) -> Ranges {
        let point = self.simulator.at(at);
        let range_m = |direction: usize| {
            let read = point.ping((direction as f64 * STEP_DEG).to_radians()).ok()?;
            read.range_m.filter(|range_m| *range_m < self.reach_m)
        };
        (0..DIRECTIONS).map(range_m).collect()
    }

    /// Azimuths and ranges of a sweep.
    pub(crate) fn readings(&self, sweep: &FitSweep) -> Vec<(f64, Option<f64>)> {
        let reading = |beam: &sonard_inverse::SweepFiring| {
            (beam.azimuth_deg, beam.outcome.range_m(self.sound_speed_m_s))
        };
        sweep
            .beams
            .iter()
            .filter(|beam| beam.outcome != FiringOutcome::BelowMinRange)
            .map(reading)
            .collect()
    }

    /// Most likely pose after refinement of the four best grid poses.
    pub(crate) fn locate(
        &self,
        measured: &[(f64, Option<f64>)],
        likelihood: Likelihood<'_>,
    ) -> Option<Pose> {
        let mut best: Vec<(f64, Pose)> = Vec::new();
        for (at, expected) in &self.places {
            let by_turn = |turn: usize| {
                let pose = Pose { x_m: at.x, y_m: at.y, heading_deg: turn as f64 * STEP_DEG };
                (value(expected, measured, pose.heading_deg, likelihood), pose)
            };
            best.extend((0..DIRECTIONS).map(by_turn).max_by(|a, b| a.0.total_cmp(&b.0)));
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0));
        let refined =
            best.into_iter().take(REFINED).map(|from| self.refined(from, measured, likelihood));
        refined.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, pose)| pose)
    }

    /// Pattern search: moves to a more likely neighbour, or halves the steps.
    fn refined(
        &self,
        (mut likely, mut pose): (f64, Pose),
        measured: &[(f64, Option<f64>)],
        likelihood: Likelihood<'_>,
    ) -> (f64, Pose) {
        let (mut step_m, mut step_deg, halvings) = SEARCH;
        for _ in 0..halvings {
            loop {
                let steps = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)];
                let both = steps.iter().flat_map(|&(x, y, h)| [(x, y, h), (-x, -y, -h)]);
                let near = both.map(|(x, y, h)| Pose {
                    x_m: pose.x_m + x * step_m,
                    y_m: pose.y_m + y * step_m,
                    heading_deg: wrap_180(pose.heading_deg + h * step_deg),
                });
                let tried = near.map(|near| {
                    let expected = self.expected(near.position());
                    (value(&expected, measured, near.heading_deg, likelihood), near)
                });
                match tried.max_by(|a, b| a.0.total_cmp(&b.0)) {
                    Some(better) if better.0 > likely => (likely, pose) = better,
                    _ => break,
                }
            }
            (step_m, step_deg) = (0.5 * step_m, 0.5 * step_deg);
        }
        (likely, pose)
    }
}

/// Free positions with clearance for a ranger.
fn free_positions(world: &World) -> impl Iterator<Item = DVec2> + '_ {
    let ends = || world.scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let low = ends().fold(DVec2::INFINITY, DVec2::min);
    let high = ends().fold(DVec2::NEG_INFINITY, DVec2::max);
    let [columns, rows] =
        ((high - low).max(DVec2::splat(0.5)) / SPACING_M).to_array().map(|n| n as u32);
    let all = (0..=rows).flat_map(move |row| (0..=columns).map(move |column| (column, row)));
    all.map(move |(column, row)| low + SPACING_M * DVec2::new(column.into(), row.into())).filter(
        |at| {
            let pose = Pose { x_m: at.x, y_m: at.y, heading_deg: 0.0 };
            world.scene.check_pose(&pose).is_ok() && world.scene.clearance_m(*at) > 0.05
        },
    )
}

fn value(
    expected: &Ranges,
    measured: &[(f64, Option<f64>)],
    heading_deg: f64,
    likelihood: Likelihood<'_>,
) -> f64 {
    let log_likelihood = |&(azimuth_deg, read): &(f64, Option<f64>)| {
        let direction =
            ((azimuth_deg + heading_deg) / STEP_DEG).round().rem_euclid(DIRECTIONS as f64);
        likelihood(expected[direction as usize % DIRECTIONS], read)
    };
    measured.iter().map(log_likelihood).sum()
}

/// Normal density around the nearest hit with a standard deviation of 5 cm and a floor.
pub(crate) fn nearest_hit(expected: Option<f64>, read: Option<f64>) -> f64 {
    match (expected, read) {
        (Some(expected), Some(read)) => (normal(read - expected, 0.05) + 0.05).ln(),
        (None, None) => 0.0,
        _ => 0.05f64.ln(),
    }
}

fn normal(off: f64, sigma: f64) -> f64 {
    (-0.5 * (off / sigma).powi(2)).exp() / (sigma * std::f64::consts::TAU.sqrt())
}

/// Beam model with the four components of Thrun, Burgard and Fox.
pub(crate) struct BeamModel {
    /// Weights of hits, short readings, no echo, and random readings.
    shares: [f64; 4],
    sigma_m: f64,
    /// Decay rate of short readings, 1/m.
    rate_per_m: f64,
    reach_m: f64,
}

impl BeamModel {
    /// Maximum-likelihood components for sweeps at known poses (expectation maximization).
    pub(crate) fn learned(grid: &Grid, training: &[(Pose, FitSweep)]) -> Self {
        let pairs: Vec<(Option<f64>, Option<f64>)> = training
            .iter()
            .flat_map(|(pose, sweep)| {
                let expected = grid.expected(pose.position());
                let heading_deg = pose.heading_deg;
                grid.readings(sweep).into_iter().map(move |(azimuth_deg, read)| {
                    let direction = ((azimuth_deg + heading_deg) / STEP_DEG).round();
                    (expected[direction.rem_euclid(DIRECTIONS as f64) as usize % DIRECTIONS], read)
                })
            })
            .collect();
        let reach_m = grid.reach_m;
        let mut model =
            Self { shares: [0.7, 0.1, 0.1, 0.1], sigma_m: 0.05, rate_per_m: 1.0, reach_m };
        for _ in 0..30 {
            model = model.better(&pairs);
        }
        model
    }

    fn better(&self, pairs: &[(Option<f64>, Option<f64>)]) -> Self {
        let (mut sums, mut squares, mut lengths_m) = ([1e-3; 4], 1e-6, 1e-3);
        for &(expected, read) in pairs {
            let parts = self.parts(expected, read);
            let whole: f64 = parts.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            for (sum, part) in sums.iter_mut().zip(parts) {
                *sum += part / whole;
            }
            if let (Some(expected), Some(read)) = (expected, read) {
                squares += parts[0] / whole * (read - expected).powi(2);
                lengths_m += parts[1] / whole * read;
            }
        }
        let all: f64 = sums.iter().sum();
        Self {
            shares: sums.map(|sum| sum / all),
            sigma_m: (squares / sums[0]).sqrt().max(0.005),
            rate_per_m: sums[1] / lengths_m,
            reach_m: self.reach_m,
        }
    }

    fn parts(&self, expected: Option<f64>, read: Option<f64>) -> [f64; 4] {
        let [hit, short, none, any] = self.shares;
        let Some(read) = read else {
            return [if expected.is_none() { hit } else { 0.0 }, 0.0, none, 0.0];
        };
        let expected_m = expected.unwrap_or(self.reach_m);
        let hit_density = expected.map_or(0.0, |expected| normal(read - expected, self.sigma_m));
        let norm = 1.0 - (-self.rate_per_m * expected_m).exp();
        let of_short = if read < expected_m {
            self.rate_per_m * (-self.rate_per_m * read).exp() / norm.max(1e-9)
        } else {
            0.0
        };
        [hit * hit_density, short * of_short, 0.0, any / self.reach_m]
    }

    pub(crate) fn log_likelihood(&self, expected: Option<f64>, read: Option<f64>) -> f64 {
        self.parts(expected, read).iter().sum::<f64>().max(f64::MIN_POSITIVE).ln()
    }
}

/// Histograms of the ranges measured at each grid position.
pub(crate) struct Histograms {
    learned: Vec<(DVec2, [f64; BINS], Ranges)>,
}

const BIN_M: f64 = 0.25;
/// Number of bins: to 4 m, and one for no echo.
const BINS: usize = 17;

impl Histograms {
    /// Histograms of one sweep at each position.
    pub(crate) fn learned(world: &World, grid: &Grid, rng: &mut Pcg64) -> Self {
        let learned = grid.places.iter().filter_map(|(at, _)| {
            let heading_deg = rng.random_range(-180.0..180.0);
            let pose = Pose { x_m: at.x, y_m: at.y, heading_deg };
            let beams = readings(world, &pose, 0.0, rng)?;
            let mut ranges: Ranges = vec![None; DIRECTIONS];
            let mut measured = Vec::new();
            for beam in
                beams.into_iter().filter(|beam| beam.outcome != FiringOutcome::BelowMinRange)
            {
                let read = beam.outcome.range_m(grid.sound_speed_m_s);
                let direction = ((beam.azimuth_deg + heading_deg) / STEP_DEG).round();
                ranges[direction.rem_euclid(DIRECTIONS as f64) as usize % DIRECTIONS] = read;
                measured.push((beam.azimuth_deg, read));
            }
            Some((*at, histogram(&measured), ranges))
        });
        Self { learned: learned.collect() }
    }

    /// Most similar position by chi squared, and the rotation with the best fit of the ranges.
    pub(crate) fn locate(&self, measured: &[(f64, Option<f64>)]) -> Option<Pose> {
        let here = histogram(measured);
        let difference = |of: &[f64; BINS]| -> f64 {
            let part = |(a, b): (&f64, &f64)| (a - b).powi(2) / (a + b).max(1e-9);
            here.iter().zip(of).map(part).sum()
        };
        let (at, _, ranges) =
            self.learned.iter().min_by(|a, b| difference(&a.1).total_cmp(&difference(&b.1)))?;
        let likely = |turn: usize| value(ranges, measured, turn as f64 * STEP_DEG, &nearest_hit);
        let turn = (0..DIRECTIONS).max_by(|a, b| likely(*a).total_cmp(&likely(*b)))?;
        Some(Pose { x_m: at.x, y_m: at.y, heading_deg: wrap_180(turn as f64 * STEP_DEG) })
    }
}

fn histogram(measured: &[(f64, Option<f64>)]) -> [f64; BINS] {
    let mut counts = [0.0; BINS];
    for (_, read) in measured {
        let bin = read.map_or(BINS - 1, |range_m| ((range_m / BIN_M) as usize).min(BINS - 2));
        counts[bin] += 1.0 / measured.len() as f64;
    }
    counts
}

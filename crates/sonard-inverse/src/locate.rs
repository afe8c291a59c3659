//! Global localization of a sweep.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::{Pose, wrap_180};

use crate::{
    coarse_grid::{CoarseGrid, CoarseGridError, PoseMatch, is_apart},
    fit::{
        self, FitError, FitOptions, FitResult, Prior, RoughFit, approach, fit_near, one_of_many,
    },
    likelihood::READINGS_PER_ARC,
    parameter::Parameter,
    progress::{FitObserver, NoObserver},
    sweep::{FitSweep, SweepFiring},
    world::{SimulatorSet, World},
};

/// Pose hypothesis of a sweep with its posterior probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoseMode {
    /// World x coordinate, metres.
    pub x_m: f64,
    /// World y coordinate, metres.
    pub y_m: f64,
    /// Heading, degrees counter-clockwise from +x, from -180 to 180.
    pub heading_deg: f64,
    /// Posterior probability among the listed hypotheses.
    pub probability: f64,
    /// Standard deviation along x, metres.
    pub sigma_x_m: f64,
    /// Standard deviation along y, metres.
    pub sigma_y_m: f64,
    /// Standard deviation of the heading, degrees.
    pub sigma_heading_deg: f64,
    /// Fraction of the readings explained by the scene.
    pub explained: f64,
    /// Nuisance parameters fitted with the pose; see [`CoarseGrid::with_nuisance`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nuisance: Vec<NuisanceEstimate>,
}

/// Estimate of a nuisance parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NuisanceEstimate {
    /// Name of the parameter.
    pub name: String,
    /// Value, in the unit used in files.
    pub value: f64,
    /// Posterior standard deviation in the parameter's unit.
    pub sigma: f64,
}

impl PoseMode {
    /// Pose of the hypothesis.
    #[must_use]
    pub const fn pose(&self) -> Pose {
        Pose { x_m: self.x_m, y_m: self.y_m, heading_deg: self.heading_deg }
    }

    /// Hypothesis from a fit, with probability 1; nuisance parameters are relative to `world`.
    fn from_fit(fitted: &FitResult, world: &World, besides: &[Prior]) -> Self {
        let (pose, of) = (&fitted.poses[0], &fitted.estimates);
        let reports = fitted.report(world, &[], &with_pose(ROUGH_WIDEST, besides));
        let besides = reports.into_iter().skip(POSE).map(|report| NuisanceEstimate {
            name: report.name,
            value: report.value,
            sigma: report.sigma,
        });
        Self {
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_deg: wrap_180(pose.heading_deg),
            probability: 1.0,
            sigma_x_m: of[0].sigma,
            sigma_y_m: of[1].sigma,
            sigma_heading_deg: of[2].sigma,
            explained: fitted.errors.explained(),
            nuisance: besides.collect(),
        }
    }

    /// Standard deviation of the position, metres: root mean square of both axes.
    pub(crate) fn sigma_m(&self) -> f64 {
        of_place(self.sigma_x_m, self.sigma_y_m)
    }
}

/// Number of grid matches improved roughly, and of those improved with all beams.
const ROUGH: usize = 8;
const WHOLE: usize = 4;
/// Standard deviation of a position above which others are likely, metres. Then more matches are
/// evaluated; if echoes are few, from the beginning, since a rough fit is not informative.
const OPEN_M: f64 = 0.1;
const ROUGH_OPEN: usize = 56;
const WHOLE_OPEN: usize = 20;
/// Maximum error of a match: metres, at a spacing of 0.1 m, and degrees, at 3 degrees.
const ROUGH_WIDEST: (f64, f64) = (0.08, 4.5);
/// Maximum heading error of a rough fit, degrees.
const WHOLE_TURN_DEG: f64 = 2.0;
/// Minimum initial standard deviation after a rough fit, metres.
const MIN_WIDEST_M: f64 = 4e-3;
/// Number of beams of a rough fit.
const FEW_BEAMS: usize = 60;
/// Minimum probability of a listed hypothesis.
const MIN_PROBABILITY: f64 = 1e-3;
/// Maximum loss in log-posterior of a rough fit that is improved.
const FAR_BELOW: f64 = 60.0;
/// Maximum loss of a fit to all beams before it converges: twice as much, for the changes by
/// convergence.
const FAR_BELOW_WHOLE: f64 = 120.0;

/// Locates a sweep globally: all poses that explain it, most probable first.
///
/// # Errors
/// Invalid world.
pub fn locate(
    world: &World,
    atlas: &CoarseGrid,
    sweep: &FitSweep,
) -> Result<Vec<PoseMode>, FitError> {
    locate_observed(world, atlas, sweep, &NoObserver)
}

/// Locates like [`locate`], with cancellation by `watch`.
///
/// # Errors
/// As [`locate`], and [`FitError::Stopped`].
pub fn locate_observed(
    world: &World,
    atlas: &CoarseGrid,
    sweep: &FitSweep,
    watch: &dyn FitObserver,
) -> Result<Vec<PoseMode>, FitError> {
    Ok(modes(&explaining(world, atlas, sweep, &[], watch)?, world, atlas, |_| 0.0))
}

/// Fits the best-matching poses of the grid and the expected ones; returns distinct optima.
///
/// Behind the walls of a room lies its mirror image, which fits nearly as well. So positions not
/// surrounded by walls count only for a sweep that no other explains: if the mean log-likelihood of
/// its readings is below that of a range error of a metre.
pub(crate) fn explaining(
    world: &World,
    atlas: &CoarseGrid,
    sweep: &FitSweep,
    expected: &[Pose],
    watch: &dyn FitObserver,
) -> Result<Vec<FitResult>, FitError> {
    let besides = &atlas.besides;
    let search = PoseSearch { models: atlas.models(world)?, world, sweep, besides, watch };
    let matches = atlas.matches(world, sweep, ROUGH_OPEN);
    let has_few_echoes = sweep.has_few_echoes();
    let (rough, whole) = looked_at(has_few_echoes);
    let (best, others) = matches.split_at(rough.min(matches.len()));
    let starts = best.iter().map(|PoseMatch { pose, .. }| pose).chain(expected);
    let mut found = search.improved(starts, whole + expected.len())?;
    let is_open = has_few_echoes || found.first().is_some_and(is_hardly_held);
    if is_open {
        found.extend(search.improved(others.iter().map(|of| &of.pose), WHOLE_OPEN)?);
    }
    if is_open || found.first().is_none_or(|best| best.log_likelihood < 0.0) {
        let (rough, whole) = looked_at(is_open);
        match atlas.matches_outside(world, sweep, rough, watch) {
            Ok(matches) => found.extend(search.improved(matches.iter().map(|of| &of.pose), whole)?),
            Err(CoarseGridError::Stopped) => return Err(FitError::Stopped),
            Err(CoarseGridError::World(error)) => return Err(error.into()),
            Err(CoarseGridError::NoPlace) => {}
        }
    }
    found.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    Ok(distinct(found, 0.05, |found| &found.poses[0]))
}

/// Number of matches improved roughly, and of those improved with all beams.
const fn looked_at(is_open: bool) -> (usize, usize) {
    if is_open { (ROUGH_OPEN, WHOLE_OPEN) } else { (ROUGH, WHOLE) }
}

/// Returns `true` if a position is so uncertain that others are likely.
fn is_hardly_held(found: &FitResult) -> bool {
    let of = &found.estimates;
    of_place(of[0].sigma, of[1].sigma) > OPEN_M
}

/// Standard deviation of a position, metres: root mean square of those along x and y.
fn of_place(sigma_x_m: f64, sigma_y_m: f64) -> f64 {
    (0.5 * (sigma_x_m.powi(2) + sigma_y_m.powi(2))).sqrt()
}

/// Local fits about candidate poses.
struct PoseSearch<'a> {
    models: SimulatorSet,
    world: &'a World,
    sweep: &'a FitSweep,
    /// Priors of nuisance parameters.
    besides: &'a [Prior],
    watch: &'a dyn FitObserver,
}

impl PoseSearch<'_> {
    /// Fits from some poses, roughly with few beams, and the best `count` of them with all beams.
    fn improved<'p>(
        &self,
        starts: impl Iterator<Item = &'p Pose>,
        count: usize,
    ) -> Result<Vec<FitResult>, FitError> {
        let &Self { ref models, world, sweep, besides, watch } = self;
        let few = thinned(sweep, FEW_BEAMS);
        let settings = with_pose(ROUGH_WIDEST, besides);
        let mut rough: Vec<RoughFit> = Vec::new();
        for pose in starts {
            let near = FitSweep { pose: *pose, ..few.clone() };
            let found = approach(models.clone(), world, &near, &settings, watch);
            rough.extend(one_of_many(found)?);
        }
        rough.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
        let best = rough.first().map_or(0.0, |best| best.log_posterior);
        rough.retain(|found| found.log_posterior > best - FAR_BELOW);
        let mut whole: Vec<FitResult> = Vec::new();
        let mut nearly = f64::NEG_INFINITY;
        for found in distinct(rough, 0.05, |found| &found.pose).into_iter().take(count) {
            // The error of a rough fit is little more than the scatter of its readings.
            let widest_m = (3.0 * found.sigma_m).clamp(MIN_WIDEST_M, 0.03);
            let near = FitSweep { pose: found.pose, ..sweep.clone() };
            let settings = with_pose((widest_m, WHOLE_TURN_DEG), besides);
            let least = nearly - FAR_BELOW_WHOLE;
            let found = fit_near(models.clone(), world, &near, &settings, least, watch);
            let Some((found, log_posterior)) = one_of_many(found)?.flatten() else { continue };
            nearly = nearly.max(log_posterior);
            whole.push(found);
        }
        whole.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
        Ok(whole)
    }
}

/// Number of parameters of a pose.
const POSE: usize = 3;

/// Fit of a pose with a maximum error in metres and degrees, and of nuisance parameters.
fn with_pose((widest_m, widest_turn_deg): (f64, f64), besides: &[Prior]) -> FitOptions {
    let of = |parameter, sigma| Prior { parameter, sigma };
    let pose: [Prior; POSE] =
        [of(Parameter::X(0), 0.5), of(Parameter::Y(0), 0.5), of(Parameter::Heading(0), 20.0)];
    let priors = pose.into_iter().chain(besides.iter().cloned()).collect();
    let search = fit::Search::Quick;
    FitOptions {
        max_turn_deg: widest_turn_deg,
        min_sigma_m: 5e-4,
        search,
        ..FitOptions::with_priors(priors, widest_m)
    }
}

/// Evenly spread subset of a sweep's beams, up to two thirds with an echo: echoes identify a
/// position, and in front of two walls hardly any other beam has one.
fn thinned(sweep: &FitSweep, count: usize) -> FitSweep {
    let (echoes, silent): (Vec<&SweepFiring>, Vec<&SweepFiring>) =
        sweep.beams.iter().partition(|beam| beam.is_echo());
    let of_silent = silent.len().min(count - echoes.len().min(2 * count / 3));
    let of_echoes = echoes.len().min(count - of_silent);
    let beams = evenly(&echoes, of_echoes).chain(evenly(&silent, of_silent)).copied().collect();
    FitSweep { beams, ..sweep.clone() }
}

fn evenly<'a>(of: &'a [&'a SweepFiring], count: usize) -> impl Iterator<Item = &'a SweepFiring> {
    (0..count).map(move |at| of[at * of.len() / count])
}

/// Distinct poses of a sorted list; the first of near duplicates is kept.
fn distinct<T>(sorted: Vec<T>, within_m: f64, pose: impl Fn(&T) -> &Pose) -> Vec<T> {
    let mut kept: Vec<T> = Vec::new();
    for found in sorted {
        if kept.iter().all(|known| is_apart(pose(known), pose(&found), within_m)) {
            kept.push(found);
        }
    }
    kept
}

/// Hypotheses with posterior probabilities: evidence by the Laplace approximation, times the prior
/// given by `log_prior`.
pub(crate) fn modes(
    found: &[FitResult],
    world: &World,
    atlas: &CoarseGrid,
    log_prior: impl Fn(&PoseMode) -> f64,
) -> Vec<PoseMode> {
    let of = |fitted: &FitResult| PoseMode::from_fit(fitted, world, &atlas.besides);
    let mut modes: Vec<PoseMode> = found.iter().map(of).collect();
    let evidence = |fitted: &FitResult| {
        (fitted.log_posterior + 0.5 * log_volume(&fitted.covariance)) / READINGS_PER_ARC
    };
    let all: Vec<f64> =
        found.iter().zip(&modes).map(|(fitted, mode)| evidence(fitted) + log_prior(mode)).collect();
    let max = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = all.iter().map(|log| (log - max).exp()).sum();
    for (mode, log) in modes.iter_mut().zip(&all) {
        mode.probability = (log - max).exp() / sum;
    }
    modes.retain(|mode| mode.probability >= MIN_PROBABILITY);
    modes.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    modes
}

/// Logarithm of the determinant of a covariance.
fn log_volume(covariance: &DMatrix<f64>) -> f64 {
    covariance.determinant().max(f64::MIN_POSITIVE).ln()
}

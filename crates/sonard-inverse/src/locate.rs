//! Where a sweep was taken.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::{Pose, wrap_180};

use crate::{
    atlas::{Atlas, AtlasError, Match, is_apart},
    fit::{self, Approached, Fit, FitError, Fitted, Prior, approach, fit_near, one_of_many},
    likelihood::READINGS_OF_ARC,
    parameter::Parameter,
    sweep::{Beam, Sweep},
    watch::{Unwatched, Watch},
    world::{Models, World},
};

/// A pose that explains a sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mode {
    /// Metres.
    pub x_m: f64,
    /// Metres.
    pub y_m: f64,
    /// Degrees counter-clockwise from +x, from -180 to 180.
    pub heading_deg: f64,
    /// Probability that it is the right one of those listed.
    pub probability: f64,
    /// Standard deviations.
    pub sigma_x_m: f64,
    /// The same along y, metres.
    pub sigma_y_m: f64,
    /// Degrees.
    pub sigma_heading_deg: f64,
    /// Share of the readings that it explains.
    pub explained: f64,
    /// What else was fitted with it; see [`Atlas::fitting`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub besides: Vec<Besides>,
}

/// A value that was fitted together with a pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Besides {
    /// What it is.
    pub name: String,
    /// In the unit of the figure that files have.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
}

impl Mode {
    /// Where a sweep was fitted, for certain as long as there is no other; and what was fitted besides, from `world` on.
    fn of(fitted: &Fitted, world: &World, besides: &[Prior]) -> Self {
        let (pose, of) = (&fitted.poses[0], &fitted.estimates);
        let told = fitted.told(world, &[], &with_pose(ROUGH_WIDEST, besides));
        let besides = told.into_iter().skip(POSE).map(|told| Besides {
            name: told.name,
            value: told.value,
            sigma: told.sigma,
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
            besides: besides.collect(),
        }
    }

    /// Standard deviation of its place, metres: root mean square of both axes.
    pub(crate) fn sigma_m(&self) -> f64 {
        of_place(self.sigma_x_m, self.sigma_y_m)
    }
}

/// Matches of the atlas that are improved roughly, and of those how many with all beams.
const ROUGH: usize = 8;
const WHOLE: usize = 4;
/// A place that is known less well than this, metres, is one of many; and so may be one where a smaller share of the beams
/// heard something, of which a rough look tells little. So many more are looked at then, from the beginning where echoes are
/// few.
const OPEN_M: f64 = 0.1;
const ROUGH_OPEN: usize = 56;
const WHOLE_OPEN: usize = 20;
/// As far off as a match may be: metres, with places 0.1 m apart, and degrees, with directions 3 apart.
const ROUGH_WIDEST: (f64, f64) = (0.08, 4.5);
/// As far off as a rough fit's heading may be, degrees.
const WHOLE_TURN_DEG: f64 = 2.0;
/// What a pose is off by at least after a rough look, metres.
const LEAST_WIDEST_M: f64 = 4e-3;
/// Beams of a rough look.
const FEW_BEAMS: usize = 60;
/// Modes this much less likely than the best are not listed.
const LEAST_PROBABILITY: f64 = 1e-3;
/// Logarithm of how much less likely a rough fit may be and still be improved.
const FAR_BELOW: f64 = 60.0;
/// The same of a fit to all beams before it settles: what is not listed, with as much again for what settling may change.
const FAR_BELOW_WHOLE: f64 = 120.0;

/// Finds where a sweep was taken, without any guess: all poses that explain it, most probable first.
///
/// # Errors
/// When there is nothing to predict with.
pub fn locate(world: &World, atlas: &Atlas, sweep: &Sweep) -> Result<Vec<Mode>, FitError> {
    locate_watched(world, atlas, sweep, &Unwatched)
}

/// The same, until `watch` stops it.
///
/// # Errors
/// As [`locate`], and [`FitError::Stopped`].
pub fn locate_watched(
    world: &World,
    atlas: &Atlas,
    sweep: &Sweep,
    watch: &dyn Watch,
) -> Result<Vec<Mode>, FitError> {
    Ok(modes(&explaining(world, atlas, sweep, &[], watch)?, world, atlas, |_| 0.0))
}

/// Fits the poses of the atlas that a sweep goes with best, and those where it is expected; the likeliest ones, each once.
///
/// Behind the walls of a room lies its mirror image, which fits nearly as well. So places with nothing in most directions
/// count only for a sweep that none of the others explains: one whose readings, on the average, are less likely than if
/// they were known to a metre.
pub(crate) fn explaining(
    world: &World,
    atlas: &Atlas,
    sweep: &Sweep,
    expected: &[Pose],
    watch: &dyn Watch,
) -> Result<Vec<Fitted>, FitError> {
    let besides = &atlas.besides;
    let search = Search { models: atlas.models(world)?, world, sweep, besides, watch };
    let matches = atlas.matches(world, sweep, ROUGH_OPEN);
    let has_few_echoes = sweep.hears_little();
    let (rough, whole) = looked_at(has_few_echoes);
    let (best, others) = matches.split_at(rough.min(matches.len()));
    let starts = best.iter().map(|Match { pose, .. }| pose).chain(expected);
    let mut found = search.improved(starts, whole + expected.len())?;
    let is_open = has_few_echoes || found.first().is_some_and(is_hardly_held);
    if is_open {
        found.extend(search.improved(others.iter().map(|of| &of.pose), WHOLE_OPEN)?);
    }
    if is_open || found.first().is_none_or(|best| best.log_likelihood < 0.0) {
        let (rough, whole) = looked_at(is_open);
        match atlas.matches_beside(world, sweep, rough, watch) {
            Ok(matches) => found.extend(search.improved(matches.iter().map(|of| &of.pose), whole)?),
            Err(AtlasError::Stopped) => return Err(FitError::Stopped),
            Err(AtlasError::World(error)) => return Err(error.into()),
            Err(AtlasError::NoPlace) => {}
        }
    }
    found.sort_by(|one, other| other.log_posterior.total_cmp(&one.log_posterior));
    Ok(distinct(found, 0.05, |found| &found.poses[0]))
}

/// How many matches are improved roughly, and how many of them with all beams.
const fn looked_at(is_open: bool) -> (usize, usize) {
    if is_open { (ROUGH_OPEN, WHOLE_OPEN) } else { (ROUGH, WHOLE) }
}

/// Whether so little holds a place that there may be others like it.
fn is_hardly_held(found: &Fitted) -> bool {
    let of = &found.estimates;
    of_place(of[0].sigma, of[1].sigma) > OPEN_M
}

/// Standard deviation of a place by those along x and y, metres: their root mean square.
fn of_place(sigma_x_m: f64, sigma_y_m: f64) -> f64 {
    (0.5 * (sigma_x_m.powi(2) + sigma_y_m.powi(2))).sqrt()
}

/// What is looked for where.
struct Search<'a> {
    models: Models,
    world: &'a World,
    sweep: &'a Sweep,
    /// What is fitted besides the pose.
    besides: &'a [Prior],
    watch: &'a dyn Watch,
}

impl Search<'_> {
    /// Fits from each of some poses, roughly and by few beams, and the `most` best of them by all.
    fn improved<'p>(
        &self,
        starts: impl Iterator<Item = &'p Pose>,
        most: usize,
    ) -> Result<Vec<Fitted>, FitError> {
        let &Self { ref models, world, sweep, besides, watch } = self;
        let few = thinned(sweep, FEW_BEAMS);
        let what = with_pose(ROUGH_WIDEST, besides);
        let mut rough: Vec<Approached> = Vec::new();
        for pose in starts {
            let near = Sweep { pose: *pose, ..few.clone() };
            let found = approach(models.clone(), world, &near, &what, watch);
            rough.extend(one_of_many(found)?);
        }
        rough.sort_by(|one, other| other.log_posterior.total_cmp(&one.log_posterior));
        let best = rough.first().map_or(0.0, |best| best.log_posterior);
        rough.retain(|found| found.log_posterior > best - FAR_BELOW);
        let mut whole: Vec<Fitted> = Vec::new();
        let mut nearly = f64::NEG_INFINITY;
        for found in distinct(rough, 0.05, |found| &found.pose).into_iter().take(most) {
            // A rough fit is off by little more than its readings spread.
            let widest_m = (3.0 * found.sigma_m).clamp(LEAST_WIDEST_M, 0.03);
            let near = Sweep { pose: found.pose, ..sweep.clone() };
            let what = with_pose((widest_m, WHOLE_TURN_DEG), besides);
            let least = nearly - FAR_BELOW_WHOLE;
            let found = fit_near(models.clone(), world, &near, &what, least, watch);
            let Some((found, log_posterior)) = one_of_many(found)?.flatten() else { continue };
            nearly = nearly.max(log_posterior);
            whole.push(found);
        }
        whole.sort_by(|one, other| other.log_posterior.total_cmp(&one.log_posterior));
        Ok(whole)
    }
}

/// How many values a pose has.
const POSE: usize = 3;

/// Fits a pose, that may be so many metres and degrees off, and what is fitted besides.
fn with_pose((widest_m, widest_turn_deg): (f64, f64), besides: &[Prior]) -> Fit {
    let of = |parameter, sigma| Prior { parameter, sigma };
    let pose: [Prior; POSE] =
        [of(Parameter::X(0), 0.5), of(Parameter::Y(0), 0.5), of(Parameter::Heading(0), 20.0)];
    let priors = pose.into_iter().chain(besides.iter().cloned()).collect();
    let search = fit::Search::Quick;
    Fit { widest_turn_deg, least_sigma_m: 5e-4, search, ..Fit::usual(priors, widest_m) }
}

/// So many of a sweep's beams, evenly spread: two of three that heard something, where there are as many, because what
/// a place is known by are its echoes, and of a sweep before two walls hardly any other beam has one.
fn thinned(sweep: &Sweep, count: usize) -> Sweep {
    let (echoes, silent): (Vec<&Beam>, Vec<&Beam>) =
        sweep.beams.iter().partition(|beam| beam.is_echo());
    let of_silent = silent.len().min(count - echoes.len().min(2 * count / 3));
    let of_echoes = echoes.len().min(count - of_silent);
    let beams = evenly(&echoes, of_echoes).chain(evenly(&silent, of_silent)).copied().collect();
    Sweep { beams, ..sweep.clone() }
}

fn evenly<'a>(of: &'a [&'a Beam], count: usize) -> impl Iterator<Item = &'a Beam> {
    (0..count).map(move |at| of[at * of.len() / count])
}

/// Each pose once, of those that several fits found the best.
fn distinct<T>(sorted: Vec<T>, within_m: f64, pose: impl Fn(&T) -> &Pose) -> Vec<T> {
    let mut kept: Vec<T> = Vec::new();
    for found in sorted {
        if kept.iter().all(|known| is_apart(pose(known), pose(&found), within_m)) {
            kept.push(found);
        }
    }
    kept
}

/// Modes with their probabilities: each one's evidence by Laplace's approximation, times how probable it was beforehand,
/// whose logarithm `log_prior` gives.
pub(crate) fn modes(
    found: &[Fitted],
    world: &World,
    atlas: &Atlas,
    log_prior: impl Fn(&Mode) -> f64,
) -> Vec<Mode> {
    let of = |fitted: &Fitted| Mode::of(fitted, world, &atlas.besides);
    let mut modes: Vec<Mode> = found.iter().map(of).collect();
    let evidence = |fitted: &Fitted| {
        (fitted.log_posterior + 0.5 * log_volume(&fitted.covariance)) / READINGS_OF_ARC
    };
    let all: Vec<f64> =
        found.iter().zip(&modes).map(|(fitted, mode)| evidence(fitted) + log_prior(mode)).collect();
    let most = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = all.iter().map(|log| (log - most).exp()).sum();
    for (mode, log) in modes.iter_mut().zip(&all) {
        mode.probability = (log - most).exp() / sum;
    }
    modes.retain(|mode| mode.probability >= LEAST_PROBABILITY);
    modes.sort_by(|one, other| other.probability.total_cmp(&one.probability));
    modes
}

/// Logarithm of the determinant.
fn log_volume(covariance: &DMatrix<f64>) -> f64 {
    covariance.determinant().max(f64::MIN_POSITIVE).ln()
}

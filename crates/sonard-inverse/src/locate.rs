//! Where a sweep was taken.

use nalgebra::DMatrix;
use serde::Serialize;
use sonard_model::geometry::{Pose, wrap_180};

use crate::{
    atlas::{Atlas, Match, is_apart},
    fit::{Fit, FitError, Fitted, Prior, fit_with},
    parameter::Parameter,
    sweep::Sweep,
    world::{Models, World},
};

/// A pose that explains a sweep.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
}

/// Matches of the atlas that are improved roughly, and of those how many with all beams.
const ROUGH: usize = 8;
const WHOLE: usize = 4;
/// What a pose is off by at least after a rough look, metres.
const LEAST_WIDEST_M: f64 = 4e-3;
/// Beams of a rough look.
const FEW_BEAMS: usize = 60;
/// Readings that share what the model misses of an arc, and so count as one where poses are weighed against each
/// other: taken for independent they would make sure of what they can't tell.
const READINGS_OF_ARC: f64 = 8.0;
/// Modes this much less likely than the best are not listed.
const LEAST_PROBABILITY: f64 = 1e-3;
/// Logarithm of how much less likely a rough fit may be and still be improved.
const FAR_BELOW: f64 = 60.0;

/// Finds where a sweep was taken, without any guess: all poses that explain it, most probable first.
///
/// # Errors
/// When there is nothing to predict with.
pub fn locate(world: &World, atlas: &Atlas, sweep: &Sweep) -> Result<Vec<Mode>, FitError> {
    let models = atlas.models(world)?;
    let improved = |sweep: &Sweep, pose: &Pose, widest_m: f64| {
        improved(models.clone(), world, sweep, pose, widest_m)
    };
    let few = thinned(sweep, FEW_BEAMS);
    let mut rough: Vec<Fitted> = Vec::new();
    for Match { pose, .. } in atlas.matches(world, sweep, ROUGH) {
        rough.extend(improved(&few, &pose, 0.08).ok());
    }
    rough.sort_by(|one, other| other.log_posterior.total_cmp(&one.log_posterior));
    let best = rough.first().map_or(0.0, |best| best.log_posterior);
    rough.retain(|found| found.log_posterior > best - FAR_BELOW);
    let mut whole: Vec<Fitted> = Vec::new();
    for found in distinct(rough, 0.05).into_iter().take(WHOLE) {
        // A rough fit is off by little more than its readings spread.
        let widest_m = (3.0 * found.errors.sigma_m).clamp(LEAST_WIDEST_M, 0.03);
        whole.extend(improved(sweep, &found.poses[0], widest_m).ok());
    }
    whole.sort_by(|one, other| other.log_posterior.total_cmp(&one.log_posterior));
    Ok(modes(&distinct(whole, 0.05)))
}

fn improved(
    models: Models,
    world: &World,
    sweep: &Sweep,
    pose: &Pose,
    widest_m: f64,
) -> Result<Fitted, FitError> {
    let of = |parameter, sigma| Prior { parameter, sigma };
    let priors =
        vec![of(Parameter::X(0), 0.5), of(Parameter::Y(0), 0.5), of(Parameter::Heading(0), 20.0)];
    let from = Sweep { pose: *pose, ..sweep.clone() };
    let what = Fit { priors, widest_m, least_sigma_m: 5e-4, least_sigma_db: 0.5 };
    fit_with(models, world, std::slice::from_ref(&from), &what)
}

/// Every so many of a sweep's beams.
fn thinned(sweep: &Sweep, count: usize) -> Sweep {
    let beams = &sweep.beams;
    let count = count.min(beams.len());
    let beams = (0..count).map(|at| beams[at * beams.len() / count]).collect();
    Sweep { beams, ..sweep.clone() }
}

/// Each pose once, of those that several fits found the best.
fn distinct(sorted: Vec<Fitted>, within_m: f64) -> Vec<Fitted> {
    let mut kept: Vec<Fitted> = Vec::new();
    for found in sorted {
        if kept.iter().all(|known| is_apart(&known.poses[0], &found.poses[0], within_m)) {
            kept.push(found);
        }
    }
    kept
}

/// Modes with their probabilities, by Laplace's approximation of each one's evidence.
fn modes(found: &[Fitted]) -> Vec<Mode> {
    let evidence = |fitted: &Fitted| {
        (fitted.log_posterior + 0.5 * log_volume(&fitted.covariance)) / READINGS_OF_ARC
    };
    let all: Vec<f64> = found.iter().map(evidence).collect();
    let most = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = all.iter().map(|evidence| (evidence - most).exp()).sum();
    let mut modes: Vec<Mode> = found
        .iter()
        .zip(&all)
        .map(|(fitted, evidence)| {
            let (pose, of) = (&fitted.poses[0], &fitted.estimates);
            Mode {
                x_m: pose.x_m,
                y_m: pose.y_m,
                heading_deg: wrap_180(pose.heading_deg),
                probability: (evidence - most).exp() / sum,
                sigma_x_m: of[0].sigma,
                sigma_y_m: of[1].sigma,
                sigma_heading_deg: of[2].sigma,
                explained: 1.0 - fitted.errors.clutter,
            }
        })
        .filter(|mode| mode.probability >= LEAST_PROBABILITY)
        .collect();
    modes.sort_by(|one, other| other.probability.total_cmp(&one.probability));
    modes
}

/// Logarithm of the determinant.
fn log_volume(covariance: &DMatrix<f64>) -> f64 {
    covariance.determinant().max(f64::MIN_POSITIVE).ln()
}

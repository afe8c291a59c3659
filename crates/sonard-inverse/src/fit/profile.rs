//! Profile likelihood along ridges of the posterior.
//!
//! Where a wall, the pose and the speed of sound compensate each other, the likelihood is nearly
//! constant along a ridge; only the phases of arrivals determine the position on it. A fit started
//! off the ridge slides along it before phases take effect. So the ridge is followed in steps with
//! the combination held constant and everything else fitted. The best of these points are then
//! released.

use nalgebra::DVector;

use super::{
    FitError, Fitter, Optimum, Point, Problem,
    checkpoint::{SearchResult, listed},
    lm_step::Improved,
    one_of_many,
    perturbation::{CLOSE, ROUGH, StartPoint, keep_likelier, widened},
    refine::FAR_BELOW,
};
use crate::{
    candidates::Phases, likelihood::ErrorModel, parameter::Parameter, progress::FitProgress,
    time_walk::WELL_KNOWN,
};

/// Steps to each side, and their length in standard deviations of the rough information.
const STEPS: (usize, f64) = (8, 0.35);
/// Error model of a step with phases.
const WITH_PHASES: (f64, f64, f64) = (0.002, 1.0, 0.01);
/// Number of peaks followed, and of their optima refined.
const FOLLOWED: usize = 4;
const POLISHED: usize = 2;
/// Maximum number of rounds, each from a better optimum elsewhere.
const ROUNDS: usize = 3;

/// Direction in the parameters' units, with its standard deviation.
type Direction = (DVector<f64>, f64);

/// Knowledge of the phases and error model of one set of steps.
type StepModel = (Phases, ErrorModel);

impl Fitter<'_> {
    /// Best optimum over the peaks along the ridges through an optimum, including itself. If ranges
    /// are too uncertain for phases, that one.
    pub(super) fn search_ridges(&self, mut best: Optimum) -> Result<Optimum, FitError> {
        if self.problem.range_error_wavelengths(&best.errors) > WELL_KNOWN {
            return Ok(best);
        }
        for _ in 0..ROUNDS {
            let (before, value) = (best.point.values.clone(), best.value);
            for optimum in self.release_peaks(&best)? {
                if optimum.value > value - FAR_BELOW {
                    keep_likelier(&mut best, one_of_many(self.refine(optimum))?);
                }
            }
            if !self.problem.is_apart(&best.point.values, &before) {
                break;
            }
        }
        Ok(best)
    }

    /// Optima reached from peaks, likeliest first: from each directly, and by closer error models
    /// with nothing held.
    fn release_peaks(&self, best: &Optimum) -> Result<Vec<Optimum>, FitError> {
        let mut optima: Vec<Optimum> = Vec::new();
        for peak in self.find_peaks(best)? {
            optima.extend(self.converge_with_phases(peak.values.clone(), &best.errors)?);
            let direct = self.converge(&Point::coherent(peak.values), best.errors);
            optima.extend(one_of_many(direct)?);
        }
        optima.sort_by(|a, b| b.value.total_cmp(&a.value));
        optima.truncate(POLISHED);
        Ok(optima)
    }

    /// Optimum with phases reached from a start by successively narrower error models; `None` if
    /// the ranges there are too uncertain for phases.
    pub(super) fn converge_with_phases(
        &self,
        start: DVector<f64>,
        errors: &ErrorModel,
    ) -> Result<Option<Optimum>, FitError> {
        let steps = [CLOSE, WITH_PHASES].map(|by| (Phases::Known, spread_by(errors, by)));
        let Some(found) = self.run_start(|| self.improve_by(start, &steps, None))? else {
            return Ok(None);
        };
        let optimum = self.converge(&Point::coherent(found.values), steps[1].1);
        let optimum = one_of_many(optimum)?;
        Ok(optimum.filter(|optimum| !self.problem.is_beyond_phases(&optimum.errors)))
    }

    /// Local maxima of the profiles along the ridges, likeliest first.
    fn find_peaks(&self, best: &Optimum) -> Result<Vec<StartPoint>, FitError> {
        let ridges = self.ridges(best)?;
        let of = ridges.len() * 2 * STEPS.0;
        let mut peaks: Vec<StartPoint> = Vec::new();
        for (number, ridge) in ridges.iter().enumerate() {
            let steps = self.profile(best, ridge, (number * 2 * STEPS.0, of))?;
            let values: Vec<f64> = steps.iter().map(|step| step.value).collect();
            let value = |at: Option<usize>| {
                at.and_then(|at| values.get(at)).copied().unwrap_or(f64::NEG_INFINITY)
            };
            let is_peak = |&(at, ref step): &(usize, StartPoint)| {
                step.value >= value(at.checked_sub(1)).max(value(Some(at + 1)))
            };
            peaks.extend(steps.into_iter().enumerate().filter(is_peak).map(|(_, step)| step));
        }
        peaks.sort_by(|a, b| b.value.total_cmp(&a.value));
        peaks.truncate(FOLLOWED);
        Ok(peaks)
    }

    /// Weakly constrained directions, and the threshold: an optimum with a threshold off by many
    /// decibels and an equally wide error model is a trap that no other direction leaves.
    fn ridges(&self, best: &Optimum) -> Result<Vec<Direction>, FitError> {
        let about = Point::incoherent(best.point.values.clone());
        let mut ridges = self.weak_directions(&about, &widened(&best.errors, ROUGH))?;
        if let Some(at) = self.problem.index_of(&Parameter::Threshold) {
            let mut threshold = self.problem.zero();
            threshold[at] = self.problem.options.priors[at].sigma;
            ridges.push((threshold, 1.0));
        }
        Ok(ridges)
    }

    /// Profile along a ridge from one side to the other, without the middle; `number` steps precede
    /// it.
    pub(super) fn profile(
        &self,
        best: &Optimum,
        (direction, sigma): &Direction,
        (number, of): (usize, usize),
    ) -> Result<Vec<StartPoint>, FitError> {
        let models = [
            (Phases::Unknown, widened(&best.errors, CLOSE)),
            (Phases::Known, spread_by(&best.errors, WITH_PHASES)),
        ];
        let position = self.problem.position_along(direction);
        let (steps, apart) = STEPS;
        let mut sides: [Vec<StartPoint>; 2] = Default::default();
        for (side, (places, sign)) in sides.iter_mut().zip([-1.0, 1.0]).enumerate() {
            let mut from = best.point.values.clone();
            for step in 1..=steps {
                let start = self.problem.limited(from + sign * apart * *sigma * direction);
                let found = self.run_start(|| {
                    let start_number = number + side * steps + step;
                    self.observer.progress(FitProgress::Restart { start: start_number, of });
                    self.improve_by(start, &models, Some(&position))
                })?;
                let Some(found) = found else { break };
                from = found.values.clone();
                places.push(found);
            }
        }
        let [before, behind] = sides;
        Ok(before.into_iter().rev().chain(behind).collect())
    }

    /// Improves a start by two sets of steps, with `held` constant; the log-posterior uses the
    /// observed scatter.
    fn improve_by(
        &self,
        start: DVector<f64>,
        steps: &[StepModel; 2],
        held: Option<&DVector<f64>>,
    ) -> Result<SearchResult, FitError> {
        let mut point = Point::incoherent(start);
        for (phases, errors) in steps {
            point.phases = *phases;
            let linear = self.linearize(&point)?;
            Improved { point, .. } = self.improve(&linear, &point, errors, held)?;
        }
        let linear = self.linearize(&point)?;
        let errors = self.estimate_errors(&linear, &steps[1].1);
        let log_posterior = self.log_posterior(&linear, &point, &errors);
        Ok(SearchResult::Place { values: listed(&point.values), log_posterior })
    }
}

impl Problem<'_> {
    /// Linear functional that measures the position along a direction, in prior standard
    /// deviations.
    pub(super) fn position_along(&self, direction: &DVector<f64>) -> DVector<f64> {
        let sigmas = self.prior_sigmas();
        direction.component_div(&sigmas).component_div(&sigmas)
    }
}

fn spread_by(errors: &ErrorModel, (sigma_m, sigma_db, clutter): (f64, f64, f64)) -> ErrorModel {
    ErrorModel { sigma_m, sigma_db, outlier_share: clutter, ..*errors }
}

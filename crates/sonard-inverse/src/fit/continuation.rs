//! Continuation: annealing of the error model from wide to the observed scatter.

use nalgebra::DVector;

use super::{
    FitError, Fitter, Optimum, Point, Search,
    checkpoint::{SearchResult, listed},
    lm_step::Improved,
    one_of_many,
};
use crate::{
    candidates::Phases, likelihood::ErrorModel, linear::LinearizedModel, progress::FitProgress,
};

/// Stages: standard deviation of ranges relative to the widest, and of the threshold, decibels. The
/// first is wide enough for convergence, the last near the observed scatter.
pub(super) const STAGES: [(f64, f64); 5] =
    [(1.0, 6.0), (0.5, 5.0), (0.25, 4.0), (0.12, 3.0), (0.06, 2.5)];
/// Number of final steps if phases follow, and maximum number otherwise.
const FIRST_STEPS: usize = 4;
const LAST_STEPS: usize = 12;
/// Reduction factor of a step that lowers the likelihood, and its minimum length relative to
/// [`Parameter::step`](crate::parameter::Parameter::step).
const SHORTER: f64 = 0.3;
const MIN_STEP: f64 = 0.003;
/// Minimum gain in log-posterior of an accepted step.
const MIN_GAIN: f64 = 1e-3;
/// Rotations tried at each stage: step in degrees, and number on either side.
const TURNS: [(f64, i32); STAGES.len()] = [(1.5, 8), (1.5, 8), (1.0, 10), (0.75, 12), (0.5, 10)];

impl Fitter<'_> {
    /// Runs some stages of the continuation from a point and an error model.
    pub(super) fn run_continuation(
        &self,
        mut point: Point,
        mut errors: ErrorModel,
        stages: impl Iterator<Item = usize>,
    ) -> Result<(Point, ErrorModel), FitError> {
        for stage in stages {
            let found = self.run_or_replay(|| self.run_stage(&point, errors, stage))?;
            let SearchResult::Spread { values, errors: narrowed, is_last } = found else {
                return Err(FitError::OtherFit);
            };
            (point, errors) = (point.moved_to(DVector::from_vec(values)), narrowed);
            if is_last {
                break;
            }
        }
        Ok((point, errors))
    }

    /// Runs one stage.
    fn run_stage(
        &self,
        from: &Point,
        mut errors: ErrorModel,
        stage: usize,
    ) -> Result<SearchResult, FitError> {
        let options = self.problem.options;
        let ((share, sigma_db), (step_deg, steps)) = (STAGES[stage], TURNS[stage]);
        self.observer.progress(FitProgress::Continuation { stage: stage + 1, of: STAGES.len() });
        let steps = steps.min((options.max_turn_deg / step_deg) as i32);
        // Never narrower than the observed scatter: otherwise a few readings that happen to agree
        // would dominate, and all others count as clutter.
        let scatter = self.estimate_errors(&*self.linearize(from)?, &errors);
        errors.sigma_m = (options.initial_sigma_m * share).max(scatter.sigma_m.min(errors.sigma_m));
        errors.sigma_db = sigma_db.max(options.min_sigma_db);
        let turns = self.turn(from, &errors, step_deg, steps)?;
        let mut point = from.moved_to(&from.values + &turns);
        let mut largest = f64::INFINITY;
        for _ in 0..3 {
            let linear = self.linearize(&point)?;
            Improved { point, largest } = self.improve(&linear, &point, &errors, None)?;
            if largest < 0.2 {
                break;
            }
        }
        // The observed scatter is reached and nothing moves: narrower stages change nothing.
        let is_last = turns.amax() == 0.0
            && largest < 0.02
            && errors.sigma_m > options.initial_sigma_m * share;
        Ok(SearchResult::Spread { values: listed(&point.values), errors, is_last })
    }

    /// Converges without phases, and with them if ranges allow it; returns the likelier optimum.
    pub(super) fn settle(&self, from: &Point, errors: ErrorModel) -> Result<Optimum, FitError> {
        self.try_phases(self.converge(from, errors)?)
    }

    /// Likelier of an optimum without phases and the one with phases that follows from it.
    pub(super) fn try_phases(&self, without: Optimum) -> Result<Optimum, FitError> {
        if self.problem.is_beyond_phases(&without.errors) {
            return Ok(without);
        }
        let with = self.converge(&without.point.with_phases(Phases::Known), without.errors)?;
        Ok(if with.value > without.value { with } else { without })
    }

    /// Alternates between error model and values until the log-posterior converges.
    pub(super) fn converge(&self, from: &Point, errors: ErrorModel) -> Result<Optimum, FitError> {
        match self.run_or_replay(|| self.run_steps(from, errors))? {
            SearchResult::End { values, errors, log_posterior } => Ok(Optimum {
                value: log_posterior,
                point: from.moved_to(DVector::from_vec(values)),
                errors,
            }),
            _ => Err(FitError::OtherFit),
        }
    }

    /// Repeats an on-axis optimum with exact predictions: a thorough search refines it, a quick one
    /// makes one step.
    pub(super) fn predict_exactly(&self, optimum: Optimum) -> Result<Optimum, FitError> {
        // The mounting may have changed since the start.
        if self.problem.world(&optimum.point.values)?.sensor.mounting.is_on_axis() {
            return Ok(optimum);
        }
        let point = Point { is_exact: true, ..optimum.point.clone() };
        if self.problem.options.search == Search::Quick {
            let linear = self.linearize(&point)?;
            let Improved { point, .. } = self.improve(&linear, &point, &optimum.errors, None)?;
            return Ok(Optimum { point, ..optimum });
        }
        self.refine(self.converge(&point, optimum.errors)?)
    }

    fn run_steps(&self, from: &Point, errors: ErrorModel) -> Result<SearchResult, FitError> {
        let linear = self.linearize(from)?;
        let mut errors = self.estimate_errors(&linear, &errors);
        let mut best = (self.log_posterior(&linear, from, &errors), from.clone());
        let mut step = self.step_from(&linear, from, &errors)?;
        for number in 0..LAST_STEPS {
            // Without phases the optimum is preliminary: with them another point is likelier.
            let is_final = self.problem.is_beyond_phases(&errors);
            if number >= FIRST_STEPS && !is_final {
                break;
            }
            let next = best.1.moved_to(self.problem.limited(&best.1.values + &step));
            // Prediction may fail, as within a wall.
            let linear = one_of_many(self.linearize(&next))?;
            let there = linear.map(|linear| {
                let scatter = self.estimate_errors(&linear, &errors);
                (self.log_posterior(&linear, &next, &scatter), scatter, linear)
            });
            match there {
                Some((value, scatter, linear)) if value > best.0 + MIN_GAIN => {
                    step = self.step_from(&linear, &next, &scatter)?;
                    (best, errors) = ((value, next), scatter);
                }
                // Too far: outside the validity of the linearization.
                _ if is_final && self.problem.largest_share(&step) >= MIN_STEP => step *= SHORTER,
                _ => break,
            }
        }
        let (log_posterior, Point { values, .. }) = best;
        Ok(SearchResult::End { values: listed(&values), errors, log_posterior })
    }

    /// Optimal step of the linearization about a point.
    fn step_from(
        &self,
        linear: &LinearizedModel,
        point: &Point,
        errors: &ErrorModel,
    ) -> Result<DVector<f64>, FitError> {
        Ok(self.improve(linear, point, errors, None)?.point.values - &point.values)
    }
}

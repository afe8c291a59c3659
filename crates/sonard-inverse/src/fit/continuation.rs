//! Continuation: annealing of the error model from wide to the observed scatter.

use nalgebra::DVector;

use super::{
    FitError, Fitter, Optimum, Search,
    checkpoint::{SearchResult, listed},
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

/// Range error in wavelengths above which phases carry no information.
const MISSED: f64 = 0.5;

impl Fitter<'_> {
    /// Runs some stages of the continuation.
    pub(super) fn approach(
        &mut self,
        errors: &mut ErrorModel,
        stages: impl Iterator<Item = usize>,
    ) -> Result<(), FitError> {
        for stage in stages {
            let from = *errors;
            let found = self.found(|fitter| fitter.narrowed(from, stage))?;
            let SearchResult::Spread { values, errors: narrowed, is_last } = found else {
                return Err(FitError::OtherFit);
            };
            (self.values, *errors) = (DVector::from_vec(values), narrowed);
            if is_last {
                break;
            }
        }
        Ok(())
    }

    /// Runs one stage.
    fn narrowed(&mut self, mut errors: ErrorModel, stage: usize) -> Result<SearchResult, FitError> {
        let ((share, sigma_db), (step_deg, steps)) = (STAGES[stage], TURNS[stage]);
        self.watch.progress(FitProgress::Continuation { stage: stage + 1, of: STAGES.len() });
        let steps = steps.min((self.fit.max_turn_deg / step_deg) as i32);
        // Never narrower than the observed scatter: otherwise a few readings that happen to agree
        // would dominate, and all others count as clutter.
        let linear = self.linear()?;
        let spread = self.spread(&linear, &errors);
        errors.sigma_m = (self.fit.initial_sigma_m * share).max(spread.sigma_m.min(errors.sigma_m));
        errors.sigma_db = sigma_db.max(self.fit.min_sigma_db);
        let is_turned = self.turn(&errors, step_deg, steps)?;
        let mut moved = f64::INFINITY;
        for _ in 0..3 {
            let linear = self.linear()?;
            moved = self.improve(&linear, &errors)?;
            if moved < 0.2 {
                break;
            }
        }
        // The observed scatter is reached and nothing moves: narrower stages change nothing.
        let is_last =
            !is_turned && moved < 0.02 && errors.sigma_m > self.fit.initial_sigma_m * share;
        Ok(SearchResult::Spread { values: listed(&self.values), errors, is_last })
    }

    /// Log-posterior at the current values.
    pub(super) fn value(&self, linear: &LinearizedModel, errors: &ErrorModel) -> f64 {
        linear.log_likelihood(&self.still(), errors) + self.log_prior(&self.values)
    }

    /// Converges without phases, and with them if ranges allow it; returns the likelier optimum.
    pub(super) fn settle(&mut self, errors: ErrorModel) -> Result<Optimum, FitError> {
        let without = self.settled(errors)?;
        self.with_phases(without)
    }

    /// Returns `true` if ranges are too uncertain for phases, as in a room measured with a tape.
    pub(super) fn is_beyond_phases(&self, errors: &ErrorModel) -> bool {
        self.missed_wavelengths(errors) > MISSED
    }

    /// Range error in wavelengths.
    pub(super) fn missed_wavelengths(&self, errors: &ErrorModel) -> f64 {
        errors.sigma_m * self.start.sensor.frequency_hz / self.start.air.sound_speed_m_s()
    }

    /// Likelier of an optimum without phases and the one with phases that follows from it.
    pub(super) fn with_phases(&mut self, without: Optimum) -> Result<Optimum, FitError> {
        if self.is_beyond_phases(&without.errors) {
            return Ok(without);
        }
        (self.values, self.phases) = (without.values.clone(), Phases::Known);
        let with = self.settled(without.errors)?;
        Ok(if with.value > without.value { with } else { without })
    }

    /// Alternates between error model and values until the log-posterior converges.
    pub(super) fn settled(&mut self, from: ErrorModel) -> Result<Optimum, FitError> {
        let phases = self.phases;
        match self.found(|fitter| fitter.likeliest_here(from))? {
            SearchResult::End { values, errors, log_posterior } => Ok(Optimum {
                value: log_posterior,
                values: DVector::from_vec(values),
                errors,
                phases,
            }),
            _ => Err(FitError::OtherFit),
        }
    }

    /// Repeats an on-axis optimum with exact predictions: a thorough search refines it, a quick one
    /// makes one step. All later predictions are exact as well.
    pub(super) fn exactly(&mut self, end: Optimum) -> Result<Optimum, FitError> {
        (self.values, self.phases) = (end.values.clone(), end.phases);
        // The mounting may have changed since the start.
        if self.world()?.sensor.mounting.is_on_axis() {
            return Ok(end);
        }
        self.be_exact();
        if self.fit.search == Search::Quick {
            let exact = self.linear()?;
            self.improve(&exact, &end.errors)?;
            return Ok(Optimum { values: self.values.clone(), ..end });
        }
        let settled = self.settled(end.errors)?;
        self.polished(settled)
    }

    fn likeliest_here(&mut self, from: ErrorModel) -> Result<SearchResult, FitError> {
        let linear = self.linear()?;
        let mut errors = self.spread(&linear, &from);
        let mut best = (self.value(&linear, &errors), self.values.clone());
        let mut step = self.step_from(&linear, &errors)?;
        for number in 0..LAST_STEPS {
            // Without phases the optimum is preliminary: with them another point is likelier.
            let is_final = self.is_beyond_phases(&errors);
            if number >= FIRST_STEPS && !is_final {
                break;
            }
            self.values = self.limited(&best.1 + &step);
            // Prediction may fail, as within a wall.
            let linear = one_of_many(self.linear())?;
            let there = linear.map(|linear| {
                let spread = self.spread(&linear, &errors);
                (self.value(&linear, &spread), spread, linear)
            });
            match there {
                Some((value, spread, linear)) if value > best.0 + MIN_GAIN => {
                    (best, errors) = ((value, self.values.clone()), spread);
                    step = self.step_from(&linear, &errors)?;
                }
                // Too far: outside the validity of the linearization.
                _ if is_final && self.largest_share(&step) >= MIN_STEP => step *= SHORTER,
                _ => break,
            }
        }
        self.values = best.1;
        Ok(SearchResult::End { values: listed(&self.values), errors, log_posterior: best.0 })
    }

    /// Optimal step of the linearization from the current values.
    fn step_from(
        &mut self,
        linear: &LinearizedModel,
        errors: &ErrorModel,
    ) -> Result<DVector<f64>, FitError> {
        let from = self.values.clone();
        self.improve(linear, errors)?;
        Ok(&self.values - from)
    }
}

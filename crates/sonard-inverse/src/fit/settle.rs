//! The way to where a fit ends: from wide spreads of readings to the ones that they have.

use nalgebra::DVector;

use super::{
    FitError, Search, Settled, State,
    journal::{Found, listed},
    one_of_many,
};
use crate::{candidates::Phases, likelihood::ErrorModel, linear::Linear, watch::Progress};

/// Spreads that a fit goes through, as shares of the widest, with the spread of the threshold, decibels: from so wide
/// that it finds its way to what readings really spread by.
pub(super) const STAGES: [(f64, f64); 5] =
    [(1.0, 6.0), (0.5, 5.0), (0.25, 4.0), (0.12, 3.0), (0.06, 2.5)];
/// Steps at the end: as many where phases are asked for next, and as many as are tried where they are not.
const FIRST_STEPS: usize = 4;
const LAST_STEPS: usize = 12;
/// What becomes of a step that makes readings less likely, and how short it may become, as a share of
/// [`Parameter::step`](crate::parameter::Parameter::step).
const SHORTER: f64 = 0.3;
const LEAST_STEP: f64 = 0.003;
/// As much likelier, as a logarithm, is a place that is worth a step.
const LEAST_GAIN: f64 = 1e-3;
/// Turns that are tried at each of them, degrees, and how many to both sides.
const TURNS: [(f64, i32); STAGES.len()] = [(1.5, 8), (1.5, 8), (1.0, 10), (0.75, 12), (0.5, 10)];

/// Ranges that are missed by more than this, in wavelengths, say nothing of phases.
const MISSED: f64 = 0.5;

impl State<'_> {
    /// Goes from spread to spread, by some of the stages.
    pub(super) fn approach(
        &mut self,
        errors: &mut ErrorModel,
        stages: impl Iterator<Item = usize>,
    ) -> Result<(), FitError> {
        for stage in stages {
            let from = *errors;
            let found = self.found(|state| state.narrowed(from, stage))?;
            let Found::Spread { values, errors: narrowed, is_last } = found else {
                return Err(FitError::OtherFit);
            };
            (self.values, *errors) = (DVector::from_vec(values), narrowed);
            if is_last {
                break;
            }
        }
        Ok(())
    }

    /// Where it goes with the spread of a stage.
    fn narrowed(&mut self, mut errors: ErrorModel, stage: usize) -> Result<Found, FitError> {
        let ((share, sigma_db), (step_deg, steps)) = (STAGES[stage], TURNS[stage]);
        self.watch.progress(Progress::Approaching { spread: stage + 1, of: STAGES.len() });
        let steps = steps.min((self.fit.widest_turn_deg / step_deg) as i32);
        // Never narrower than what readings really spread by: else those few that happen to agree would be
        // believed and all others taken for clutter.
        let linear = self.linear()?;
        let spread = self.spread(&linear, &errors);
        errors.sigma_m = (self.fit.widest_m * share).max(spread.sigma_m.min(errors.sigma_m));
        errors.sigma_db = sigma_db.max(self.fit.least_sigma_db);
        let is_turned = self.turn(&errors, step_deg, steps)?;
        let mut moved = f64::INFINITY;
        for _ in 0..3 {
            let linear = self.linear()?;
            moved = self.improve(&linear, &errors)?;
            if moved < 0.2 {
                break;
            }
        }
        // What the readings spread by is reached, and nothing moves: narrower it does not get.
        let is_last = !is_turned && moved < 0.02 && errors.sigma_m > self.fit.widest_m * share;
        Ok(Found::Spread { values: listed(&self.values), errors, is_last })
    }

    /// Where it stands, as likely as that is.
    pub(super) fn value(&self, linear: &Linear, errors: &ErrorModel) -> f64 {
        linear.log_likelihood(&self.still(), errors) + self.log_prior(&self.values)
    }

    /// Settles without phases, and with them where ranges tell any; the likelier one counts.
    pub(super) fn settle(&mut self, errors: ErrorModel) -> Result<Settled, FitError> {
        let without = self.settled(errors)?;
        self.with_phases(without)
    }

    /// Whether ranges are missed by so much that lengths can't tell phases, as those of a room that was measured with a tape.
    pub(super) fn is_beyond_phases(&self, errors: &ErrorModel) -> bool {
        self.missed_wavelengths(errors) > MISSED
    }

    /// By how much ranges are missed, in wavelengths.
    pub(super) fn missed_wavelengths(&self, errors: &ErrorModel) -> f64 {
        errors.sigma_m * self.start.sensor.frequency_hz / self.start.air.sound_speed_m_s()
    }

    /// The likelier of two ends: without phases, and the one with them that follows from it.
    pub(super) fn with_phases(&mut self, without: Settled) -> Result<Settled, FitError> {
        if self.is_beyond_phases(&without.errors) {
            return Ok(without);
        }
        (self.values, self.phases) = (without.values.clone(), Phases::Known);
        let with = self.settled(without.errors)?;
        Ok(if with.value > without.value { with } else { without })
    }

    /// Finds the spread and the values in turn, as long as both get likelier.
    pub(super) fn settled(&mut self, from: ErrorModel) -> Result<Settled, FitError> {
        let phases = self.phases;
        match self.found(|state| state.likeliest_here(from))? {
            Found::End { values, errors, log_posterior } => Ok(Settled {
                value: log_posterior,
                values: DVector::from_vec(values),
                errors,
                phases,
            }),
            _ => Err(FitError::OtherFit),
        }
    }

    /// By exact predictions, where those from the axis have led: a thorough search polishes by them, a quick one makes a step. All
    /// that follow are exact, too.
    pub(super) fn exactly(&mut self, end: Settled) -> Result<Settled, FitError> {
        (self.values, self.phases) = (end.values.clone(), end.phases);
        // Where it stands, which need not be where it began.
        if self.world()?.sensor.mounting.is_on_axis() {
            return Ok(end);
        }
        self.be_exact();
        if self.fit.search == Search::Quick {
            let exact = self.linear()?;
            self.improve(&exact, &end.errors)?;
            return Ok(Settled { values: self.values.clone(), ..end });
        }
        let settled = self.settled(end.errors)?;
        self.polished(settled)
    }

    fn likeliest_here(&mut self, from: ErrorModel) -> Result<Found, FitError> {
        let linear = self.linear()?;
        let mut errors = self.spread(&linear, &from);
        let mut best = (self.value(&linear, &errors), self.values.clone());
        let mut step = self.step_from(&linear, &errors)?;
        for number in 0..LAST_STEPS {
            // What is found without phases need not be the last word: with them it is another place that is likeliest.
            let is_final = self.is_beyond_phases(&errors);
            if number >= FIRST_STEPS && !is_final {
                break;
            }
            self.values = self.limited(&best.1 + &step);
            // There may be nothing to predict with, as within a wall.
            let linear = one_of_many(self.linear())?;
            let there = linear.map(|linear| {
                let spread = self.spread(&linear, &errors);
                (self.value(&linear, &spread), spread, linear)
            });
            match there {
                Some((value, spread, linear)) if value > best.0 + LEAST_GAIN => {
                    (best, errors) = ((value, self.values.clone()), spread);
                    step = self.step_from(&linear, &errors)?;
                }
                // Too far: the predictions there are not those of the linearisation.
                _ if is_final && self.largest_share(&step) >= LEAST_STEP => step *= SHORTER,
                _ => break,
            }
        }
        self.values = best.1;
        Ok(Found::End { values: listed(&self.values), errors, log_posterior: best.0 })
    }

    /// Where the linearisation is best from here.
    fn step_from(
        &mut self,
        linear: &Linear,
        errors: &ErrorModel,
    ) -> Result<DVector<f64>, FitError> {
        let from = self.values.clone();
        self.improve(linear, errors)?;
        Ok(&self.values - from)
    }
}

//! The way to where a fit ends: from wide spreads of readings to the ones that they have.

use super::{FitError, Progress, Settled, State};
use crate::{candidates::Phases, likelihood::ErrorModel, linear::Linear};

/// Spreads that a fit goes through, as shares of the widest, with the spread of the threshold, decibels: from so wide
/// that it finds its way to what readings really spread by.
pub(super) const STAGES: [(f64, f64); 5] =
    [(1.0, 6.0), (0.5, 5.0), (0.25, 4.0), (0.12, 3.0), (0.06, 2.5)];
/// Improvements of the spread itself at the end.
const LAST_STAGES: usize = 5;
/// Turns that are tried at each of them, degrees, and how many to both sides.
const TURNS: [(f64, i32); STAGES.len()] = [(1.5, 8), (1.5, 8), (1.0, 10), (0.75, 12), (0.5, 10)];
impl State<'_> {
    /// Goes from spread to spread, and gives the predictions where that ends.
    pub(super) fn approach(
        &mut self,
        errors: &mut ErrorModel,
        stage: usize,
    ) -> Result<Linear, FitError> {
        let mut linear = self.linear(false)?;
        let stages = STAGES.into_iter().zip(TURNS).zip(1..).skip(stage);
        for (((share, sigma_db), (step_deg, steps)), spread) in stages {
            (self.watch)(Progress::Approaching { spread, of: STAGES.len() });
            let steps = steps.min((self.fit.widest_turn_deg / step_deg) as i32);
            // Never narrower than what readings really spread by: else those few that happen to agree would be
            // believed and all others taken for clutter.
            let spread = self.spread(&linear, errors);
            errors.sigma_m = (self.fit.widest_m * share).max(spread.sigma_m.min(errors.sigma_m));
            errors.sigma_db = sigma_db.max(self.fit.least_sigma_db);
            let is_turned = self.turn(errors, step_deg, steps)?;
            if is_turned {
                linear = self.linear(false)?;
            }
            let mut moved = f64::INFINITY;
            for _ in 0..3 {
                moved = self.improve(&linear, errors)?;
                linear = self.linear(false)?;
                if moved < 0.2 {
                    break;
                }
            }
            // What the readings spread by is reached, and nothing moves: narrower it does not get.
            if !is_turned && moved < 0.02 && errors.sigma_m > self.fit.widest_m * share {
                break;
            }
        }
        Ok(linear)
    }

    /// Where it stands, as likely as that is.
    pub(super) fn value(&self, linear: &Linear, errors: &ErrorModel) -> f64 {
        linear.log_likelihood(&self.still(), errors) + self.log_prior(&self.values)
    }

    /// Settles without phases, and with them; the likelier one counts.
    pub(super) fn settle(
        &mut self,
        linear: Linear,
        errors: ErrorModel,
    ) -> Result<Settled, FitError> {
        let without = self.settled(linear, errors)?;
        (self.values, self.phases) = (without.values.clone(), Phases::Known);
        let with = self.linear(false)?;
        let with = self.settled(with, without.errors)?;
        Ok(if with.value > without.value { with } else { without })
    }

    /// Finds the spread and the values in turn, as long as both get likelier.
    fn settled(&mut self, mut linear: Linear, mut errors: ErrorModel) -> Result<Settled, FitError> {
        let mut best: Option<Settled> = None;
        for _ in 0..LAST_STAGES {
            errors = self.spread(&linear, &errors);
            let (value, values) = (self.value(&linear, &errors), self.values.clone());
            if best.as_ref().is_some_and(|best| value <= best.value + 1e-3) {
                break;
            }
            best = Some(Settled { value, values, errors, phases: self.phases });
            self.improve(&linear, &errors)?;
            linear = self.linear(false)?;
        }
        best.ok_or(FitError::Degenerate)
    }
}

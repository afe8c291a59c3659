//! Refinement by random search with exact predictions, over the last tenths of a standard
//! deviation.
//!
//! The arrival of a weak echo, and the level of overlapping ones, change within tenths of a
//! millimetre. A linearization does not capture that: no further Levenberg-Marquardt step improves
//! the optimum, although some point nearby is better.

use nalgebra::{Cholesky, DVector};
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::{
    FitError, Fitter, Optimum,
    checkpoint::{SearchResult, listed},
    one_of_many,
};
use crate::{candidates::Phases, likelihood::ErrorModel};

/// Scan points on each side along the weakly constrained directions, and their distance in standard
/// deviations.
const SCANNED: (i32, f64) = (4, 1.0);
/// Number of random trials about the best of them.
const TRIED: usize = 60;
/// Upper bound on the gain in log-posterior by refinement.
pub(super) const FAR_BELOW: f64 = 30.0;
/// Initial step in standard deviations, and its factors after success and failure, for a success
/// rate of one in five (Rechenberg's rule for an evolution strategy of one parent and one child).
const STEP: f64 = 0.4;
const GROWS: f64 = 1.5;
const SHRINKS: f64 = 0.9;

impl Fitter<'_> {
    /// Refines an optimum with phases by random steps distributed as its covariance. Without phases
    /// the posterior is smooth: if that is far likelier, the optimum is returned unchanged.
    pub(super) fn polished(&mut self, end: Optimum) -> Result<Optimum, FitError> {
        if self.is_beyond_phases(&end.errors) {
            return Ok(end);
        }
        let with = match end.phases {
            Phases::Known => None,
            Phases::Unknown => {
                (self.values, self.phases) = (end.values.clone(), Phases::Known);
                let Some(with) = one_of_many(self.settled(end.errors))? else { return Ok(end) };
                Some(with)
            }
        };
        let from = with.as_ref().unwrap_or(&end);
        if from.value < end.value - FAR_BELOW {
            return Ok(end);
        }
        let found = self.found(|fitter| fitter.polish(from));
        let (values, errors, log_posterior) = match one_of_many(found)? {
            Some(SearchResult::End { values, errors, log_posterior }) => {
                (values, errors, log_posterior)
            }
            Some(_) => return Err(FitError::OtherFit),
            None => return Ok(end),
        };
        if log_posterior < end.value {
            return Ok(end);
        }
        let values = DVector::from_vec(values);
        Ok(Optimum { value: log_posterior, values, errors, phases: Phases::Known })
    }

    fn polish(&mut self, end: &Optimum) -> Result<SearchResult, FitError> {
        (self.values, self.phases) = (end.values.clone(), end.phases);
        let linear = self.linear()?;
        let mut errors = self.spread(&linear, &end.errors);
        let mut best = (self.value(&linear, &errors), self.values.clone());
        best = self.scanned(best, &errors)?;
        self.values = best.1.clone();
        let linear = self.linear()?;
        let curve = linear.curve(&self.still(), &errors.for_information());
        let covariance = self.covariance(curve.information).ok_or(FitError::Degenerate)?;
        let root = Cholesky::new(covariance).ok_or(FitError::Degenerate)?.unpack();
        let mut rng = Pcg64::seed_from_u64(1);
        let mut step = STEP;
        for _ in 0..TRIED {
            let normal = self.still().map(|_: f64| StandardNormal.sample(&mut rng));
            let longer: f64 = StandardNormal.sample(&mut rng);
            self.values = self.limited(&best.1 + step * longer.exp() * (&root * normal));
            // Prediction may fail, as within a wall.
            let Some(linear) = one_of_many(self.linear())? else { continue };
            let value = self.value(&linear, &errors);
            if value > best.0 {
                let spread = self.spread(&linear, &errors);
                let with_spread = self.value(&linear, &spread);
                if with_spread > value {
                    errors = spread;
                }
                best = (value.max(with_spread), self.values.clone());
                step *= GROWS;
            } else {
                step *= SHRINKS;
            }
        }
        let (log_posterior, values) = best;
        Ok(SearchResult::End { values: listed(&values), errors, log_posterior })
    }

    /// Best of some points along the weakly constrained directions, beyond the reach of the random
    /// steps, each improved once.
    fn scanned(
        &mut self,
        mut best: (f64, DVector<f64>),
        errors: &ErrorModel,
    ) -> Result<(f64, DVector<f64>), FitError> {
        let (places, apart) = SCANNED;
        let about = best.1.clone();
        for (direction, sigma) in self.weak_directions(&about, errors, Phases::Known)? {
            for place in (-places..=places).filter(|place| *place != 0) {
                let by = f64::from(place) * apart * sigma;
                self.values = self.limited(&about + by * &direction);
                let value = one_of_many(self.value_improved(errors))?;
                if let Some(value) = value.filter(|value| *value > best.0) {
                    best = (value, self.values.clone());
                }
            }
        }
        Ok(best)
    }

    /// Log-posterior after one improvement from the current values.
    fn value_improved(&mut self, errors: &ErrorModel) -> Result<f64, FitError> {
        let linear = self.linear()?;
        self.improve(&linear, errors)?;
        let linear = self.linear()?;
        Ok(self.value(&linear, errors))
    }
}

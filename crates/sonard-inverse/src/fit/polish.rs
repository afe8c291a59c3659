//! The last tenths of a standard deviation: where readings are likeliest by predictions that are made anew.
//!
//! Which arrival a weak echo is of, and how strong overlapping ones are together, changes from one tenth of a millimetre to
//! the next. A linearisation knows nothing of that, so a fit that goes by it ends about where it should, and no nearer:
//! from there no step of Levenberg's and Marquardt's is any better, though some place beside is.

use nalgebra::{Cholesky, DVector};
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::{
    FitError, Settled, State,
    journal::{Found, listed},
    one_of_many,
};
use crate::{candidates::Phases, likelihood::ErrorModel};

/// Places on each side along the directions that are held least, and how far apart, in standard deviations.
const SCANNED: (i32, f64) = (4, 1.0);
/// Predictions that are made about the best of them.
const TRIED: usize = 60;
/// More than polishing an end makes it likelier, as a logarithm.
pub(super) const FAR_BELOW: f64 = 30.0;
/// Steps to begin with, in standard deviations, and what becomes of them after one that is better, and one that is not:
/// as large as lets one in five be better (Rechenberg's rule for an evolution strategy of one parent and one child).
const STEP: f64 = 0.4;
const GROWS: f64 = 1.5;
const SHRINKS: f64 = 0.9;

impl State<'_> {
    /// The likeliest place of some that are tried about an end with phases, in steps that spread as its covariance does.
    /// Without phases nothing changes so quickly: where readings are far likelier so, the end stays where it is.
    pub(super) fn polished(&mut self, end: Settled) -> Result<Settled, FitError> {
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
        let found = self.found(|state| state.polish(from));
        let (values, errors, log_posterior) = match one_of_many(found)? {
            Some(Found::End { values, errors, log_posterior }) => (values, errors, log_posterior),
            Some(_) => return Err(FitError::OtherFit),
            None => return Ok(end),
        };
        if log_posterior < end.value {
            return Ok(end);
        }
        let values = DVector::from_vec(values);
        Ok(Settled { value: log_posterior, values, errors, phases: Phases::Known })
    }

    fn polish(&mut self, end: &Settled) -> Result<Found, FitError> {
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
            // There may be nothing to predict with, as within a wall.
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
        Ok(Found::End { values: listed(&values), errors, log_posterior })
    }

    /// The likeliest of some places along the directions that are held least, farther off than polishing goes, each
    /// improved once.
    fn scanned(
        &mut self,
        mut best: (f64, DVector<f64>),
        errors: &ErrorModel,
    ) -> Result<(f64, DVector<f64>), FitError> {
        let (places, apart) = SCANNED;
        let about = best.1.clone();
        for (direction, sigma) in self.doubtful(&about, errors, Phases::Known)? {
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

    /// How likely it is after one improvement from where it stands.
    fn value_improved(&mut self, errors: &ErrorModel) -> Result<f64, FitError> {
        let linear = self.linear()?;
        self.improve(&linear, errors)?;
        let linear = self.linear()?;
        Ok(self.value(&linear, errors))
    }
}

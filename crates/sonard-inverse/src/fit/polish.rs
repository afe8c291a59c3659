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
};
use crate::candidates::Phases;

/// Predictions that are made.
const TRIED: usize = 60;
/// Of a robot with a body.
const TRIED_OF_BODY: usize = 20;
/// Steps to begin with, in standard deviations, and what becomes of them after one that is better, and one that is not:
/// as large as lets one in five be better (Rechenberg's rule for an evolution strategy of one parent and one child).
const STEP: f64 = 0.4;
const GROWS: f64 = 1.5;
const SHRINKS: f64 = 0.9;

impl State<'_> {
    /// The likeliest place of some that are tried about an end, in steps that spread as its covariance does. Without
    /// phases nothing changes so quickly, and the end stays where it is.
    pub(super) fn polished(&mut self, end: Settled) -> Result<Settled, FitError> {
        let phases = end.phases;
        if phases == Phases::Unknown {
            return Ok(end);
        }
        match self.found(|state| state.polish(&end))? {
            Found::End { values, errors, log_posterior } => Ok(Settled {
                value: log_posterior,
                values: DVector::from_vec(values),
                errors,
                phases,
            }),
            _ => Err(FitError::OtherFit),
        }
    }

    fn polish(&mut self, end: &Settled) -> Result<Found, FitError> {
        (self.values, self.phases) = (end.values.clone(), end.phases);
        let linear = self.linear()?;
        let mut errors = self.spread(&linear, &end.errors);
        let mut best = (self.value(&linear, &errors), self.values.clone());
        let curve = linear.curve(&self.still(), &errors);
        let covariance = self.covariance(curve.information).ok_or(FitError::Degenerate)?;
        let root = Cholesky::new(covariance).ok_or(FitError::Degenerate)?.unpack();
        let mut rng = Pcg64::seed_from_u64(1);
        let mut step = STEP;
        let tried = if self.start.scene.robot.is_some() { TRIED_OF_BODY } else { TRIED };
        for _ in 0..tried {
            let normal = self.still().map(|_: f64| StandardNormal.sample(&mut rng));
            self.values = self.limited(&best.1 + step * (&root * normal));
            let linear = self.linear()?;
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
}

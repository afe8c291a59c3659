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
    FitError, Fitter, Optimum, Point,
    checkpoint::{SearchResult, listed},
    lm_step::Improved,
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
    pub(super) fn refine(&self, optimum: Optimum) -> Result<Optimum, FitError> {
        if self.problem.is_beyond_phases(&optimum.errors) {
            return Ok(optimum);
        }
        let coherent = match optimum.point.phases {
            Phases::Known => None,
            Phases::Unknown => {
                let point = optimum.point.with_phases(Phases::Known);
                let Some(coherent) = one_of_many(self.converge(&point, optimum.errors))? else {
                    return Ok(optimum);
                };
                Some(coherent)
            }
        };
        let from = coherent.as_ref().unwrap_or(&optimum);
        if from.value < optimum.value - FAR_BELOW {
            return Ok(optimum);
        }
        let found = self.run_or_replay(|| self.search_randomly(from));
        let (values, errors, log_posterior) = match one_of_many(found)? {
            Some(SearchResult::End { values, errors, log_posterior }) => {
                (values, errors, log_posterior)
            }
            Some(_) => return Err(FitError::OtherFit),
            None => return Ok(optimum),
        };
        if log_posterior < optimum.value {
            return Ok(optimum);
        }
        let point = from.point.moved_to(DVector::from_vec(values));
        Ok(Optimum { value: log_posterior, point, errors })
    }

    fn search_randomly(&self, optimum: &Optimum) -> Result<SearchResult, FitError> {
        let problem = &self.problem;
        let linear = self.linearize(&optimum.point)?;
        let mut errors = self.estimate_errors(&linear, &optimum.errors);
        let value = self.log_posterior(&linear, &optimum.point, &errors);
        let mut best = self.scan_weak_directions((value, optimum.point.clone()), &errors)?;
        let linear = self.linearize(&best.1)?;
        let curve = linear.curve(&problem.zero(), &errors.for_information());
        let covariance = problem.covariance(curve.information)?;
        let root = Cholesky::new(covariance).ok_or(FitError::Degenerate)?.unpack();
        let mut rng = Pcg64::seed_from_u64(1);
        let mut step = STEP;
        for _ in 0..TRIED {
            let normal = problem.zero().map(|_: f64| StandardNormal.sample(&mut rng));
            let longer: f64 = StandardNormal.sample(&mut rng);
            let values = &best.1.values + step * longer.exp() * (&root * normal);
            let point = best.1.moved_to(problem.limited(values));
            // Prediction may fail, as within a wall.
            let Some(linear) = one_of_many(self.linearize(&point))? else { continue };
            let value = self.log_posterior(&linear, &point, &errors);
            if value > best.0 {
                let scatter = self.estimate_errors(&linear, &errors);
                let with_scatter = self.log_posterior(&linear, &point, &scatter);
                if with_scatter > value {
                    errors = scatter;
                }
                best = (value.max(with_scatter), point);
                step *= GROWS;
            } else {
                step *= SHRINKS;
            }
        }
        let (log_posterior, Point { values, .. }) = best;
        Ok(SearchResult::End { values: listed(&values), errors, log_posterior })
    }

    /// Best of some points along the weakly constrained directions, beyond the reach of the random
    /// steps, each improved once; with their log-posteriors.
    fn scan_weak_directions(
        &self,
        mut best: (f64, Point),
        errors: &ErrorModel,
    ) -> Result<(f64, Point), FitError> {
        let (places, apart) = SCANNED;
        let about = best.1.clone();
        for (direction, sigma) in self.weak_directions(&about, errors)? {
            for place in (-places..=places).filter(|place| *place != 0) {
                let by = f64::from(place) * apart * sigma;
                let values = self.problem.limited(&about.values + by * &direction);
                let improved = one_of_many(self.improve_once(&about.moved_to(values), errors))?;
                if let Some(improved) = improved.filter(|(value, _)| *value > best.0) {
                    best = improved;
                }
            }
        }
        Ok(best)
    }

    /// Point after one improvement, with its log-posterior.
    fn improve_once(&self, point: &Point, errors: &ErrorModel) -> Result<(f64, Point), FitError> {
        let linear = self.linearize(point)?;
        let Improved { point, .. } = self.improve(&linear, point, errors, None)?;
        let linear = self.linearize(&point)?;
        Ok((self.log_posterior(&linear, &point, errors), point))
    }
}

//! Multi-start: starts away from the prior mean, for fits that failed and for sweeps with few
//! echoes.

use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::{
    FitError, Fitter, Optimum, Point, Search, one_of_many,
    perturbation::{ROUGH, StartPoint, widened},
};
use crate::likelihood::ErrorModel;

/// Criteria of a failed fit: maximum fraction of unexplained readings, and maximum deviation from
/// the prior in standard deviations.
const FAILED: (f64, f64) = (0.03, 3.5);
/// Distance of restarts of a failed fit, in standard deviations of the rough information.
const RESTART_SIGMAS: f64 = 1.5;
/// Number of starts drawn from the prior.
const DRAWN: usize = 48;
/// Fraction of readings in outlier arcs assumed for drawn starts.
const DRAWN_ARCS: f64 = 0.3;
/// Number of drawn starts that are followed, and their first stage.
const DRAWN_FOLLOWED: usize = 4;
const DRAWN_STAGE: usize = 3;
/// Number of starts drawn for a sweep with few echoes, and followed with phases.
const DRAWN_OPEN: usize = 192;
const DRAWN_FOLLOWED_OPEN: usize = 12;

impl Fitter<'_> {
    /// Returns `true` if a fit failed: it leaves readings unexplained, or contradicts the priors.
    pub(super) fn is_failed(&self, optimum: &Optimum) -> bool {
        let (unexplained, sigmas) = FAILED;
        let values = &optimum.point.values;
        let contradicts = values.component_div(&self.problem.prior_sigmas()).amax() > sigmas;
        contradicts || optimum.errors.explained() < 1.0 - unexplained
    }

    /// Optima from starts away from the prior mean. If echoes are few and weak, their levels depend
    /// on phases: without phases a fit leaves even the true pose.
    pub(super) fn restart_elsewhere(&self) -> Result<Vec<Optimum>, FitError> {
        let (problem, errors) = (&self.problem, self.problem.rough_errors());
        let weak = self.weak_directions(&Point::incoherent(problem.zero()), &errors)?;
        let sides = weak.into_iter().flat_map(|(direction, sigma)| {
            [-RESTART_SIGMAS, RESTART_SIGMAS].map(|side| side * sigma * &direction)
        });
        let mut starts: Vec<_> = sides.map(|start| (problem.limited(start), 0)).collect();
        let drawn = self.draw_starts()?;
        let followed = drawn.iter().take(DRAWN_FOLLOWED);
        starts.extend(followed.map(|start| (start.values.clone(), DRAWN_STAGE)));
        let mut optima: Vec<Optimum> = Vec::new();
        for (start, stage) in starts {
            optima.extend(one_of_many(self.fit_from_stage(start, stage))?);
        }
        if problem.has_few_echoes() {
            for start in drawn.into_iter().take(DRAWN_FOLLOWED_OPEN) {
                optima.extend(self.converge_with_phases(start.values, &errors)?);
            }
        }
        Ok(optima)
    }

    /// Improved starts drawn from the prior, likeliest first. Where an unmodelled object returns
    /// most beams, a wide error model leads to it and not to the walls from any start. None are
    /// drawn for several sweeps, since each could fail by itself.
    fn draw_starts(&self) -> Result<Vec<StartPoint>, FitError> {
        let problem = &self.problem;
        let search = problem.options.search;
        if problem.sweeps.len() > 1 || search == Search::Quick {
            return Ok(Vec::new());
        }
        let arcs = if search == Search::Furnished { DRAWN_ARCS } else { 0.0 };
        let errors =
            ErrorModel { outlier_arc_share: arcs, ..widened(&problem.rough_errors(), ROUGH) };
        let errors = ErrorModel { sigma_m: ROUGH.0, sigma_db: ROUGH.1, ..errors };
        let mut rng = Pcg64::seed_from_u64(1);
        let sigmas = problem.prior_sigmas();
        let mut tried: Vec<StartPoint> = Vec::new();
        let drawn = if problem.has_few_echoes() { DRAWN_OPEN } else { DRAWN };
        for number in 0..drawn {
            let normal = sigmas.map(|_: f64| StandardNormal.sample(&mut rng));
            let start = Point::incoherent(problem.limited(sigmas.component_mul(&normal)));
            tried.extend(self.improve_start(&start, &errors, (number + 1, drawn))?);
        }
        Ok(problem.distinct(tried, &[]))
    }
}

//! Multi-start: starts away from the prior mean, for fits that failed and for sweeps with few
//! echoes.

use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::{
    FitError, Fitter, Optimum, Search, one_of_many,
    perturbation::{ROUGH, StartPoint, widened},
};
use crate::{candidates::Phases, likelihood::ErrorModel};

/// Criteria of a failed fit: maximum fraction of unexplained readings, and maximum deviation from
/// the prior in standard deviations.
const ASTRAY: (f64, f64) = (0.03, 3.5);
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
    pub(super) fn is_astray(&self, end: &Optimum) -> bool {
        let (unexplained, sigmas) = ASTRAY;
        let contradicts = end.values.component_div(&self.prior_sigmas()).amax() > sigmas;
        contradicts || end.errors.explained() < 1.0 - unexplained
    }

    /// Returns `true` if a single sweep with few echoes is fitted, which fits many poses.
    pub(super) fn has_few_echoes(&self) -> bool {
        matches!(self.sweeps, [sweep] if sweep.has_few_echoes()) && self.fit.search != Search::Quick
    }

    /// Optima from starts away from the prior mean. If echoes are few and weak, their levels depend
    /// on phases: without phases a fit leaves even the true pose.
    pub(super) fn ends_from_elsewhere(&mut self) -> Result<Vec<Optimum>, FitError> {
        let weak = self.weak_directions(&self.still(), &self.rough_errors(), Phases::Unknown)?;
        let sides = weak.into_iter().flat_map(|(direction, sigma)| {
            [-RESTART_SIGMAS, RESTART_SIGMAS].map(|side| side * sigma * &direction)
        });
        let mut beginnings: Vec<_> = sides.map(|start| (self.limited(start), 0)).collect();
        let drawn = self.drawn()?;
        let followed = drawn.iter().take(DRAWN_FOLLOWED);
        beginnings.extend(followed.map(|place| (place.values.clone(), DRAWN_STAGE)));
        let mut ends: Vec<Optimum> = Vec::new();
        for (start, stage) in beginnings {
            ends.extend(one_of_many(self.attempt(start, stage))?);
        }
        if self.has_few_echoes() {
            let errors = self.rough_errors();
            for place in drawn.into_iter().take(DRAWN_FOLLOWED_OPEN) {
                ends.extend(self.end_with_phases(place.values, &errors)?);
            }
        }
        Ok(ends)
    }

    /// Improved starts drawn from the prior, likeliest first. Where an unmodelled object returns
    /// most beams, a wide error model leads to it and not to the walls from any start. None are
    /// drawn for several sweeps, since each could fail by itself.
    fn drawn(&mut self) -> Result<Vec<StartPoint>, FitError> {
        if self.sweeps.len() > 1 || self.fit.search == Search::Quick {
            return Ok(Vec::new());
        }
        let arcs = if self.fit.search == Search::Furnished { DRAWN_ARCS } else { 0.0 };
        let errors = ErrorModel { outlier_arc_share: arcs, ..widened(&self.rough_errors(), ROUGH) };
        let errors = ErrorModel { sigma_m: ROUGH.0, sigma_db: ROUGH.1, ..errors };
        let mut rng = Pcg64::seed_from_u64(1);
        let sigmas = self.prior_sigmas();
        let mut tried: Vec<StartPoint> = Vec::new();
        let drawn = if self.has_few_echoes() { DRAWN_OPEN } else { DRAWN };
        for number in 0..drawn {
            let normal = sigmas.map(|_: f64| StandardNormal.sample(&mut rng));
            let start = self.limited(sigmas.component_mul(&normal));
            self.phases = Phases::Unknown;
            tried.extend(self.place(start, &errors, (number + 1, drawn))?);
        }
        Ok(self.distinct(tried, &[]))
    }
}

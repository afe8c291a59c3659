//! Beginnings elsewhere than at what was believed, for fits that went astray and for sweeps that heard little.

use rand::SeedableRng as _;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::{
    FitError, Search, Settled, State, one_of_many,
    restart::{Place, ROUGH, widened},
};
use crate::{candidates::Phases, likelihood::ErrorModel};

/// A fit has gone astray that explains less than all readings but this share, or contradicts what was believed by
/// this many standard deviations.
const ASTRAY: (f64, f64) = (0.03, 3.5);
/// Beginnings anew of such a one: to both sides, in standard deviations of what a first look leaves in doubt.
const ANEW: f64 = 1.5;
/// Further ones, drawn from what was believed: how many, with which share of readings in arcs of something else they are looked
/// at, how many are followed, and from which stage on.
const DRAWN: usize = 48;
const DRAWN_ARCS: f64 = 0.3;
const DRAWN_FOLLOWED: usize = 4;
const DRAWN_STAGE: usize = 3;
/// How many are drawn where a sweep heard little, and followed with phases.
const DRAWN_OPEN: usize = 192;
const DRAWN_FOLLOWED_OPEN: usize = 12;

impl State<'_> {
    pub(super) fn is_astray(&self, end: &Settled) -> bool {
        let (unexplained, sigmas) = ASTRAY;
        let contradicts = end.values.component_div(&self.prior_sigmas()).amax() > sigmas;
        contradicts || end.errors.explained() < 1.0 - unexplained
    }

    /// Whether one sweep is fitted that heard little, which may have been taken elsewhere.
    pub(super) fn hears_little(&self) -> bool {
        matches!(self.sweeps, [sweep] if sweep.hears_little()) && self.fit.search != Search::Quick
    }

    /// Where fits end that begin elsewhere than at what was believed. Of few echoes, all of them weak, most are as strong as the
    /// phases make them that arrivals meet with: without phases a fit leaves the truth itself.
    pub(super) fn ends_from_elsewhere(&mut self) -> Result<Vec<Settled>, FitError> {
        let doubtful = self.doubtful(&self.still(), &self.rough_errors(), Phases::Unknown)?;
        let sides = doubtful
            .into_iter()
            .flat_map(|(direction, sigma)| [-ANEW, ANEW].map(|side| side * sigma * &direction));
        let mut beginnings: Vec<_> = sides.map(|start| (self.limited(start), 0)).collect();
        let drawn = self.drawn()?;
        let followed = drawn.iter().take(DRAWN_FOLLOWED);
        beginnings.extend(followed.map(|place| (place.values.clone(), DRAWN_STAGE)));
        let mut ends: Vec<Settled> = Vec::new();
        for (start, stage) in beginnings {
            ends.extend(one_of_many(self.attempt(start, stage))?);
        }
        if self.hears_little() {
            let errors = self.rough_errors();
            for place in drawn.into_iter().take(DRAWN_FOLLOWED_OPEN) {
                ends.extend(self.end_with_phases(place.values, &errors)?);
            }
        }
        Ok(ends)
    }

    /// Of places drawn from what was believed, each improved, the likeliest: where an unmodelled thing answers most beams, wide
    /// spreads of readings lead to it and not to the walls, from wherever one begins. Of many sweeps none are drawn: each could be
    /// astray by itself.
    fn drawn(&mut self) -> Result<Vec<Place>, FitError> {
        if self.sweeps.len() > 1 || self.fit.search == Search::Quick {
            return Ok(Vec::new());
        }
        let arcs = if self.fit.search == Search::Furnished { DRAWN_ARCS } else { 0.0 };
        let errors = ErrorModel { arcs, ..widened(&self.rough_errors(), ROUGH) };
        let errors = ErrorModel { sigma_m: ROUGH.0, sigma_db: ROUGH.1, ..errors };
        let mut rng = Pcg64::seed_from_u64(1);
        let sigmas = self.prior_sigmas();
        let mut tried: Vec<Place> = Vec::new();
        let drawn = if self.hears_little() { DRAWN_OPEN } else { DRAWN };
        for number in 0..drawn {
            let normal = sigmas.map(|_: f64| StandardNormal.sample(&mut rng));
            let start = self.limited(sigmas.component_mul(&normal));
            self.phases = Phases::Unknown;
            tried.extend(self.place(start, &errors, (number + 1, drawn))?);
        }
        Ok(self.distinct(tried, &[]))
    }
}

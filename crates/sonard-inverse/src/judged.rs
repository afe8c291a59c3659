//! A reading beside all that could have been reported, and how likely it is.

use nalgebra::DVector;
use smallvec::SmallVec;

use crate::{
    likelihood::{ErrorModel, normal_density, normal_up_to},
    sweep::Outcome,
    walk::TimeWalk,
};

/// What a number gains for each unit of some of the parameters.
pub(crate) type Rates = SmallVec<[(u32, f64); 4]>;

/// One of the readings that a firing could have had.
#[derive(Debug, Clone)]
pub(crate) struct Possible {
    /// With an echo's range where it reaches `margin_db` above the threshold.
    pub(crate) outcome: Outcome,
    /// Infinite if its range does not move with the threshold.
    pub(crate) margin_db: f64,
    pub(crate) range_rates: Rates,
    /// The threshold up to which it is, decibels above the nominal one.
    pub(crate) until_db: f64,
    pub(crate) until_rates: Rates,
    /// Standard deviation of that beside the threshold's own, decibels.
    pub(crate) spread_db: f64,
    /// Mirror reflections after the first, each of which may add to that.
    pub(crate) further_reflections: f64,
}

/// One of the possible readings as it is expected where it is told: by thresholds that vary, but not beyond what bounds it.
#[derive(Clone, Copy)]
pub(crate) struct Expected {
    /// Metres at the reference speed of sound.
    pub(crate) range_m: f64,
    /// What that gains with the threshold up to which it is, metres a decibel (time walk); in the rates only where ranges are
    /// known well enough.
    pub(crate) by_until_m: f64,
    is_walk_believed: bool,
    /// Standard deviation, metres: a threshold in doubt makes the range of a weak echo doubtful, too.
    pub(crate) sigma_m: f64,
}

/// A reading beside what it could have been.
#[derive(Debug, Clone)]
pub(crate) struct Judged {
    pub(crate) heard: Outcome,
    pub(crate) possible: SmallVec<[Possible; 2]>,
}

/// A reading's density and its derivatives, if it is in no arc of something else.
pub(crate) struct Terms {
    pub(crate) density: f64,
    /// Probability that the scene does not explain it.
    pub(crate) unexplained: f64,
    pub(crate) of: SmallVec<[Term; 3]>,
}

/// What one of the possible readings has to do with it.
pub(crate) struct Term {
    /// Of an echo, where one was heard.
    pub(crate) expected: Option<Expected>,
    /// Probability that the reading is this one.
    pub(crate) share: f64,
    /// Derivative of the log-density by its range.
    pub(crate) by_range: f64,
    /// By the threshold up to which it is, its range left as it is.
    pub(crate) by_until: f64,
    /// What a reading is expected to say about that threshold, as information.
    pub(crate) expected_of_until: f64,
}

impl Possible {
    /// As it is expected after a change of the parameters, up to a threshold and from the one up to which another reading is;
    /// `None` of what is no echo.
    pub(crate) fn expected(
        &self,
        change: &DVector<f64>,
        [from_db, until_db]: [f64; 2],
        errors: &ErrorModel,
        walk: &TimeWalk,
    ) -> Option<Expected> {
        let range_m = after(self.outcome.range_m()?, &self.range_rates, change);
        if self.margin_db.is_infinite() {
            let (by_until_m, sigma_m) = (0.0, errors.sigma_m);
            return Some(Expected { range_m, by_until_m, is_walk_believed: false, sigma_m });
        }
        let is_walk_believed = walk.is_believed(errors.sigma_m);
        let until_db = if is_walk_believed { until_db } else { self.until_db };
        let late = walk.expected([from_db, until_db], self.sigma_db(errors), errors.sigma_m);
        let [told_m, _] = walk.at(self.margin_db);
        Some(Expected {
            range_m: range_m + late.mean_m - told_m,
            by_until_m: late.by_until_m,
            is_walk_believed,
            sigma_m: errors.sigma_m.hypot(late.sigma_m),
        })
    }

    /// What its range gains with the parameters, as it is expected: what is louder, or heard at a lower threshold, is earlier.
    pub(crate) fn rates_with_walk(&self, expected: &Expected) -> Rates {
        let mut rates = self.range_rates.clone();
        if !expected.is_walk_believed {
            return rates;
        }
        for &(at, by_db) in &self.until_rates {
            let by_m = expected.by_until_m * by_db;
            match rates.iter_mut().find(|(known, _)| *known == at) {
                Some((_, rate)) => *rate += by_m,
                None => rates.push((at, by_m)),
            }
        }
        rates
    }

    /// Standard deviation of the threshold up to which it is, decibels.
    fn sigma_db(&self, errors: &ErrorModel) -> f64 {
        let by_reflections_db = errors.sigma_db_per_reflection * self.further_reflections;
        errors.sigma_db.hypot(self.spread_db).hypot(by_reflections_db)
    }
}

impl Expected {
    /// What its range says beside that of a strong echo, 0 to 1.
    pub(crate) fn certainty(&self, errors: &ErrorModel) -> f64 {
        (errors.sigma_m / self.sigma_m).powi(2)
    }
}

impl Judged {
    /// How likely the reading is after a change of the parameters.
    pub(crate) fn terms(
        &self,
        change: &DVector<f64>,
        errors: &ErrorModel,
        walk: &TimeWalk,
    ) -> Terms {
        let explained = 1.0 - errors.clutter;
        let unexplained = errors.clutter * errors.of_clutter(self.heard);
        let untils_db: SmallVec<[f64; 3]> = self
            .possible
            .iter()
            .map(|possible| after(possible.until_db, &possible.until_rates, change))
            .collect();
        // Where an echo is expected says nothing of what is none.
        let expected: SmallVec<[Option<Expected>; 3]> = self
            .possible
            .iter()
            .enumerate()
            .map(|(at, possible)| {
                let from_db = at.checked_sub(1).map_or(f64::NEG_INFINITY, |last| untils_db[last]);
                self.heard.range_m()?;
                possible.expected(change, [from_db, untils_db[at]], errors, walk)
            })
            .collect();
        // Density of the reading if it is this one, and its derivative by the range.
        let densities: SmallVec<[[f64; 2]; 3]> = self
            .possible
            .iter()
            .zip(&expected)
            .map(|(possible, expected)| match (self.heard.range_m(), expected) {
                (Some(heard_m), Some(expected)) => {
                    let spread = errors.with_range_spread(expected.sigma_m);
                    let [density, slope] = spread.range(heard_m - expected.range_m);
                    [density, -slope]
                }
                (None, _) if possible.outcome == self.heard => [1.0, 0.0],
                _ => [0.0, 0.0],
            })
            .collect();
        let mut below = 0.0;
        let mut density = unexplained;
        let mut of: SmallVec<[Term; 3]> = SmallVec::new();
        for (at, (possible, &[own, slope])) in self.possible.iter().zip(&densities).enumerate() {
            let is_last = at + 1 == self.possible.len();
            let sigma_db = possible.sigma_db(errors);
            let until = untils_db[at] / sigma_db;
            let up_to = if is_last { 1.0 } else { normal_up_to(until).max(below) };
            let probability = up_to - below;
            below = up_to;
            let gain = if is_last { 0.0 } else { own - densities[at + 1][0] };
            let by_until = explained * normal_density(until) / sigma_db * gain;
            density += explained * probability * own;
            of.push(Term {
                expected: expected[at],
                share: explained * probability * own,
                by_range: explained * probability * slope,
                by_until: if by_until.is_finite() { by_until } else { 0.0 },
                expected_of_until: match is_last {
                    true => 0.0,
                    false => {
                        explained * expected_of_step(until) * self.distinct(at, errors.sigma_m)
                            / sigma_db.powi(2)
                    }
                },
            });
        }
        for term in &mut of {
            term.share /= density;
            term.by_range /= density;
            term.by_until /= density;
        }
        Terms { density, unexplained: unexplained / density, of }
    }

    /// The range of an echo less that of its likeliest explanation, with the probability that it is the right one, where the
    /// reading is of the scene with some probability.
    pub(crate) fn residual(&self, terms: &Terms, of_scene: f64) -> Option<(f64, f64)> {
        let best = (0..self.possible.len())
            .max_by(|&one, &other| terms.of[one].share.total_cmp(&terms.of[other].share))?;
        let term = &terms.of[best];
        Some((self.heard.range_m()? - term.expected?.range_m, of_scene * term.share))
    }

    /// How well one of the possible readings can be told from the next, from 0 to 1.
    fn distinct(&self, at: usize, sigma_m: f64) -> f64 {
        let [one, other] = [at, at + 1].map(|at| self.possible[at].outcome);
        match one.range_m().zip(other.range_m()) {
            Some((one_m, other_m)) => 1.0 - (-((one_m - other_m) / sigma_m).powi(2) / 8.0).exp(),
            None if one == other => 0.0,
            None => 1.0,
        }
    }
}

/// A value after a change of the parameters.
fn after(value: f64, rates: &Rates, change: &DVector<f64>) -> f64 {
    value + rates.iter().map(|&(at, rate)| rate * change[at as usize]).sum::<f64>()
}

/// What one reading, of either side of a step of the probability at `place` standard deviations, is expected to say
/// about the step's place: `density^2 / (up_to (1 - up_to))`.
fn expected_of_step(place: f64) -> f64 {
    let up_to = normal_up_to(place);
    let spread = up_to * (1.0 - up_to);
    if spread > 1e-12 { normal_density(place).powi(2) / spread } else { 0.0 }
}

//! Likelihood of one reading given its candidate readings.

use nalgebra::DVector;
use smallvec::SmallVec;

use crate::{
    likelihood::{ErrorModel, normal_density, normal_up_to},
    sweep::RangeOutcome,
    time_walk::TimeWalk,
};

/// Derivatives of a quantity with respect to some parameters, as a sparse row of the Jacobian.
pub(crate) type SparseRow = SmallVec<[(u32, f64); 4]>;

/// Candidate reading of a firing.
#[derive(Debug, Clone)]
pub(crate) struct CandidateReading {
    /// Outcome; the range of an echo is evaluated at `margin_db` above the threshold.
    pub(crate) outcome: RangeOutcome,
    /// Margin above the threshold, decibels; infinite if the range does not depend on the
    /// threshold.
    pub(crate) margin_db: f64,
    pub(crate) range_rates: SparseRow,
    /// Upper end of the threshold interval, decibels above the nominal threshold.
    pub(crate) until_db: f64,
    pub(crate) until_rates: SparseRow,
    /// Standard deviation of that end in addition to the threshold's own, decibels.
    pub(crate) spread_db: f64,
    /// Number of mirror reflections after the first, each of which may add to that.
    pub(crate) further_reflections: f64,
}

/// Expected range of a candidate over the thresholds at which it is reported.
#[derive(Clone, Copy)]
pub(crate) struct ExpectedRange {
    /// Expected range, metres at the reference speed of sound.
    pub(crate) range_m: f64,
    /// Derivative by the upper end of the threshold interval, m/dB (time walk); part of the
    /// Jacobian only if ranges are accurate enough.
    pub(crate) by_until_m: f64,
    is_walk_believed: bool,
    /// Standard deviation, metres, including the effect of an uncertain threshold on a weak echo.
    pub(crate) sigma_m: f64,
}

/// Measured reading with its candidates.
#[derive(Debug, Clone)]
pub(crate) struct ReadingModel {
    pub(crate) measured: RangeOutcome,
    pub(crate) possible: SmallVec<[CandidateReading; 2]>,
}

/// Density of a reading outside outlier arcs, with derivatives.
pub(crate) struct LikelihoodTerms {
    pub(crate) density: f64,
    /// Posterior probability of a single outlier.
    pub(crate) unexplained: f64,
    pub(crate) of: SmallVec<[CandidateTerm; 3]>,
}

/// Contribution of one candidate.
pub(crate) struct CandidateTerm {
    /// Expected range, if an echo was measured.
    pub(crate) expected: Option<ExpectedRange>,
    /// Posterior probability of the candidate.
    pub(crate) share: f64,
    /// Derivative of the log-density by the range.
    pub(crate) by_range: f64,
    /// Derivative of the log-density by the upper end of the threshold interval, at constant range.
    pub(crate) by_until: f64,
    /// Expected information on that end.
    pub(crate) expected_of_until: f64,
}

impl CandidateReading {
    /// Expected range after a change of the parameters, for a threshold interval; `None`
    /// without echo.
    pub(crate) fn expected(
        &self,
        change: &DVector<f64>,
        [from_db, until_db]: [f64; 2],
        errors: &ErrorModel,
        walk: &TimeWalk,
    ) -> Option<ExpectedRange> {
        let range_m = after(self.outcome.range_m()?, &self.range_rates, change);
        if self.margin_db.is_infinite() {
            let (by_until_m, sigma_m) = (0.0, errors.sigma_m);
            return Some(ExpectedRange { range_m, by_until_m, is_walk_believed: false, sigma_m });
        }
        let is_walk_believed = walk.is_believed(errors.sigma_m);
        let until_db = if is_walk_believed { until_db } else { self.until_db };
        let late = walk.expected([from_db, until_db], self.sigma_db(errors), errors.sigma_m);
        let [evaluated_m, _] = walk.at(self.margin_db);
        Some(ExpectedRange {
            range_m: range_m + late.mean_m - evaluated_m,
            by_until_m: late.by_until_m,
            is_walk_believed,
            sigma_m: errors.sigma_m.hypot(late.sigma_m),
        })
    }

    /// Derivatives of the expected range including time walk: a stronger echo is detected earlier.
    pub(crate) fn rates_with_walk(&self, expected: &ExpectedRange) -> SparseRow {
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

    /// Standard deviation of the upper end of the threshold interval, decibels.
    fn sigma_db(&self, errors: &ErrorModel) -> f64 {
        let by_reflections_db = errors.sigma_db_per_reflection * self.further_reflections;
        errors.sigma_db.hypot(self.spread_db).hypot(by_reflections_db)
    }
}

impl ExpectedRange {
    /// Information of the range relative to that of a strong echo, 0 to 1.
    pub(crate) fn certainty(&self, errors: &ErrorModel) -> f64 {
        (errors.sigma_m / self.sigma_m).powi(2)
    }
}

impl ReadingModel {
    /// Density and derivatives after a change of the parameters.
    pub(crate) fn terms(
        &self,
        change: &DVector<f64>,
        errors: &ErrorModel,
        walk: &TimeWalk,
    ) -> LikelihoodTerms {
        let explained = 1.0 - errors.outlier_share;
        let unexplained = errors.outlier_share * errors.of_clutter(self.measured);
        let untils_db: SmallVec<[f64; 3]> = self
            .possible
            .iter()
            .map(|possible| after(possible.until_db, &possible.until_rates, change))
            .collect();
        // Expected ranges matter only for a measured echo.
        let expected: SmallVec<[Option<ExpectedRange>; 3]> = self
            .possible
            .iter()
            .enumerate()
            .map(|(at, possible)| {
                let from_db = at.checked_sub(1).map_or(f64::NEG_INFINITY, |last| untils_db[last]);
                self.measured.range_m()?;
                possible.expected(change, [from_db, untils_db[at]], errors, walk)
            })
            .collect();
        // Density of the reading given each candidate, and its derivative by the range.
        let densities: SmallVec<[[f64; 2]; 3]> = self
            .possible
            .iter()
            .zip(&expected)
            .map(|(possible, expected)| match (self.measured.range_m(), expected) {
                (Some(measured_m), Some(expected)) => {
                    let spread = errors.with_range_spread(expected.sigma_m);
                    let [density, slope] = spread.range(measured_m - expected.range_m);
                    [density, -slope]
                }
                (None, _) if possible.outcome == self.measured => [1.0, 0.0],
                _ => [0.0, 0.0],
            })
            .collect();
        let mut below = 0.0;
        let mut density = unexplained;
        let mut of: SmallVec<[CandidateTerm; 3]> = SmallVec::new();
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
            of.push(CandidateTerm {
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
        LikelihoodTerms { density, unexplained: unexplained / density, of }
    }

    /// Residual of an echo from its likeliest candidate, metres, with the posterior probability of
    /// that; `of_scene` is the probability of the scene state.
    pub(crate) fn residual(&self, terms: &LikelihoodTerms, of_scene: f64) -> Option<(f64, f64)> {
        let best = (0..self.possible.len())
            .max_by(|&a, &b| terms.of[a].share.total_cmp(&terms.of[b].share))?;
        let term = &terms.of[best];
        Some((self.measured.range_m()? - term.expected?.range_m, of_scene * term.share))
    }

    /// Distinguishability of a candidate from the next one, 0 to 1.
    fn distinct(&self, at: usize, sigma_m: f64) -> f64 {
        let [lower, upper] = [at, at + 1].map(|at| self.possible[at].outcome);
        match lower.range_m().zip(upper.range_m()) {
            Some((lower_m, upper_m)) => {
                1.0 - (-((lower_m - upper_m) / sigma_m).powi(2) / 8.0).exp()
            }
            None if lower == upper => 0.0,
            None => 1.0,
        }
    }
}

/// Value after a change of the parameters.
fn after(value: f64, rates: &SparseRow, change: &DVector<f64>) -> f64 {
    value + rates.iter().map(|&(at, rate)| rate * change[at as usize]).sum::<f64>()
}

/// Expected information of one binary reading on the position of a probit step, at `place`
/// standard deviations: `density^2 / (up_to (1 - up_to))`.
fn expected_of_step(place: f64) -> f64 {
    let up_to = normal_up_to(place);
    let spread = up_to * (1.0 - up_to);
    if spread > 1e-12 { normal_density(place).powi(2) / spread } else { 0.0 }
}

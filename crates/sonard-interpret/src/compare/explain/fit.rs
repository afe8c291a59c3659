//! Robust fits of a change that moves predicted ranges in proportion.

use sonard_model::geometry::DVec2;

use super::{Pair, SIGMA_M, densities, log_likelihood};

/// Spreads that the fit is made with in turn, metres: from wide, so that it finds its way, to the stated one.
const SPREADS_M: [f64; 4] = [0.08, 0.04, 0.02, SIGMA_M];
/// Steps with each.
const STEPS: usize = 8;
/// A change of more than this needs another prediction, metres (and a share, of the speed of sound).
const PRIOR: f64 = 0.3;
/// Fewer pairs than this say nothing.
const FEW: usize = 5;

/// What came of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    pub(super) value: [f64; 2],
    pub(super) sigma: [f64; 2],
    /// In log-likelihood.
    pub(super) gain: f64,
    /// Readings explained that were not before.
    pub(super) explains: u32,
}

/// The change of at most two values that explains the residuals best, where the predicted range grows by
/// `gain_of(pair) . value`. `None` if too few pairs depend on it.
///
/// Expectation-maximisation: each step weighs a residual by the share of its density that is explained, and solves
/// the normal equations of the weighted least squares. The likelihood does not fall from step to step while the
/// spread stays.
pub(super) fn fit(pairs: &[Pair], gain_of: impl Fn(&Pair) -> DVec2) -> Option<Fit> {
    let moved: Vec<(f64, DVec2)> = pairs
        .iter()
        .map(|pair| (pair.residual_m, gain_of(pair)))
        .filter(|(_, gain)| gain.length_squared() > 1e-12)
        .collect();
    if moved.len() < FEW {
        return None;
    }
    let mut value = DVec2::ZERO;
    let mut sums = Sums::default();
    for spread_m in SPREADS_M {
        for _ in 0..STEPS {
            sums = Sums::of(&moved, value, spread_m);
            value = sums.solve();
        }
    }
    let sigma = sums.sigma();
    let left = |(residual_m, gain): &(f64, DVec2)| residual_m - gain.dot(value);
    let gain = moved.iter().map(|pair| log_likelihood(left(pair)) - log_likelihood(pair.0)).sum();
    let is_near = |residual_m: f64| residual_m.abs() < 2.0 * SIGMA_M;
    let explains = moved.iter().filter(|pair| is_near(left(pair)) && !is_near(pair.0)).count();
    Some(Fit { value: value.to_array(), sigma, gain, explains: explains as u32 })
}

/// Sums of the normal equations.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    xx: f64,
    xy: f64,
    yy: f64,
    right: DVec2,
    /// Of weights, and of weighted squares of what is left.
    weights: f64,
    squares: f64,
}

impl Sums {
    fn of(moved: &[(f64, DVec2)], value: DVec2, spread_m: f64) -> Self {
        let mut sums = Self::default();
        for &(residual_m, gain) in moved {
            let left_m = residual_m - gain.dot(value);
            let [explained, other] = densities(left_m, spread_m);
            let weight = explained / (explained + other);
            sums.xx += weight * gain.x * gain.x;
            sums.xy += weight * gain.x * gain.y;
            sums.yy += weight * gain.y * gain.y;
            sums.right += weight * residual_m * gain;
            sums.weights += weight;
            sums.squares += weight * left_m * left_m;
        }
        // A value that no reading depends on stays at nothing.
        let prior = (spread_m / PRIOR).powi(2);
        sums.xx += prior;
        sums.yy += prior;
        sums
    }

    fn determinant(&self) -> f64 {
        self.xx * self.yy - self.xy * self.xy
    }

    fn solve(&self) -> DVec2 {
        let Self { xx, xy, yy, right, .. } = *self;
        DVec2::new(yy * right.x - xy * right.y, xx * right.y - xy * right.x) / self.determinant()
    }

    /// Standard deviations, by how residuals really spread.
    fn sigma(&self) -> [f64; 2] {
        let variance = self.squares / self.weights.max(f64::MIN_POSITIVE);
        [self.yy, self.xx].map(|of| (variance * of / self.determinant()).sqrt())
    }
}

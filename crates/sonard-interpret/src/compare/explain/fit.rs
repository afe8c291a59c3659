//! Robust fits of a change that moves predicted ranges in proportion.

use glam::{DMat3, DVec3};

use super::{
    found::{Estimate, Quantity},
    likelihood::{SIGMA_M, densities, is_near, log_likelihood},
};

/// Spreads that the fit is made with in turn, metres: from wide, so that it finds its way, to the stated one.
const SPREADS_M: [f64; 4] = [0.08, 0.04, 0.02, SIGMA_M];
/// Steps with each.
const STEPS: usize = 8;
/// Standard deviation of what is believed beforehand of each value: metres, or a share of the speed of sound.
const PRIOR: f64 = 0.3;
/// Changes beyond these are not of first order, and need another prediction: metres, and a share of the speed of
/// sound.
const MOST: DVec3 = DVec3::new(0.15, 0.15, 0.06);
/// Fewer pairs than this say nothing.
const FEW: usize = 5;

/// A residual, metres, and what the predicted range gains by each of three values: metres along x and y (or of another
/// offset, in the place of x), and a share of the speed of sound.
pub(super) type Moved = (f64, DVec3);

/// What came of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    pub(super) value: DVec3,
    pub(super) sigma: DVec3,
    /// In log-likelihood.
    pub(super) gain: f64,
    /// Readings explained that were not before.
    pub(super) explains: u32,
}

impl Fit {
    /// One of its values; a share becomes percent.
    pub(super) fn estimate(&self, name: Quantity, at: usize) -> Estimate {
        let scale = if at == 2 { 100.0 } else { 1.0 };
        Estimate { name, value: self.value[at] * scale, sigma: self.sigma[at] * scale }
    }

    /// What is left of a residual.
    pub(super) fn left_m(&self, (residual_m, gain): Moved) -> f64 {
        residual_m - gain.dot(self.value)
    }
}

/// The change that explains the residuals best, where the predicted range grows by the gain times it. `None` if too
/// few residuals depend on it, or it is too large for the first order.
///
/// Expectation-maximisation: each step weighs a residual by the share of its density that is explained, and solves
/// the normal equations of the weighted least squares. The likelihood does not fall from step to step while the
/// spread stays.
pub(super) fn fit(all: impl Iterator<Item = Moved>) -> Option<Fit> {
    let moved: Vec<Moved> = all.filter(|(_, gain)| gain.length_squared() > 1e-12).collect();
    if moved.len() < FEW {
        return None;
    }
    let mut value = DVec3::ZERO;
    let mut sums = Sums::default();
    for spread_m in SPREADS_M {
        for _ in 0..STEPS {
            sums = Sums::of(&moved, value, spread_m);
            value = sums.normal.inverse() * sums.right;
        }
    }
    if !value.abs().cmple(MOST).all() {
        return None;
    }
    let mut found = Fit { value, sigma: sums.sigma(), gain: 0.0, explains: 0 };
    for &pair in &moved {
        let left_m = found.left_m(pair);
        found.gain += log_likelihood(left_m) - log_likelihood(pair.0);
        found.explains += u32::from(is_near(left_m) && !is_near(pair.0));
    }
    Some(found)
}

/// Sums of the normal equations.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    normal: DMat3,
    right: DVec3,
    /// Of weights, and of weighted squares of what is left.
    weights: f64,
    squares: f64,
}

impl Sums {
    fn of(moved: &[Moved], value: DVec3, spread_m: f64) -> Self {
        // A value that no reading depends on stays at nothing.
        let mut sums = Self {
            normal: DMat3::from_diagonal(DVec3::splat((spread_m / PRIOR).powi(2))),
            right: DVec3::ZERO,
            weights: 0.0,
            squares: 0.0,
        };
        for &(residual_m, gain) in moved {
            let left_m = residual_m - gain.dot(value);
            let [explained, other] = densities(left_m, spread_m);
            let weight = explained / (explained + other);
            let weighted = weight * gain;
            sums.normal +=
                DMat3::from_cols(weighted * gain.x, weighted * gain.y, weighted * gain.z);
            sums.right += residual_m * weighted;
            sums.weights += weight;
            sums.squares += weight * left_m * left_m;
        }
        sums
    }

    /// Standard deviations, by how residuals really spread.
    fn sigma(&self) -> DVec3 {
        let variance = self.squares / self.weights.max(f64::MIN_POSITIVE);
        let inverse = self.normal.inverse();
        let of = |at: usize| (variance * inverse.col(at)[at]).max(0.0).sqrt();
        DVec3::new(of(0), of(1), of(2))
    }
}

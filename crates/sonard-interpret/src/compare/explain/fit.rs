//! Robust fit of a change to which predicted ranges respond linearly.

use glam::{DMat3, DVec3};

use super::{
    explanation::{ChangeEstimate, ChangedQuantity},
    likelihood::{SIGMA_M, densities, is_near, log_likelihood},
};

/// Standard deviations of the successive fits, metres: wide first for a large basin of
/// convergence, then down to the stated one.
const SIGMA_SCHEDULE_M: [f64; 4] = [0.08, 0.04, 0.02, SIGMA_M];
/// Iterations with each standard deviation.
const ITERATIONS: usize = 8;
/// Prior standard deviation of each value: metres, or a fraction of the speed of sound.
const PRIOR_SIGMA: f64 = 0.3;
/// Limits of the first-order approximation: metres, metres, and a fraction of the speed of sound.
const MAX_CHANGE: DVec3 = DVec3::new(0.15, 0.15, 0.06);
/// Minimum number of pairs for a fit.
const MIN_PAIRS: usize = 5;

/// Residual in metres, and gradient of the predicted range with respect to three values: metres
/// along x and y (or another offset in place of x), and a fraction of the speed of sound.
pub(super) type Linearized = (f64, DVec3);

/// Result of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LinearFit {
    pub(super) value: DVec3,
    pub(super) sigma: DVec3,
    /// Gain in log-likelihood.
    pub(super) gain: f64,
    /// Readings explained by the change and not before.
    pub(super) explains: u32,
}

impl LinearFit {
    /// Estimate of one of the values; a fraction becomes percent.
    pub(super) fn estimate(&self, name: ChangedQuantity, at: usize) -> ChangeEstimate {
        let scale = if at == 2 { 100.0 } else { 1.0 };
        ChangeEstimate { name, value: self.value[at] * scale, sigma: self.sigma[at] * scale }
    }

    /// Residual that remains after the fit, metres.
    pub(super) fn remaining_m(&self, (residual_m, gradient): Linearized) -> f64 {
        residual_m - gradient.dot(self.value)
    }
}

/// Fits the change that explains the residuals best, for predicted ranges that respond by
/// gradient times change. `None` if too few residuals depend on the change, or if it exceeds the
/// limits of the first order.
///
/// Expectation-maximization: each step weighs a residual by its inlier probability and solves the
/// normal equations of the weighted least squares. The likelihood does not decrease from step to
/// step while the standard deviation stays the same.
pub(super) fn fit(all: impl Iterator<Item = Linearized>) -> Option<LinearFit> {
    let pairs: Vec<Linearized> =
        all.filter(|(_, gradient)| gradient.length_squared() > 1e-12).collect();
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let mut value = DVec3::ZERO;
    let mut equations = NormalEquations::default();
    for sigma_m in SIGMA_SCHEDULE_M {
        for _ in 0..ITERATIONS {
            equations = NormalEquations::accumulate(&pairs, value, sigma_m);
            value = equations.matrix.inverse() * equations.right;
        }
    }
    if !value.abs().cmple(MAX_CHANGE).all() {
        return None;
    }
    let mut found = LinearFit { value, sigma: equations.sigma(), gain: 0.0, explains: 0 };
    for &pair in &pairs {
        let remaining_m = found.remaining_m(pair);
        found.gain += log_likelihood(remaining_m) - log_likelihood(pair.0);
        found.explains += u32::from(is_near(remaining_m) && !is_near(pair.0));
    }
    Some(found)
}

/// Normal equations of the weighted least squares.
#[derive(Debug, Clone, Copy, Default)]
struct NormalEquations {
    matrix: DMat3,
    right: DVec3,
    /// Sum of weights.
    weights: f64,
    /// Weighted sum of squared remaining residuals.
    squares: f64,
}

impl NormalEquations {
    fn accumulate(pairs: &[Linearized], value: DVec3, sigma_m: f64) -> Self {
        // The prior keeps a value at zero that no reading depends on.
        let mut sums = Self {
            matrix: DMat3::from_diagonal(DVec3::splat((sigma_m / PRIOR_SIGMA).powi(2))),
            right: DVec3::ZERO,
            weights: 0.0,
            squares: 0.0,
        };
        for &(residual_m, gradient) in pairs {
            let remaining_m = residual_m - gradient.dot(value);
            let [inlier, outlier] = densities(remaining_m, sigma_m);
            let weight = inlier / (inlier + outlier);
            let weighted = weight * gradient;
            sums.matrix += DMat3::from_cols(
                weighted * gradient.x,
                weighted * gradient.y,
                weighted * gradient.z,
            );
            sums.right += residual_m * weighted;
            sums.weights += weight;
            sums.squares += weight * remaining_m * remaining_m;
        }
        sums
    }

    /// Standard deviations, scaled by the observed scatter of the residuals.
    fn sigma(&self) -> DVec3 {
        let variance = self.squares / self.weights.max(f64::MIN_POSITIVE);
        let inverse = self.matrix.inverse();
        let sigma = |at: usize| (variance * inverse.col(at)[at]).max(0.0).sqrt();
        DVec3::new(sigma(0), sigma(1), sigma(2))
    }
}

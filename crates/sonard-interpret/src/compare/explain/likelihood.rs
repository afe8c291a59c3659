//! Likelihood of a residual: Gaussian inliers with uniform outliers.

use sonard_records::PingStatus;

use crate::compare::AGREE_WITHIN_M;

/// Standard deviation of an inlier residual, metres.
pub(super) const SIGMA_M: f64 = AGREE_WITHIN_M;
/// Prior probability of an outlier.
const P_OUTLIER: f64 = 0.1;
/// Width of the uniform outlier density, metres.
const OUTLIER_WIDTH_M: f64 = 5.0;

/// Returns `true` if a residual is explained: within twice the standard deviation.
pub(super) fn is_near(residual_m: f64) -> bool {
    residual_m.abs() < 2.0 * SIGMA_M
}

/// Log-likelihood of a residual, metres.
pub(super) fn log_likelihood(residual_m: f64) -> f64 {
    let [inlier, outlier] = densities(residual_m, SIGMA_M);
    (inlier + outlier).ln()
}

/// Inlier and outlier parts of the density of a residual, for an inlier standard deviation.
pub(super) fn densities(residual_m: f64, sigma_m: f64) -> [f64; 2] {
    let normal =
        (-0.5 * (residual_m / sigma_m).powi(2)).exp() / (sigma_m * std::f64::consts::TAU.sqrt());
    [(1.0 - P_OUTLIER) * normal, P_OUTLIER / OUTLIER_WIDTH_M]
}

/// Returns whether a reading has an echo; `None` for a reading without a valid outcome.
pub(super) fn has_echo(status: PingStatus) -> Option<bool> {
    match status {
        PingStatus::Echo | PingStatus::MinRange => Some(true),
        PingStatus::NoEcho => Some(false),
        PingStatus::LinkLost | PingStatus::StepUncertain | PingStatus::ModuleFault => None,
    }
}

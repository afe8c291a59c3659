//! How likely a residual is: Gaussian where it is explained, or from anywhere.

use sonard_records::PingStatus;

use crate::compare::AGREE_WITHIN_M;

/// Spread of a residual that is explained, metres.
pub(super) const SIGMA_M: f64 = AGREE_WITHIN_M;
/// Share of readings that nothing of this kind explains, and the width of where they lie, metres.
const OUTLIERS: f64 = 0.1;
const OUTLIERS_M: f64 = 5.0;

/// Whether a residual is explained.
pub(super) fn is_near(residual_m: f64) -> bool {
    residual_m.abs() < 2.0 * SIGMA_M
}

/// Log-likelihood of a residual, metres.
pub(super) fn log_likelihood(residual_m: f64) -> f64 {
    let [explained, other] = densities(residual_m, SIGMA_M);
    (explained + other).ln()
}

/// The two parts of a residual's density: by what is predicted, with such a spread, and by anything else.
pub(super) fn densities(residual_m: f64, sigma_m: f64) -> [f64; 2] {
    let normal =
        (-0.5 * (residual_m / sigma_m).powi(2)).exp() / (sigma_m * std::f64::consts::TAU.sqrt());
    [(1.0 - OUTLIERS) * normal, OUTLIERS / OUTLIERS_M]
}

/// Whether a reading was heard; `None` of one that says neither.
pub(super) fn is_heard(status: PingStatus) -> Option<bool> {
    match status {
        PingStatus::Echo | PingStatus::MinRange => Some(true),
        PingStatus::NoEcho => Some(false),
        PingStatus::LinkLost | PingStatus::StepDoubtful | PingStatus::ModuleFault => None,
    }
}

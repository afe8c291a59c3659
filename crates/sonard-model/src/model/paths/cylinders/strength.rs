//! Bounds on the echo that a half-path can still become.
//!
//! A half-path with a width `w1` and a front of curvature `1/R1` hits a surface of radius `r` at
//! `i` from its normal, and another with `w2` and `1/R2` leaves it the same way. The echo of both
//! has spread to
//!
//! ```text
//! w = w1 w2 (1/R1 + 1/R2 + 2 / (r cos i))
//! ```
//!
//! compared with its length `L = L1 + L2` over flat walls. Its amplitude is therefore `sqrt(L / w)`
//! times the losses at surfaces and in air. With the growth `g = w/R` of each that is at most
//! `sqrt(y1 x2 + x1 y2)` for `x = 1 / (g + 2 w / r)` and `y = L / w`, each with its own loss.
//! Farther along any path `x` and `y` only decrease: fronts that convex surfaces turn never
//! converge. The best `x` and `y` of the possible partners of a half-path therefore bound every
//! echo of the half-path and its continuations.

use crate::model::paths::settings::PathSettings;

/// Margin in power by which rays of a tube may exceed the sampled rays. The tube's part of a
/// cylinder turns by 0.7 radians at most.
pub(crate) const POWER_MARGIN: f64 = 1.6;

/// Bounds `x` and `y` of the module's description, with losses squared.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Strength {
    pub(crate) x: f64,
    pub(crate) y: f64,
}

impl Strength {
    /// Strength of rays of this length and spreading, before a cylinder of radius `radius_m` at
    /// most.
    pub(crate) fn new(
        gain: f64,
        [length_m, width_m, growth]: [f64; 3],
        radius_m: f64,
        settings: &PathSettings,
    ) -> Self {
        let power = (gain * settings.air_gain(length_m)).powi(2);
        Self { x: power / (growth + 2.0 * width_m / radius_m), y: power * length_m / width_m }
    }

    /// Upper bound of the power of an echo composed of two half-paths.
    pub(crate) fn with(&self, other: &Self) -> f64 {
        POWER_MARGIN * (self.y * other.x + self.x * other.y)
    }

    /// Strength after a further loss of power.
    pub(crate) fn times(self, power: f64) -> Self {
        Self { x: power * self.x, y: power * self.y }
    }

    pub(crate) fn max(self, other: Self) -> Self {
        Self { x: self.x.max(other.x), y: self.y.max(other.y) }
    }
}

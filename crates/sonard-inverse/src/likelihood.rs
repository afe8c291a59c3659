//! Error model of readings.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use serde::{Deserialize, Serialize};

use crate::sweep::RangeOutcome;

/// Effective number of correlated readings.
///
/// Adjacent beams share the model error of their arc, so hypothesis weights use `log_likelihood /
/// READINGS_PER_ARC`; treating them as independent makes posterior odds overconfident.
pub(crate) const READINGS_PER_ARC: f64 = 8.0;

/// Error model: scatter of readings about predictions, with outliers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorModel {
    /// Standard deviation of the range of an echo, metres.
    pub sigma_m: f64,
    /// Fraction of echoes in the far tail, 0 to 1.
    pub tail_weight: f64,
    /// Mean excess range of those, as a multiple of `sigma_m`.
    pub tail_ratio: f64,
    /// Standard deviation of the threshold from firing to firing, decibels; includes level errors
    /// of the model.
    pub sigma_db: f64,
    /// Standard deviation added to the level of an echo by each mirror reflection after the first,
    /// decibels, because walls are neither flat nor square.
    #[serde(default)]
    pub sigma_db_per_reflection: f64,
    /// Fraction of single outliers among readings outside outlier arcs.
    pub outlier_share: f64,
    /// Fraction of readings in arcs of objects that the scene lacks: people, furniture, the robot
    /// itself. 0 disables the outlier state.
    pub outlier_arc_share: f64,
    /// Mean length of such arcs, readings.
    pub outlier_arc_beams: f64,
    /// Fraction of all outliers without echo.
    pub outlier_no_echo_share: f64,
    /// Maximum range of outliers, metres; their density is uniform.
    pub outlier_max_range_m: f64,
}

/// Fraction of readings within an arc that resemble the preceding one: no echo as well, or a
/// similar range.
const ALIKE: f64 = 0.85;
/// Mean range difference within an arc, metres.
const ARC_M: f64 = 0.01;
/// Minimum of that difference, in standard deviations of ranges.
const ARC_SIGMAS: f64 = 3.0;
/// Fraction of outliers with an echo that are below the minimum range.
const NEAR: f64 = 0.1;

impl ErrorModel {
    /// Initial error model: centimetres, some decibels, one outlier in ten readings.
    #[must_use]
    pub const fn rough(sigma_m: f64, sigma_db: f64, reach_m: f64) -> Self {
        Self {
            sigma_m,
            tail_weight: 0.1,
            tail_ratio: 2.0,
            sigma_db,
            sigma_db_per_reflection: 0.0,
            outlier_share: 0.1,
            outlier_arc_share: 0.1,
            outlier_arc_beams: 8.0,
            outlier_no_echo_share: 0.3,
            outlier_max_range_m: reach_m,
        }
    }

    /// Error model without outlier arcs, only with single outliers. Used for the comparison of
    /// poses, which would otherwise absorb everything unexplained into arcs.
    pub(crate) const fn without_arcs(self) -> Self {
        Self { outlier_arc_share: 0.0, ..self }
    }

    /// Error model with another standard deviation of ranges; the far tail keeps its length.
    pub(crate) fn with_range_spread(self, sigma_m: f64) -> Self {
        Self { sigma_m, tail_ratio: self.tail_ratio * self.sigma_m / sigma_m, ..self }
    }

    /// Density of a range error (measured minus predicted, metres), and its derivative: normal, or
    /// with an exponentially distributed excess (`TofNoise`), whose density is the convolution of
    /// both.
    pub(crate) fn range(&self, error_m: f64) -> [f64; 2] {
        let Self { sigma_m, tail_weight: tail_share, .. } = *self;
        let normal = (-0.5 * (error_m / sigma_m).powi(2)).exp() / (sigma_m * TAU.sqrt());
        let tail_m = self.tail_ratio * sigma_m;
        // The convolution solves f' = (normal - f) / tail.
        let tail = exponentially_modified(error_m, sigma_m, tail_m);
        let slope = -error_m / (sigma_m * sigma_m) * normal;
        [
            (1.0 - tail_share) * normal + tail_share * tail,
            (1.0 - tail_share) * slope + tail_share * (normal - tail) / tail_m,
        ]
    }

    /// Error model for the information matrix. If the threshold hardly varies, only the few
    /// readings right at it are informative; so a minimum variation is assumed.
    pub(crate) fn for_information(self) -> Self {
        const MIN_DB: f64 = 0.5;
        Self { sigma_db: self.sigma_db.max(MIN_DB), ..self }
    }

    /// Fisher information of the range of an inlier echo on its expectation; slightly less than
    /// that of normal errors alone.
    pub(crate) fn range_information(&self) -> f64 {
        const STEPS: i32 = 200;
        // From five standard deviations before to ten, plus tails, after.
        let step_m = self.sigma_m * (10.0 + 10.0 * self.tail_ratio) / f64::from(STEPS);
        let at = |step: i32| {
            let [density, slope] = self.range(f64::from(step) * step_m - 5.0 * self.sigma_m);
            if density > 0.0 { slope * slope / density } else { 0.0 }
        };
        (0..=STEPS).map(at).sum::<f64>() * step_m
    }

    /// Prior probability that the scene explains a reading, 0 to 1.
    #[must_use]
    pub const fn explained(&self) -> f64 {
        (1.0 - self.outlier_arc_share) * (1.0 - self.outlier_share)
    }

    /// Density of a single outlier: of a range in metres, or the probability of a reading without
    /// one.
    pub(crate) fn of_clutter(&self, outcome: RangeOutcome) -> f64 {
        match outcome {
            RangeOutcome::Echo { .. } => {
                (1.0 - self.outlier_no_echo_share) / self.outlier_max_range_m
            }
            RangeOutcome::NoEcho => self.outlier_no_echo_share,
            RangeOutcome::BelowMinRange => (1.0 - self.outlier_no_echo_share) * NEAR,
        }
    }

    /// Density of a reading in the outlier state, given the preceding reading if in that state,
    /// too.
    pub(crate) fn of_else(&self, before: Option<RangeOutcome>, outcome: RangeOutcome) -> f64 {
        let anywhere = self.of_clutter(outcome);
        let alike = match (before, outcome) {
            (None, _) => return anywhere,
            (Some(RangeOutcome::NoEcho), RangeOutcome::NoEcho)
            | (Some(RangeOutcome::BelowMinRange), RangeOutcome::BelowMinRange) => 1.0,
            (
                Some(RangeOutcome::Echo { range_m: before_m }),
                RangeOutcome::Echo { range_m: measured_m },
            ) => {
                // Ranges within the range error can't be recognized as similar: while predictions
                // may be far off, an outlier arc must not dominate them by its self-similarity.
                let width_m = ARC_M.hypot(ARC_SIGMAS * self.sigma_m);
                (-(measured_m - before_m).abs() / width_m).exp() / (2.0 * width_m)
            }
            _ => 0.0,
        };
        ALIKE * alike + (1.0 - ALIKE) * anywhere
    }

    /// Transition probabilities between the scene and the outlier state.
    pub(crate) fn changes(&self) -> [[f64; 2]; 2] {
        let leaves = 1.0 / self.outlier_arc_beams;
        let enters = (leaves * self.outlier_arc_share / (1.0 - self.outlier_arc_share)).min(0.5);
        [[1.0 - enters, enters], [leaves, 1.0 - leaves]]
    }
}

fn exponentially_modified(error_m: f64, sigma_m: f64, tail_m: f64) -> f64 {
    let ratio = sigma_m / tail_m;
    let late = FRAC_1_SQRT_2 * (ratio - error_m / sigma_m);
    if late > 20.0 {
        // Below 1e-170 of the peak.
        return 0.0;
    }
    0.5 / tail_m * (0.5 * ratio * ratio - error_m / tail_m).exp() * libm::erfc(late)
}

/// Standard normal cumulative distribution function.
pub(crate) fn normal_up_to(value: f64) -> f64 {
    0.5 * libm::erfc(-value * FRAC_1_SQRT_2)
}

/// Standard normal density.
pub(crate) fn normal_density(value: f64) -> f64 {
    (-0.5 * value * value).exp() / TAU.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn density_integrates_to_one() {
        let model = ErrorModel::rough(0.002, 2.0, 5.0);
        let step_m = 1e-5;
        let errors = (-4000..12_000).map(|at| f64::from(at) * step_m);
        let integral: f64 = errors.clone().map(|error_m| model.range(error_m)[0] * step_m).sum();
        assert!((integral - 1.0).abs() < 1e-9, "{integral}");
        for error_m in errors.step_by(97) {
            let [low, high] = [-1e-7, 1e-7].map(|by| model.range(error_m + by)[0]);
            let slope = model.range(error_m)[1];
            assert!((slope - (high - low) / 2e-7).abs() < 1e-2 * slope.abs().max(1.0), "{error_m}");
        }
        let normal = ErrorModel { tail_weight: 0.0, ..model };
        let [with_tail, without] =
            [model, normal].map(|model| model.range_information() * model.sigma_m.powi(2));
        // The integration limit of five standard deviations omits 2e-5.
        assert!((without - 1.0).abs() < 1e-4, "{without}");
        assert!((0.7..0.95).contains(&with_tail), "{with_tail}");
        // Far before the predicted range it must neither overflow nor be NaN.
        assert!(model.range(-5.0)[0] == 0.0 && model.range(5.0)[0].is_finite());
    }
}

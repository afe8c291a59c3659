//! Errors of ranges, by which readings are compared with predictions.

use sonard_model::acoustics::Sensor;

use crate::options::SurveyOptions;

/// Standard deviation of the ranges of a fine ranger in the final score, metres.
pub(crate) const FINE_SIGMA_M: f64 = 0.004;
/// Maximum error of a range that a fine ranger explains, metres.
const FINE_EXPLAINED_M: f64 = 0.012;
/// Steps of a ranger within which neighbouring ranges are one, with rounding on either side.
const SAME_STEPS: f64 = 2.1;

/// Errors of a ranger's ranges in excess of those of a fine ranger.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct RangeErrors {
    /// Standard deviation in addition to that of a fine ranger, metres.
    excess_m: f64,
    /// Step of the ranges, metres; 0 for none.
    step_m: f64,
}

impl RangeErrors {
    /// Errors that the options state, else those by the step of the sensor.
    pub(crate) fn new(sensor: &Sensor, options: &SurveyOptions) -> Self {
        let step_m = sensor.range_step_m;
        let stated = options
            .range_sigma_m
            .map(|sigma_m| (sigma_m * sigma_m - FINE_SIGMA_M * FINE_SIGMA_M).max(0.0).sqrt());
        Self { excess_m: stated.unwrap_or(step_m), step_m }
    }

    /// Returns `true` for a ranger whose arcs are too coarse to give poses by themselves.
    pub(crate) fn is_coarse(self) -> bool {
        self.excess_m > FINE_SIGMA_M
    }

    /// Standard deviation where that of a fine ranger is given, metres.
    pub(crate) fn sigma_m(self, fine_m: f64) -> f64 {
        fine_m.hypot(self.excess_m)
    }

    /// Maximum error where that for a fine ranger is given, metres.
    pub(crate) fn gate_m(self, fine_m: f64) -> f64 {
        /// Standard deviations within a gate.
        const SIGMAS: f64 = 3.0;
        fine_m.hypot(SIGMAS * self.excess_m)
    }

    /// Standard deviation of ranges in the final score, metres.
    pub(crate) fn final_sigma_m(self) -> f64 {
        self.sigma_m(FINE_SIGMA_M)
    }

    /// Maximum error of a range that counts as explained, metres.
    pub(crate) fn explained_m(self) -> f64 {
        self.gate_m(FINE_EXPLAINED_M)
    }

    /// Maximum difference of neighbouring ranges within an arc, metres, at least that of a fine
    /// ranger.
    pub(crate) fn same_m(self, fine_m: f64) -> f64 {
        fine_m.max(SAME_STEPS * self.step_m)
    }

    /// Factor of a fine ranger's standard deviations of bearings: the middle of an arc is where the
    /// range is least, which varies as the square of the bearing.
    pub(crate) fn bearing_factor(self) -> f64 {
        (self.final_sigma_m() / FINE_SIGMA_M).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_widen_what_a_fine_ranger_has() {
        let mut sensor = Sensor::preset("senscomp-6500").expect("a preset");
        sensor.range_step_m = 0.0;
        let options = SurveyOptions::default();
        let fine = RangeErrors::new(&sensor, &options);
        assert!(!fine.is_coarse());
        // Exactly the constants, so that results of fine ranges are independent of the options.
        assert_eq!(fine.sigma_m(0.006).to_bits(), 0.006_f64.to_bits());
        assert_eq!(fine.gate_m(0.03).to_bits(), 0.03_f64.to_bits());
        assert_eq!(fine.bearing_factor().to_bits(), 1.0_f64.to_bits());
        sensor.range_step_m = 0.01;
        let coarse = RangeErrors::new(&sensor, &options);
        assert!(coarse.is_coarse());
        assert!((coarse.final_sigma_m() - 0.0001_f64.sqrt().hypot(0.004)).abs() < 1e-12);
        // Two ranges a step apart, with rounding, are one arc.
        assert!(coarse.same_m(0.008) > 0.02);
        let stated = SurveyOptions { range_sigma_m: Some(0.005), ..options };
        let stated = RangeErrors::new(&sensor, &stated);
        assert!((stated.final_sigma_m() - 0.005).abs() < 1e-12);
    }
}

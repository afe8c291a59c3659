//! Scan plan: the azimuths and pings of a scan.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::geometry::wrap_360;

/// Azimuths of a scan: from `from_deg` up to, but not including, `to_deg`, in steps of `step_deg`.
///
/// `to_deg` is excluded so that no beam of a full revolution is measured twice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanPlan {
    /// First azimuth of the range, degrees.
    pub from_deg: f64,
    /// End of the range, degrees, exclusive.
    pub to_deg: f64,
    /// Step between stops, degrees.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub step_deg: f64,
    /// Pings at each stop.
    #[schemars(range(min = 1, max = 255))]
    pub pings_per_stop: u32,
}

impl Default for ScanPlan {
    /// Returns a full revolution at the 400-step motor's 0.9 degrees.
    fn default() -> Self {
        Self { from_deg: 0.0, to_deg: 360.0, step_deg: 0.9, pings_per_stop: 1 }
    }
}

/// Error in a scan plan.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlanError {
    /// Value that is not a finite number.
    #[error("{field} is {value}: it must be a finite number of degrees")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// Value that is not finite.
        value: f64,
    },
    /// Step of zero or less.
    #[error("step_deg is {0}: it must be greater than 0")]
    StepNotPositive(f64),
    /// Empty range, or a range of more than a full revolution.
    #[error("to_deg {to_deg} must be greater than from_deg {from_deg}, by at most 360")]
    BadRange {
        /// First azimuth of the range, degrees.
        from_deg: f64,
        /// End of the range, degrees.
        to_deg: f64,
    },
    /// No pings, or more than the protocol allows.
    #[error("pings_per_stop is {0}: it must be 1 to 255")]
    BadPings(u32),
    /// Step that is not a multiple of the motor's steps.
    #[error(
        "step_deg {step_deg} is not a whole number of the motor's steps \
         ({steps_per_revolution} per revolution, {motor_deg} degrees each): use a multiple of {motor_deg}"
    )]
    OffMotorGrid {
        /// Requested step or start angle, degrees.
        step_deg: f64,
        /// Motor steps per revolution.
        steps_per_revolution: u32,
        /// Angle of one motor step, degrees.
        motor_deg: f64,
    },
    /// More beams than a scan can number.
    #[error("the plan has {0} beams; a scan has at most 65535")]
    TooManyBeams(u64),
}

impl ScanPlan {
    /// Checks that the plan is valid.
    ///
    /// # Errors
    /// Names the invalid field and its valid range.
    pub fn check(&self) -> Result<(), PlanError> {
        for (field, value) in
            [("from_deg", self.from_deg), ("to_deg", self.to_deg), ("step_deg", self.step_deg)]
        {
            if !value.is_finite() {
                return Err(PlanError::NotFinite { field, value });
            }
        }
        if self.step_deg <= 0.0 {
            return Err(PlanError::StepNotPositive(self.step_deg));
        }
        let span_deg = self.to_deg - self.from_deg;
        if span_deg <= 0.0 || span_deg > 360.0 + 1e-9 {
            return Err(PlanError::BadRange { from_deg: self.from_deg, to_deg: self.to_deg });
        }
        if !(1..=255).contains(&self.pings_per_stop) {
            return Err(PlanError::BadPings(self.pings_per_stop));
        }
        let beams = (span_deg / self.step_deg) as u64 * u64::from(self.pings_per_stop);
        if beams > 65535 { Err(PlanError::TooManyBeams(beams)) } else { Ok(()) }
    }

    /// Number of stops of a checked plan.
    #[must_use]
    pub fn stops(&self) -> u32 {
        // Excludes a stop that reaches to_deg only by rounding.
        ((self.to_deg - self.from_deg) / self.step_deg - 1e-9).ceil().max(0.0) as u32
    }

    /// Number of firings of a checked plan.
    #[must_use]
    pub fn beams(&self) -> u32 {
        self.stops() * self.pings_per_stop
    }

    /// Azimuth of a stop in degrees, in [0, 360).
    #[must_use]
    pub fn azimuth_deg(&self, stop: u32) -> f64 {
        let azimuth_deg = wrap_360(self.from_deg + f64::from(stop) * self.step_deg);
        // Rounded so that multiples of 0.9 print as such.
        wrap_360((azimuth_deg * 1e9).round() / 1e9)
    }

    /// First motor step and stride of the plan on a motor with `steps_per_revolution`.
    ///
    /// # Errors
    /// If `step_deg` or `from_deg` is not a multiple of a motor step.
    pub fn motor_steps(&self, steps_per_revolution: u32) -> Result<(i32, i32), PlanError> {
        let motor_deg = 360.0 / f64::from(steps_per_revolution);
        let whole = |angle_deg: f64| {
            let steps = angle_deg / motor_deg;
            let near = steps.round();
            if (steps - near).abs() < 1e-6 {
                Ok(near as i32)
            } else {
                Err(PlanError::OffMotorGrid {
                    step_deg: angle_deg,
                    steps_per_revolution,
                    motor_deg,
                })
            }
        };
        Ok((whole(self.from_deg)?, whole(self.step_deg)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_revolution_has_400_stops() {
        let plan = ScanPlan::default();
        assert_eq!(plan.check(), Ok(()));
        assert_eq!(plan.stops(), 400);
        assert_eq!(plan.azimuth_deg(399), 359.1);
        assert_eq!(plan.motor_steps(400), Ok((0, 1)));
    }

    #[test]
    fn range_across_zero_wraps() {
        let plan = ScanPlan { from_deg: -9.0, to_deg: 9.0, ..ScanPlan::default() };
        assert_eq!(plan.stops(), 20);
        assert_eq!(plan.azimuth_deg(0), 351.0);
        assert_eq!(plan.azimuth_deg(10), 0.0);
        assert_eq!(plan.motor_steps(400), Ok((-10, 1)));
    }

    #[test]
    fn rejects_invalid_plans() {
        let good = ScanPlan::default();
        for (plan, part) in [
            (ScanPlan { step_deg: 0.0, ..good }, "step_deg"),
            (ScanPlan { to_deg: -1.0, ..good }, "to_deg"),
            (ScanPlan { to_deg: f64::NAN, ..good }, "to_deg"),
            (ScanPlan { pings_per_stop: 0, ..good }, "pings_per_stop"),
            (ScanPlan { step_deg: 1e-4, ..good }, "65535"),
        ] {
            let error = plan.check().map(|()| String::new()).unwrap_or_else(|e| e.to_string());
            assert!(error.contains(part), "{plan:?}: {error}");
        }
        assert!(matches!(
            ScanPlan { step_deg: 1.0, ..good }.motor_steps(400),
            Err(PlanError::OffMotorGrid { .. })
        ));
    }
}

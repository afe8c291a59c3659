//! Assumptions and limits of a survey.

use crate::{error::SurveyError, odometry::OdometrySigma};

/// Assumptions and limits of a survey.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurveyOptions {
    /// Errors of the sweeps' poses as odometry; `None` to ignore these poses.
    pub odometry: Option<OdometrySigma>,
    /// Standard deviation of directions of walls from a common square axis, degrees; `None` for any
    /// directions.
    pub square_deg: Option<f64>,
    /// Amplitude reflection coefficient of all walls, 0 to 1.
    pub reflectance: f64,
    /// Maximum number of scored scenes.
    pub max_scenes: usize,
}

impl Default for SurveyOptions {
    fn default() -> Self {
        Self {
            odometry: Some(OdometrySigma::default()),
            square_deg: None,
            reflectance: 0.97,
            max_scenes: 30_000,
        }
    }
}

/// Standard deviation of ranges in the final score, metres.
pub(crate) const FINAL_SIGMA_M: f64 = 0.004;
/// Maximum error of a range that counts as explained, metres.
pub(crate) const EXPLAINED_M: f64 = 0.012;

impl SurveyOptions {
    /// Checks that every value is in its range.
    ///
    /// # Errors
    /// The first value that is not.
    pub(crate) fn check(&self) -> Result<(), SurveyError> {
        let Self { odometry, square_deg, reflectance, .. } = *self;
        let odometry = odometry.unwrap_or_default();
        let positive = "positive and finite";
        let checks = [
            (
                "reflectance",
                reflectance,
                reflectance > 0.0 && reflectance <= 1.0,
                "above 0, up to 1",
            ),
            ("m_per_m", odometry.m_per_m, odometry.m_per_m > 0.0, positive),
            ("deg_per_m", odometry.deg_per_m, odometry.deg_per_m > 0.0, positive),
            ("square_deg", square_deg.unwrap_or(1.0), square_deg.unwrap_or(1.0) > 0.0, positive),
        ];
        for (name, value, is_valid, expected) in checks {
            if !is_valid || !value.is_finite() {
                return Err(SurveyError::Option { name, value, expected });
            }
        }
        Ok(())
    }
}

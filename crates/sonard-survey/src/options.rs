//! Assumptions and limits of a survey.

use sonard_inverse::ParameterGroup;

use crate::{error::SurveyError, odometry::OdometrySigma};

/// Assumptions and limits of a survey.
#[derive(Debug, Clone, PartialEq)]
pub struct SurveyOptions {
    /// Errors of the sweeps' poses as odometry; `None` to ignore these poses.
    pub odometry: Option<OdometrySigma>,
    /// Standard deviation of ranges, metres; `None` for 4 mm plus the step of a ranger that reports
    /// in steps (root of the sum of squares).
    pub range_sigma_m: Option<f64>,
    /// Angle over which readings have one error because they share an arc, degrees: so many are
    /// counted as one, at most 8.
    pub arc_deg: f64,
    /// Minimum number of beams of an arc; `None` for as many as fit into 5.4 degrees, at most 3.
    pub min_arc_beams: Option<usize>,
    /// Standard deviation of directions of walls from a common square axis, degrees; `None` for any
    /// directions.
    pub square_deg: Option<f64>,
    /// Amplitude reflection coefficient of all walls, 0 to 1.
    pub reflectance: f64,
    /// Groups of numbers of sensor and air that are fitted together with the plan.
    pub fit: Vec<ParameterGroup>,
    /// Maximum distance of the next view from a stop, metres.
    pub view_reach_m: f64,
    /// Maximum number of scored scenes.
    pub max_scenes: usize,
}

impl Default for SurveyOptions {
    fn default() -> Self {
        Self {
            odometry: Some(OdometrySigma::default()),
            range_sigma_m: None,
            arc_deg: 7.2,
            min_arc_beams: None,
            square_deg: None,
            reflectance: 0.97,
            fit: Vec::new(),
            view_reach_m: 1.5,
            max_scenes: 60_000,
        }
    }
}

impl SurveyOptions {
    /// Standard deviation of the directions of walls in a room that is mostly square, degrees.
    pub const SQUARE_DEG: f64 = 1.0;
    /// Largest possible distance of the next view from a stop, metres.
    const MAX_VIEW_REACH_M: f64 = 20.0;

    /// Checks that every value is in its range.
    ///
    /// # Errors
    /// The first value that is not.
    pub(crate) fn check(&self) -> Result<(), SurveyError> {
        let Self {
            odometry, range_sigma_m, arc_deg, square_deg, reflectance, view_reach_m, ..
        } = *self;
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
            ("m_per_stop", odometry.m_per_stop, odometry.m_per_stop > 0.0, positive),
            ("deg_per_stop", odometry.deg_per_stop, odometry.deg_per_stop > 0.0, positive),
            (
                "range_sigma_m",
                range_sigma_m.unwrap_or(1.0),
                range_sigma_m.unwrap_or(1.0) > 0.0,
                positive,
            ),
            (
                "view_reach_m",
                view_reach_m,
                (0.0..=Self::MAX_VIEW_REACH_M).contains(&view_reach_m),
                "from 0 to 20",
            ),
            ("arc_deg", arc_deg, arc_deg > 0.0, positive),
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

//! Reported changes, and the linearized pairs that they are estimated from.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::DVec2;

/// Change of the model that would fit the readings better.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Explanation {
    /// Changed quantity: `pose`, `heading`, `sound_speed`, `range_offset`, `threshold`, `wall ID`,
    /// or `together` for pose, heading and speed of sound at once.
    pub change: String,
    /// Estimated values of the change.
    pub estimates: Vec<ChangeEstimate>,
    /// Gain in log-likelihood of all readings, nats.
    pub gain: f64,
    /// Readings explained by the change and not before: residuals within twice the standard
    /// deviation; for a threshold, echoes and missing echoes.
    pub explains: u32,
}

/// Estimated value of a change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChangeEstimate {
    /// Estimated quantity, with its unit.
    pub name: ChangedQuantity,
    /// Value to be added to the current one.
    pub value: f64,
    /// Standard deviation of the value.
    pub sigma: f64,
}

/// Quantity altered by a change, with its unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChangedQuantity {
    /// Position of the ranger along x, metres.
    XM,
    /// Position of the ranger along y, metres.
    YM,
    /// Heading of the ranger, degrees counter-clockwise.
    HeadingDeg,
    /// Relative change of the speed of sound, percent.
    Percent,
    /// Offset, metres: of a wall, positive away from the ranger; of a range, added to each reading.
    OffsetM,
    /// Detection threshold, decibels.
    ThresholdDb,
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} by", self.change.replace('_', " "))?;
        for (at, estimate) in self.estimates.iter().enumerate() {
            write!(f, "{} {estimate}", if at == 0 { "" } else { "," })?;
        }
        write!(f, ", which explains {} readings more", self.explains)
    }
}

impl fmt::Display for ChangeEstimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, value, sigma } = self;
        match name {
            ChangedQuantity::XM => write!(f, "x {:+.0} mm +- {:.1}", 1e3 * value, 1e3 * sigma),
            ChangedQuantity::YM => write!(f, "y {:+.0} mm +- {:.1}", 1e3 * value, 1e3 * sigma),
            ChangedQuantity::OffsetM => write!(f, "{:+.0} mm +- {:.1}", 1e3 * value, 1e3 * sigma),
            ChangedQuantity::HeadingDeg => write!(f, "{value:+.2} degrees +- {sigma:.2}"),
            ChangedQuantity::ThresholdDb => write!(f, "{value:+.1} dB +- {sigma:.1}"),
            // The speed of sound is proportional to the square root of the absolute temperature.
            ChangedQuantity::Percent => {
                let warmer_c = 2.0 * value / 100.0 * 293.0;
                write!(f, "{value:+.2} % +- {sigma:.2} (air {warmer_c:+.1} C)")
            }
        }
    }
}

/// Reading with the derivatives of its predicted range.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LinearizedPair {
    pub(super) measured_m: f64,
    pub(super) residual_m: f64,
    /// Derivative of the predicted range with respect to the transducer position, m/m.
    pub(super) d_position: DVec2,
    /// Derivatives with respect to outward wall displacements, m/m, by index into the wall names.
    pub(super) d_walls: Vec<(u16, f64)>,
}

//! What is found, and what it is found from.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::DVec2;

/// A change that would explain readings better.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Explanation {
    /// What changes: `pose`, `heading`, `sound_speed`, `range_offset`, `threshold`, `wall ID`, or `together` for
    /// pose, heading and speed of sound at once.
    pub change: String,
    /// By how much.
    pub estimates: Vec<Estimate>,
    /// What the log-likelihood of all readings gains, natural units.
    pub gain: f64,
    /// Readings that it explains and that were not explained before: residuals within twice the spread; of a
    /// threshold, silences and echoes.
    pub explains: u32,
}

/// A value that a change would have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimate {
    /// What of.
    pub name: Quantity,
    /// How much is to be added.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A quantity that a change alters, with its unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Place of the ranger, metres.
    XM,
    /// The same along y.
    YM,
    /// Where it looks, degrees counter-clockwise.
    HeadingDeg,
    /// Of the speed of sound.
    Percent,
    /// Metres: of a wall, positive away from where the ranger is; of a range, what is to be added to each.
    OffsetM,
    /// Decibels.
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

impl fmt::Display for Estimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, value, sigma } = self;
        match name {
            Quantity::XM => write!(f, "x {:+.0} mm +- {:.1}", 1e3 * value, 1e3 * sigma),
            Quantity::YM => write!(f, "y {:+.0} mm +- {:.1}", 1e3 * value, 1e3 * sigma),
            Quantity::OffsetM => write!(f, "{:+.0} mm +- {:.1}", 1e3 * value, 1e3 * sigma),
            Quantity::HeadingDeg => write!(f, "{value:+.2} degrees +- {sigma:.2}"),
            Quantity::ThresholdDb => write!(f, "{value:+.1} dB +- {sigma:.1}"),
            // The speed of sound grows with the root of the absolute temperature.
            Quantity::Percent => {
                let warmer_c = 2.0 * value / 100.0 * 293.0;
                write!(f, "{value:+.2} % +- {sigma:.2} (air {warmer_c:+.1} C)")
            }
        }
    }
}

/// A reading with its prediction, as far as changes move it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pair {
    pub(super) measured_m: f64,
    pub(super) residual_m: f64,
    /// What the predicted range gains where the transducer moves by a metre along x and y.
    pub(super) by_place: DVec2,
    /// The same where walls move away: places in the list of names.
    pub(super) by_wall: Vec<(u16, f64)>,
}

//! What is found, and what it is found from.

use serde::Serialize;
use sonard_model::geometry::DVec2;

/// A change that would explain readings better.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// What of: `x_m`, `y_m`, `heading_deg`, `percent`, `offset_m`, `threshold_db`. Of a wall, positive away
    /// from where the ranger is; of a range, what is to be added to each.
    pub name: &'static str,
    /// How much is to be added.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
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

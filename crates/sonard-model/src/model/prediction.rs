//! Predicted readings.

use smallvec::SmallVec;

use super::engine::Arrival;
use crate::{array::OtherFiring, reading::PingStatus};

/// The predicted reading of a firing.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// `Echo`, `NoEcho` or `MinRange`.
    pub status: PingStatus,
    /// Range of the moment at which ECHO rose (for `MinRange`, of the end of blanking), metres. For a
    /// strong echo that is half its path; see [`Receiver`](crate::acoustics::Receiver) for what a
    /// weak one adds.
    pub range_m: Option<f64>,
    /// The echo that raised ECHO; for `NoEcho` the candidate that came closest, if there was any.
    pub arrival: Option<Arrival>,
    /// The most that the envelope reached with that echo, all arrivals together.
    pub amplitude: Option<f64>,
    /// The same above the threshold in force, decibels; negative for `NoEcho`: what it lacked.
    pub margin_db: Option<f64>,
    /// Times after firing at which the module raises ECHO, microseconds: the first, or up to eight
    /// where the receiver was made ready again.
    pub echoes_us: SmallVec<[f64; 8]>,
    /// Crosstalk: the firing whose sound the arrival was, if not this one's. Its path begins at that firing's
    /// ranger, and is longer than twice the range if that was an earlier one.
    pub crosstalk: Option<OtherFiring>,
}

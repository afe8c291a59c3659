//! Predicted reading of a firing.

use smallvec::SmallVec;

use super::engine::Arrival;
use crate::{array::InterferingFiring, reading::PingStatus};

/// Predicted reading of a firing.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// `Echo`, `NoEcho` or `MinRange`.
    pub status: PingStatus,
    /// Range of the moment at which ECHO rose (for `MinRange`, of the end of blanking), metres. For
    /// a strong echo that is half its path; see [`Receiver`](crate::acoustics::Receiver) for the
    /// delay of a weak one.
    pub range_m: Option<f64>,
    /// Arrival that raised ECHO; for `NoEcho` the candidate that came closest, if there was any.
    pub arrival: Option<Arrival>,
    /// Maximum of the envelope during that echo, all arrivals together.
    pub amplitude: Option<f64>,
    /// Margin of `amplitude` above the current threshold, decibels; negative for `NoEcho`.
    pub margin_db: Option<f64>,
    /// Times after firing at which the module raises ECHO, microseconds: the first, or up to eight
    /// with a re-armed receiver.
    pub echoes_us: SmallVec<[f64; 8]>,
    /// Firing that emitted the arrival, if it was crosstalk. Its path begins at that firing's
    /// ranger, and is longer than twice the range if that was an earlier firing.
    pub crosstalk: Option<InterferingFiring>,
}

//! Details of one beam of a scan: measured echoes, predicted arrivals and propagation paths.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_interpret::compare::AnnotatedPing;
use sonard_records::{PeakLine, PlanPoint, TraceLine};

/// Measurement and prediction of one beam.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Beam {
    /// Reading, with its classification against the model.
    pub reading: AnnotatedPing,
    /// Measured echoes, in order of arrival.
    pub echoes: Vec<Echo>,
    /// Propagation path of the reading, or else of the predicted echo, as a polyline in the floor
    /// plan: transmitter, each interaction, receiver.
    pub polyline: Option<Vec<PlanPoint>>,
    /// Predicted arrivals in order of time, including those below the threshold; `null` if no
    /// prediction could be computed.
    pub peaks: Option<Vec<PeakLine>>,
    /// Predicted echo envelope, up to 0.5 m beyond the last measured or predicted echo; `null` if
    /// no prediction could be computed.
    pub trace: Option<TraceLine>,
    /// Reason why no prediction could be computed.
    pub unavailable_reason: Option<String>,
}

/// Echo detected by the ranger.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Echo {
    /// Time since firing, device ticks.
    pub ticks: u32,
    /// Time of flight, microseconds; `null` without a session.
    pub tof_us: Option<f64>,
    /// Range: half the distance that sound travels in the time of flight, metres.
    pub range_m: Option<f64>,
}

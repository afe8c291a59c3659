//! One beam of a scan: what was heard, what the model hears, and the paths of the sound.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_interpret::compare::JudgedPing;
use sonard_records::{PeakLine, PlanPoint, TraceLine};

/// A beam with all that is known about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Beam {
    /// The reading, and what explains it.
    pub reading: JudgedPing,
    /// Its echoes, in the order in which they came.
    pub echoes: Vec<Echo>,
    /// The path of the reading's sound, or else of the predicted echo, in the plan: the transmitter, each
    /// interaction, the receiver.
    pub polyline: Option<Vec<PlanPoint>>,
    /// What the model hears, in order of time, faint sounds included; `null` if it could not be
    /// asked.
    pub peaks: Option<Vec<PeakLine>>,
    /// The echo trace that the model predicts, up to half a metre beyond what was heard or predicted;
    /// `null` if it could not be asked.
    pub trace: Option<TraceLine>,
    /// Why the model could not be asked, in words.
    pub lacks: Option<String>,
}

/// An echo that the ranger heard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Echo {
    /// Time after firing, device ticks.
    pub ticks: u32,
    /// The same in microseconds; `null` without a session.
    pub tof_us: Option<f64>,
    /// Half the way that sound goes in that time, metres.
    pub range_m: Option<f64>,
}

//! Simulated ranger array in place of a device.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::array::{MountedRanger, RangerArray};
use sonard_records::PingStatus;

/// State of a simulated ranger array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimulationReport {
    /// Name of the array.
    pub array: String,
    /// Interval between firings, milliseconds.
    pub interval_ms: f64,
    /// `true` while the robot drives its course.
    pub driving: bool,
    /// Firing slots skipped because the simulation was late.
    pub skipped: u64,
    /// Last reading of each ranger, in the order of the array.
    pub readings: Vec<RangerReading>,
}

/// Last reading of one ranger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RangerReading {
    /// Id of the ranger in its array.
    pub id: String,
    /// Beam direction, degrees counter-clockwise from the heading.
    pub bearing_deg: f64,
    /// Time of firing; `null` before the first.
    pub time: Option<Timestamp>,
    /// Outcome of the firing.
    pub status: Option<PingStatus>,
    /// Measured range, metres.
    pub range_m: Option<f64>,
}

impl SimulationReport {
    /// Report of an array before its first firing.
    #[must_use]
    pub fn new(array: &RangerArray) -> Self {
        Self {
            array: array.name.clone(),
            interval_ms: array.interval_ms,
            driving: false,
            skipped: 0,
            readings: RangerReading::none(array),
        }
    }

    /// Returns `true` if the readings belong to rangers with the ids and bearings of `array`.
    #[must_use]
    pub fn matches_array(&self, array: &RangerArray) -> bool {
        let reported = self.readings.iter().map(|reading| (&reading.id, reading.bearing_deg));
        reported.eq(array.rangers.iter().map(|ranger| (&ranger.id, ranger.bearing_deg)))
    }
}

impl RangerReading {
    /// Returns an empty reading for each ranger of `array`.
    fn none(array: &RangerArray) -> Vec<Self> {
        let none = |ranger: &MountedRanger| Self {
            id: ranger.id.clone(),
            bearing_deg: ranger.bearing_deg,
            time: None,
            status: None,
            range_m: None,
        };
        array.rangers.iter().map(none).collect()
    }
}

//! An array that the model plays in place of a device.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::array::{MountedRanger, RangerArray};
use sonard_records::PingStatus;

/// An array that the model plays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SimulationReport {
    /// Its name.
    pub array: String,
    /// From one firing to the next, milliseconds.
    pub interval_ms: f64,
    /// Whether the robot is on its course.
    pub driving: bool,
    /// Turns left out because the model was not ready in time.
    pub skipped: u64,
    /// Each ranger's last reading, in the order of the array.
    pub readings: Vec<RangerReading>,
}

/// A ranger's last reading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RangerReading {
    /// The ranger.
    pub id: String,
    /// Where it looks, degrees counter-clockwise from the heading.
    pub bearing_deg: f64,
    /// When it fired; `null` before it did.
    pub time: Option<Timestamp>,
    /// What became of that.
    pub status: Option<PingStatus>,
    /// The range, metres.
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
    pub fn is_of(&self, array: &RangerArray) -> bool {
        let told = self.readings.iter().map(|reading| (&reading.id, reading.bearing_deg));
        told.eq(array.rangers.iter().map(|ranger| (&ranger.id, ranger.bearing_deg)))
    }
}

impl RangerReading {
    /// An array's readings before there are any.
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

//! State of several robots, as polled by one daemon.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use sonard_records::Provenance;
use uuid::Uuid;

use super::{LinkState, ScanProgress};

/// States of all robots of a fleet.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Fleet {
    /// Robots in the order of the configuration.
    pub robots: Vec<FleetRobot>,
}

/// State of one robot of a fleet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetRobot {
    /// Name of the robot: as configured, or else as first reported.
    pub robot: Option<String>,
    /// Address of the polled daemon: `HOST:PORT`, or the path of a socket.
    pub address: String,
    /// URL of the robot's live page, if the daemon is polled over TCP.
    pub page: Option<String>,
    /// Observed state.
    pub state: FleetState,
    /// Time of the last change of `state`.
    pub since: Timestamp,
    /// Time of the last report received from the robot.
    pub last_report: Option<Timestamp>,
    /// Time since the last report, seconds, by a monotonic clock.
    #[serde(default)]
    pub last_report_age_s: Option<f64>,
    /// Problems of the robot; empty if there are none.
    pub problems: Vec<String>,
    /// Last report received from the robot.
    pub report: Option<FleetReport>,
}

/// State of a robot, as observed by the polling daemon.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FleetState {
    /// The robot has not been polled yet.
    NotPolled,
    /// The robot reports itself healthy.
    Healthy,
    /// The robot reports problems.
    Unhealthy,
    /// No response within the time limit.
    NoResponse,
    /// The daemon rejects the request.
    Rejected,
    /// The response is not that of a daemon of this version.
    InvalidResponse,
    /// A daemon of another robot responds.
    OtherRobot,
}

/// Report of a robot about itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetReport {
    /// Version of the robot's `sonard`.
    pub sonard: String,
    /// State of the link to the robot's ranger.
    pub link: LinkState,
    /// Origin of the readings (hardware, mock or model), once identified.
    pub provenance: Option<Provenance>,
    /// Progress of the current scan.
    pub scan: Option<ScanProgress>,
    /// Arrival time of the last reading, by the polling daemon's clock.
    pub last_reading: Option<Timestamp>,
    /// Age of the last reading at the time of the report, seconds.
    #[serde(default)]
    pub last_reading_age_s: Option<f64>,
    /// Last scan that ended.
    pub last_scan: Option<FleetScan>,
}

/// Summary of the last scan that ended on a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetScan {
    /// Id of the scan.
    pub scan: Uuid,
    /// End of the scan, by the robot's clock.
    pub ended: Timestamp,
    /// Fraction of the beams with both a measured and a predicted echo whose ranges agree.
    pub agree_fraction: Option<f64>,
    /// Median of |measured − predicted range|, metres.
    pub median_abs_residual_m: Option<f64>,
    /// Number of beams without a reading at the end of the scan.
    pub missing: u32,
    /// Small floor plan of the scan, once its readings have been fetched.
    pub picture: Option<FleetPicture>,
}

/// Small floor plan of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetPicture {
    /// Pose of the robot.
    pub pose: Pose,
    /// End points of the ranges, metres; long scans are thinned to every n-th reading.
    pub points_m: Vec<[f64; 2]>,
    /// Walls of the scene, each by its two end points, metres; empty if the scene has too many.
    pub walls_m: Vec<[[f64; 2]; 2]>,
}

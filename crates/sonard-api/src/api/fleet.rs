//! Several robots, as one daemon that asks the others tells them.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use sonard_records::Provenance;
use uuid::Uuid;

use super::{LinkState, ScanProgress};

/// The robots of a fleet, in the order of the configuration.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Fleet {
    /// The robots.
    pub robots: Vec<FleetRobot>,
}

/// One of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetRobot {
    /// Its name: as configured, else as it said first.
    pub robot: Option<String>,
    /// Where it is asked: `HOST:PORT`, or the path of a socket.
    pub address: String,
    /// Its own page, where it is asked by TCP.
    pub page: Option<String>,
    /// How it is.
    pub state: FleetState,
    /// Since when.
    pub since: Timestamp,
    /// When it was heard last.
    pub heard: Option<Timestamp>,
    /// Time since then, seconds, by a clock that is never set.
    #[serde(default)]
    pub heard_s: Option<f64>,
    /// What is wrong, if anything.
    pub wrong: Vec<String>,
    /// What it said when it was heard last.
    pub report: Option<FleetReport>,
}

/// State of a robot, as seen by the one that asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FleetState {
    /// It was not asked yet.
    Unasked,
    /// It says that all is well.
    Well,
    /// It says that something is not well.
    NotWell,
    /// Nobody answers there, or not in time.
    Silent,
    /// It refuses to answer.
    Refusing,
    /// What answers there is no daemon of this version.
    Strange,
    /// A daemon answers, of another robot.
    OtherRobot,
}

/// A robot's report of itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetReport {
    /// Version of its program.
    pub sonard: String,
    /// What its ranger is doing.
    pub link: LinkState,
    /// Whether its readings come from hardware, once it knows.
    pub provenance: Option<Provenance>,
    /// The scan under way.
    pub scan: Option<ScanProgress>,
    /// When the last reading came in, by the clock of whoever asked.
    pub last_reading: Option<Timestamp>,
    /// Age of the last reading when the robot was heard last, seconds.
    #[serde(default)]
    pub last_reading_age_s: Option<f64>,
    /// The last scan that ended.
    pub last_scan: Option<FleetScan>,
}

/// The last scan of a robot that ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetScan {
    /// The scan.
    pub scan: Uuid,
    /// When it ended, by the robot's clock.
    pub ended: Timestamp,
    /// Share of the beams with an echo on both sides whose ranges agree with the model.
    pub agree_fraction: Option<f64>,
    /// Median distance between measured and predicted range, metres.
    pub median_abs_residual_m: Option<f64>,
    /// Beams that it lacked at its end.
    pub missing: u32,
    /// How it looks, once its readings were fetched.
    pub picture: Option<FleetPicture>,
}

/// A scan as a small floor plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetPicture {
    /// Where the robot stood.
    pub pose: Pose,
    /// Where ranges end, metres; of many readings every so manieth.
    pub points_m: Vec<[f64; 2]>,
    /// Walls of the scene, from and to, metres; none of a scene with many.
    pub walls_m: Vec<[[f64; 2]; 2]>,
}

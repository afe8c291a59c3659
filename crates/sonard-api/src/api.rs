//! Request and response types of the HTTP API, shared by server and clients.
//!
//! `GET /v1/openapi.json` is generated from these types and from the record types of
//! [`sonard_records`].

mod access;
mod air;
mod beam;
mod body;
mod findings;
mod fleet;
mod health;
mod link;
mod location;
mod logs;
mod mqtt;
mod orders;
mod problem;
mod ros;
mod scans;
mod sensor;
mod server;
mod settings;
mod setup;
mod simulation;
mod status;
mod survey;

pub use access::{AccessReport, WriteAccess};
pub use air::{AirOrder, AirStatus};
pub use beam::{Beam, Echo};
pub use body::{Strict, has_list};
pub use findings::{Findings, FoundFeature, FoundLine, MapCells};
pub use fleet::{Fleet, FleetPicture, FleetReport, FleetRobot, FleetScan, FleetState};
pub use health::{ClockReport, Health, LineTotals, ScanFit, ScanTotals};
pub use link::{LinkReport, LinkState, Trouble};
pub use location::Location;
pub use logs::LogEntry;
pub use mqtt::MqttReport;
pub use orders::{Accepted, CancelRequest, ScanRequest, Scanning, Started};
pub use problem::Problem;
pub use ros::RosReport;
pub use scans::{ListedScan, ScanReport, WholeScan};
pub use sensor::{SensorFigures, SensorOrder};
pub use server::ServerReport;
pub use settings::SettingsOrder;
pub use setup::Setup;
pub use simulation::{RangerReading, SimulationReport};
pub use status::{
    ConfigurationReport, InForce, LogStatus, Pending, ScanProgress, ScanningReport, Status,
    SubscriberReport,
};
pub use survey::{
    MAX_SURVEY_SCENES, MAX_SURVEYED_SWEEPS, MAX_UPLOADED_BEAMS, SurveyEvent, SurveyReport,
    SurveyRequest, UploadedSweep,
};

// Types of the API that the model crates define.
pub use sonard_interpret::compare::{AnnotatedPing, Annotations, Classification};
pub use sonard_inverse::{Misfit, PoseMode};
pub use sonard_records::{Body, Circle, FloorPlan, PeakLine, PlanPoint, TraceLine, WallLine};

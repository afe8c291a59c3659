//! Scans: the plan, the readings, and the records they are logged as.

mod plan;
mod record;
mod view;

pub use plan::{PlanError, ScanPlan};
pub use record::{
    AirRecord, Device, Event, EventKind, LOG_FORMAT, ModelRecord, PathKind, PathRecord, Ping,
    PingStatus, Provenance, Record, ScanEnd, ScanStart, SceneRef, Session, SimRecord,
};
pub use view::ScanView;

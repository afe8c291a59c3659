//! Records of scans: sessions, plans, readings, and their log format.

// Modules are `foo.rs` next to `foo/`.
#![warn(clippy::mod_module_files)]

mod array;
mod codec;
mod conversions;
mod floor_plan;
mod path;
mod peak;
mod polyline;
mod record;
mod remaining;
mod session;
mod simulated;
mod sink;
pub mod text;
mod trace;
mod view;
mod viewpoint;

pub use codec::{
    EncodeError, MAX_LINE_BYTES, RecordError, RecordErrorKind, decode_line, encode_line,
};
pub use floor_plan::{Body, Circle, FloorPlan, PlanPoint, WallLine};
pub use path::{InteractionKind, InteractionRecord, PathRecord, Point};
pub use peak::PeakLine;
pub use record::{
    AirSource, CrosstalkRecord, Event, EventKind, Ping, Record, STOPPED_ON_REQUEST, ScanAir,
    ScanEnd, ScanStart, SimRecord,
};
pub use remaining::BeamRun;
pub use session::{
    AirRecord, Build, CollectionRef, Device, ImportRef, LOG_FORMAT, ModelRecord, Provenance,
    SceneRef, Session,
};
pub use sink::{Sink, SinkError};
pub use sonard_model::{
    reading::{PathKind, PingStatus},
    scan_plan::{PlanError, ScanPlan},
};
pub use trace::TraceLine;
pub use view::ScanView;

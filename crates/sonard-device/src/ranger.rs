//! Protocol driver of a ranger: [`Driver`] runs the host state machine on a serial line,
//! [`Ranger`] takes scans through it.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod clock;
mod device_info;
mod driver;
mod duration;
mod scan_job;
mod scan_recorder;
mod scanner;
mod settings;
mod setup;
mod timing;
mod wall_clock;

pub use clock::{ClockFit, HostTime, TickExtender};
pub use device_info::{device_record, provenance, serial_text};
pub use driver::{CommandResult, DriveError, Driver};
pub use duration::ScanDuration;
pub use scan_job::ScanJob;
pub use scanner::{DeviceEvent, Ranger, ScanError, ScanSummary};
pub use settings::{BlankingError, Motion, ReceiverTiming, WindowTooShort, check_blanking, hold_s};
pub use setup::{PrepareError, PreparedScan, ScanInputs};
pub use timing::min_duration_s;

//! Drives a ranger over its protocol: [`Driver`] pumps the host machine on a line, [`Ranger`]
//! takes scans with it.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod budget;
mod clock;
mod driver;
mod introduction;
mod job;
mod prepared;
mod progress;
mod scanner;
mod settings;
mod timing;
mod wall_clock;

pub use budget::Budget;
pub use clock::{ClockFit, HostTime, TickExtender};
pub use driver::{DriveError, Driver, Ended};
pub use introduction::{device_record, provenance, serial_text};
pub use job::ScanJob;
pub use prepared::{PrepareError, PreparedScan, ScanInputs};
pub use scanner::{Ranger, ScanError, ScanSummary, Unasked};
pub use settings::{BlankingError, DeafWindow, Listening, Motion, check_blanking, hold_s};
pub use timing::limit_s;

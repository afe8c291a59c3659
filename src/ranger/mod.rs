//! Drives a ranger over its protocol: [`Driver`] pumps the host machine on a line, [`Ranger`]
//! takes scans with it.

mod clock;
mod driver;
mod job;
mod progress;
mod scanner;
mod timing;

pub use clock::{ClockFit, HostTime, TickExtender};
pub use driver::{DriveError, Driver, Ended};
pub use job::ScanJob;
pub use progress::Sink;
pub use scanner::{Ranger, ScanError, ScanSummary};
pub use timing::limit_s;

//! The logs of many daemons in one folder: `FOLDER/ROBOT/sonard-TIME.jsonl`, record by record as the daemon has them.
//!
//! A [`Ledger`] says how far each log was taken. It is written once the records before it are on the disk, and what
//! stands behind it is cut off: gathering that was killed goes on where it stood. [`Sieve`] and [`settle`] are pure.

mod body;
mod crew;
mod ledger;
mod pull;
mod settle;
mod shelf;
mod sieve;

pub use crew::{Choices, Crew, Report};
pub use ledger::{LEDGER, Ledger, Taken};
pub use pull::{PullError, Tally, Watcher};
pub use settle::{Claim, settle};
pub use shelf::{Shelf, ShelfError};
pub use sieve::{Refusal, Sieve, Sifted};

/// Whether a folder is one robot's part of what was gathered.
#[must_use]
pub fn is_of_robot(folder: &std::path::Path) -> bool {
    folder.join(LEDGER).is_file()
}

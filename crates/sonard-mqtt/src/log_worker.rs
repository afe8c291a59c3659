//! What the courier asks of the disk, in a thread: disks block.

use std::{io, path::PathBuf};

use tokio::task::{JoinError, JoinHandle, spawn_blocking};

use super::{
    bookmark::Bookmark,
    tail::{Piece, Tail},
    window::LogPosition,
};

/// What is asked.
#[derive(Debug, Default)]
pub(super) struct Errand {
    /// Read on, so many bytes.
    pub(super) read: Option<usize>,
    /// Remember this place.
    pub(super) remember: Option<LogPosition>,
    /// Say how much stands behind this place.
    pub(super) behind: Option<LogPosition>,
}

/// What came of it.
#[derive(Debug)]
pub(super) struct Outcome {
    pub(super) piece: Option<io::Result<Piece>>,
    pub(super) remembered: Option<(LogPosition, io::Result<()>)>,
    pub(super) behind_bytes: Option<u64>,
}

/// The logs and the place in them. One errand is run at a time.
#[derive(Debug)]
pub(super) struct LogSide {
    pub(super) tail: Tail,
    pub(super) folder: PathBuf,
}

impl LogSide {
    /// Runs an errand, and comes back with what came of it.
    pub(super) fn run(mut self, errand: Errand) -> JoinHandle<(Self, Outcome)> {
        spawn_blocking(move || {
            let outcome = self.carry_out(errand);
            (self, outcome)
        })
    }

    fn carry_out(&mut self, errand: Errand) -> Outcome {
        let remember = |place: LogPosition| {
            let written = Bookmark::write(&self.folder, &place);
            (place, written)
        };
        let remembered = errand.remember.map(remember);
        let piece = errand.read.map(|bytes| self.tail.read(bytes));
        let behind_bytes = errand.behind.and_then(|place| self.tail.behind(&place).ok());
        Outcome { piece, remembered, behind_bytes }
    }
}

/// An errand under way.
pub(super) type Errands = JoinHandle<(LogSide, Outcome)>;

/// What came of the errand under way; never, if there is none. Cancel-safe.
pub(super) async fn back(errand: &mut Option<Errands>) -> Result<(LogSide, Outcome), JoinError> {
    match errand {
        Some(errand) => errand.await,
        None => std::future::pending().await,
    }
}

//! Disk access of the publisher on a blocking thread.

use std::{io, path::PathBuf};

use tokio::task::{JoinError, JoinHandle, spawn_blocking};

use super::{
    checkpoint::LogCheckpoint,
    in_flight::LogPosition,
    tail::{Tail, TailChunk},
};

/// Disk operations to perform.
#[derive(Debug, Default)]
pub(super) struct LogJob {
    /// Number of bytes to read from the log.
    pub(super) read: Option<usize>,
    /// Position to write to the checkpoint file.
    pub(super) checkpoint: Option<LogPosition>,
    /// Position after which the unread bytes are counted.
    pub(super) behind: Option<LogPosition>,
}

/// Results of the requested disk operations.
#[derive(Debug)]
pub(super) struct LogJobResult {
    pub(super) chunk: Option<io::Result<TailChunk>>,
    pub(super) checkpoint: Option<(LogPosition, io::Result<()>)>,
    pub(super) behind_bytes: Option<u64>,
}

/// Log reader that runs one job at a time.
#[derive(Debug)]
pub(super) struct LogWorker {
    pub(super) tail: Tail,
    pub(super) folder: PathBuf,
}

impl LogWorker {
    /// Runs a job on a blocking thread; the worker is returned with the result.
    pub(super) fn run(mut self, job: LogJob) -> JoinHandle<(Self, LogJobResult)> {
        spawn_blocking(move || {
            let result = self.execute(job);
            (self, result)
        })
    }

    fn execute(&mut self, job: LogJob) -> LogJobResult {
        let write = |position: LogPosition| {
            let written = LogCheckpoint::write(&self.folder, &position);
            (position, written)
        };
        let checkpoint = job.checkpoint.map(write);
        let chunk = job.read.map(|bytes| self.tail.read(bytes));
        let behind_bytes = job.behind.and_then(|position| self.tail.behind(&position).ok());
        LogJobResult { chunk, checkpoint, behind_bytes }
    }
}

/// Handle of a running job.
pub(super) type RunningLogJob = JoinHandle<(LogWorker, LogJobResult)>;

/// Waits for the running job; pending forever if there is none. Cancel-safe.
pub(super) async fn wait_for_job(
    job: &mut Option<RunningLogJob>,
) -> Result<(LogWorker, LogJobResult), JoinError> {
    match job {
        Some(job) => job.await,
        None => std::future::pending().await,
    }
}

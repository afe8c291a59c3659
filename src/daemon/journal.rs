//! The task that owns the log: a thread, because disks block.
//!
//! What can't be written waits in memory, in order, until it can: whoever measures is told and
//! stops, so that little comes after.

use std::{
    collections::VecDeque,
    path::Path,
    sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use jiff::Timestamp;
use tokio::sync::watch;

use crate::{
    api::LogStatus,
    scan::{Event, EventKind, Record, Sink, SinkError},
    store::{LogFolder, Rotation, StoreError},
};

/// Records on their way to the thread.
const QUEUE: usize = 4096;
/// How soon after the last record it is looked whether a sync is due.
const SYNC_CHECK: Duration = Duration::from_millis(500);
const RETRY_MIN: Duration = Duration::from_millis(250);
const RETRY_MAX: Duration = Duration::from_secs(10);

enum Entry {
    Record(Box<Record>),
    Rotation(Rotation),
    Close,
}

/// The way to the log for whoever has records.
#[derive(Debug, Clone)]
pub struct Journal {
    entries: SyncSender<Entry>,
    status: watch::Receiver<LogStatus>,
}

/// The thread, to be waited for at the end.
#[derive(Debug)]
pub struct JournalThread {
    entries: SyncSender<Entry>,
    thread: JoinHandle<LogStatus>,
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Record(_) => "Record",
            Self::Rotation(_) => "Rotation",
            Self::Close => "Close",
        })
    }
}

impl Journal {
    /// Opens the log of `folder` and starts the thread that writes it.
    ///
    /// # Errors
    /// When the log can't be opened at all: a daemon without a log would measure in vain.
    pub fn open(folder: &Path, rotation: Rotation) -> Result<(Self, JournalThread), StoreError> {
        let log = LogFolder::open(folder, rotation, Timestamp::now())?;
        let (entries, incoming) = sync_channel(QUEUE);
        let first = LogStatus { file: Some(log.path().into()), ..LogStatus::default() };
        let (status, watched) = watch::channel(first);
        let writer = Writer {
            log,
            waiting: VecDeque::new(),
            written: 0,
            retry: RETRY_MIN,
            retry_at: None,
            status,
        };
        let thread = thread::Builder::new()
            .name("journal".into())
            .spawn(move || writer.run(&incoming))
            .map_err(|source| StoreError::Open { path: folder.into(), source })?;
        Ok((Self { entries: entries.clone(), status: watched }, JournalThread { entries, thread }))
    }

    /// Hands a record over. Waits only if thousands are under way, as with a disk that hangs.
    pub fn record(&self, record: &Record) {
        match self.entries.try_send(Entry::Record(Box::new(record.clone()))) {
            Err(TrySendError::Full(entry)) => {
                // The thread lives as long as this handle; without it there is no log to miss.
                tokio::task::block_in_place(|| drop(self.entries.send(entry)));
            }
            Ok(()) | Err(TrySendError::Disconnected(_)) => {}
        }
    }

    /// An event, now.
    pub fn event(&self, kind: EventKind, detail: String) {
        self.record(&Record::Event(Event { time: Timestamp::now(), kind, detail }));
    }

    /// Other limits from the next scan on.
    pub fn set_rotation(&self, rotation: Rotation) {
        // As for `record`.
        drop(self.entries.try_send(Entry::Rotation(rotation)));
    }

    /// What the log is doing.
    #[must_use]
    pub fn status(&self) -> LogStatus {
        self.status.borrow().clone()
    }

    /// Records that are in the log since it was opened.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.status.borrow().written
    }

    /// Whether records can be written.
    #[must_use]
    pub fn is_well(&self) -> bool {
        self.status.borrow().error.is_none()
    }

    /// Ready when the log begins or ceases to be in trouble.
    pub async fn changed(&mut self) {
        if self.status.changed().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}

impl JournalThread {
    /// Brings everything to the disk, ends the thread, and says how it went.
    pub fn close(self) -> LogStatus {
        // A thread that is gone has nothing left to close.
        let _ = self.entries.send(Entry::Close);
        self.thread.join().unwrap_or_default()
    }
}

/// Takes records for the log.
impl Sink for Journal {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        Self::record(self, record);
        Ok(())
    }
}

struct Writer {
    log: LogFolder,
    waiting: VecDeque<Box<Record>>,
    written: u64,
    /// Wait from try to try, and when the next one is due, while in trouble.
    retry: Duration,
    retry_at: Option<Instant>,
    status: watch::Sender<LogStatus>,
}

impl Writer {
    fn run(mut self, incoming: &Receiver<Entry>) -> LogStatus {
        loop {
            match incoming.recv_timeout(self.patience()) {
                Ok(Entry::Record(record)) => self.waiting.push_back(record),
                Ok(Entry::Rotation(rotation)) => self.log.set_rotation(rotation),
                Err(RecvTimeoutError::Timeout) => {}
                Ok(Entry::Close) | Err(RecvTimeoutError::Disconnected) => return self.finish(),
            }
            // While in trouble, only time brings another try, however many records come.
            if self.retry_at.is_none_or(|at| at <= Instant::now()) {
                self.write();
            }
        }
    }

    /// How long nothing may come before there is something to do.
    fn patience(&self) -> Duration {
        match self.retry_at {
            Some(at) => at.saturating_duration_since(Instant::now()),
            None if self.log.synced() < self.written => SYNC_CHECK,
            None => Duration::from_secs(3600),
        }
    }

    /// Writes what waits, as far as it goes.
    fn write(&mut self) {
        let outcome = self.write_waiting();
        self.retry_at = outcome.is_err().then(|| Instant::now() + self.retry);
        self.retry = if outcome.is_ok() { RETRY_MIN } else { (self.retry * 2).min(RETRY_MAX) };
        self.tell(outcome.err().map(|error| format!("{error}; {}", error.help())));
    }

    fn write_waiting(&mut self) -> Result<(), StoreError> {
        while let Some(record) = self.waiting.front() {
            let outcome = match self.log.append(record, Timestamp::now()) {
                Ok(()) => Ok(()),
                // It is in the log, though not safely.
                Err(error @ StoreError::Sync { .. }) => Err(error),
                Err(error @ StoreError::Record { .. }) => {
                    // Nobody can ever write this one: it must not hold up the others.
                    tracing::error!("a record is left out: {error}");
                    Ok(())
                }
                Err(error) => return Err(error),
            };
            self.waiting.pop_front();
            self.written += 1;
            outcome?;
        }
        self.log.sync_if_due()
    }

    fn tell(&mut self, error: Option<String>) {
        let (written, synced, waiting) = (self.written, self.log.synced(), self.waiting.len());
        let path = self.log.path();
        self.status.send_if_modified(|status| {
            if status.file.as_deref() != Some(path) {
                status.file = Some(path.into());
            }
            let changed = status.error.is_some() != error.is_some();
            (status.written, status.synced) = (written, synced);
            (status.waiting, status.error) = (waiting, error);
            changed
        });
    }

    fn finish(mut self) -> LogStatus {
        self.write();
        let mut last = self.status.borrow().clone();
        match self.log.close() {
            Ok(()) => last.synced = last.written,
            Err(error) => last.error = Some(format!("{error}; {}", error.help())),
        }
        last
    }
}

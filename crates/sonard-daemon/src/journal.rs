//! Writer of the log: a thread, because disks block.
//!
//! Records that can't be written are kept in memory, in order, until they can be. Scanning pauses
//! meanwhile, so that few follow. A separate task reports a slow write or sync while it lasts.

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, AtomicUsize, Ordering},
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use jiff::Timestamp;
use sonard_api::LogStatus;
use sonard_log::{LogFolder, Rotation, StoreError};
use sonard_records::{Event, EventKind, Record, Sink, SinkError};
use sonard_runtime::{
    backoff::Backoff,
    supervisor::{Supervisor, Task},
};
use tokio::sync::watch;

/// Queue length from which publishing waits, and scanning pauses if the disk does not respond.
const QUEUE: usize = 4096;
/// Maximum wait of a publisher for a place in the queue. A disk that hangs for longer pauses
/// scanning instead.
const QUEUE_TIMEOUT: Duration = Duration::from_secs(1);
/// Interval at which a waiting publisher looks for a place in the queue.
const QUEUE_POLL: Duration = Duration::from_millis(2);
/// Delay after the last record until the need for a sync is examined.
const SYNC_CHECK: Duration = Duration::from_millis(500);
/// Interval at which the open file is compared with the one that its path names.
const FILE_CHECK: Duration = Duration::from_secs(2);
const RETRY: Backoff = Backoff::new(Duration::from_millis(250), Duration::from_secs(10));
/// Time without a failure after which the next one is retried as soon as a first one.
const CALM: Duration = Duration::from_secs(60);
/// Duration of a write or sync from which it is reported.
const STALL: Duration = Duration::from_secs(5);
/// Interval at which the duration of a write or sync is examined.
const STALL_CHECK: Duration = Duration::from_millis(500);
/// Time during which a log that had to be replaced counts against the daemon's health.
const INCIDENT_TIME: Duration = Duration::from_secs(30);
/// Time allowed for the last sync at the end of the daemon.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(15);

enum JournalEntry {
    Record(Box<Record>),
    Rotation(Rotation),
    /// Request for a message once the entries before it are written.
    Flush(Sender<()>),
    Close,
}

/// Access to the log for the tasks that publish records. Clones share it.
#[derive(Debug, Clone)]
pub struct Journal {
    entries: Sender<JournalEntry>,
    status: watch::Receiver<LogStatus>,
    progress: Arc<WriteProgress>,
}

/// Handle of the log's thread, to be closed at the end.
#[derive(Debug)]
pub struct JournalThread {
    entries: Sender<JournalEntry>,
    thread: JoinHandle<Option<LogStatus>>,
    status: watch::Receiver<LogStatus>,
    progress: Arc<WriteProgress>,
}

/// Progress of the thread, which other tasks examine while it blocks.
#[derive(Debug)]
struct WriteProgress {
    epoch: Instant,
    /// Start of the write or sync under way, microseconds since the epoch; 0 for none.
    began_us: AtomicU64,
    /// Entries queued for the thread.
    queued: AtomicUsize,
}

impl WriteProgress {
    fn new() -> Self {
        Self { epoch: Instant::now(), began_us: AtomicU64::new(0), queued: AtomicUsize::new(0) }
    }

    fn begin(&self) {
        let us = u64::try_from(self.epoch.elapsed().as_micros()).unwrap_or(u64::MAX);
        self.began_us.store(us.max(1), Ordering::Relaxed);
    }

    fn end(&self) {
        self.began_us.store(0, Ordering::Relaxed);
    }

    /// Duration of the write or sync under way.
    fn busy(&self) -> Option<Duration> {
        let began_us = self.began_us.load(Ordering::Relaxed);
        let began = Duration::from_micros(began_us);
        (began_us > 0).then(|| self.epoch.elapsed().saturating_sub(began))
    }

    /// Duration of the write or sync under way, if it takes too long.
    fn stalled(&self) -> Option<Duration> {
        self.busy().filter(|busy| *busy >= STALL)
    }

    fn is_full(&self) -> bool {
        self.queued.load(Ordering::Relaxed) >= QUEUE
    }
}

impl std::fmt::Debug for JournalEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Record(_) => "Record",
            Self::Rotation(_) => "Rotation",
            Self::Flush(_) => "Flush",
            Self::Close => "Close",
        })
    }
}

impl Journal {
    /// Opens the log of `folder` and starts the thread that writes it. Must be called within a
    /// tokio runtime.
    ///
    /// # Errors
    /// When the log can't be opened at all: a daemon without a log would measure in vain.
    pub fn open(
        folder: &Path,
        rotation: Rotation,
        supervisor: &Supervisor,
    ) -> Result<(Self, JournalThread), StoreError> {
        let log = LogFolder::open(folder, rotation, Timestamp::now())?;
        let (entries, incoming) = channel();
        let first = LogStatus { file: Some(log.path().into()), ..LogStatus::default() };
        let (sender, status) = watch::channel(first);
        let progress = Arc::new(WriteProgress::new());
        let writer = JournalWriter {
            log,
            waiting: VecDeque::new(),
            retry: RETRY,
            retry_at: None,
            failed_at: None,
            next_file_check: Instant::now() + FILE_CHECK,
            incident: None,
            status: sender.clone(),
            progress: Arc::clone(&progress),
        };
        let thread = supervisor
            .spawn_thread(Task::Log, move || writer.run(&incoming))
            .map_err(|source| StoreError::Open { path: folder.into(), source })?;
        let watched = watch_stalls(Arc::clone(&progress), sender, folder.into());
        drop(supervisor.spawn_finite(Task::LogWatch, watched));
        let journal = Self {
            entries: entries.clone(),
            status: status.clone(),
            progress: Arc::clone(&progress),
        };
        Ok((journal, JournalThread { entries, thread, status, progress }))
    }

    /// Queues a record. A full queue delays the caller for a second at most;
    /// [`is_writable`](Self::is_writable) is then false.
    pub fn record(&self, record: &Record) {
        if self.progress.is_full() {
            let deadline = Instant::now() + QUEUE_TIMEOUT;
            crate::blocking::block_in_place(|| {
                while self.progress.is_full() && Instant::now() < deadline {
                    thread::sleep(QUEUE_POLL);
                }
            });
        }
        self.push(JournalEntry::Record(Box::new(record.clone())));
    }

    /// Queues an event with the current time.
    pub fn event(&self, kind: EventKind, detail: String) {
        self.record(&Record::Event(Event { time: Timestamp::now(), kind, detail }));
    }

    /// Sets the limits of log files, from the next scan on.
    pub fn set_rotation(&self, rotation: Rotation) {
        self.push(JournalEntry::Rotation(rotation));
    }

    /// Waits until the records queued so far are written, or an attempt to write them has failed.
    /// The wait is measured by the system's clock: the disk does not follow that of the runtime.
    pub async fn flush(&self, timeout: Duration) {
        let (done, flushed) = channel();
        self.push(JournalEntry::Flush(done));
        // A timeout is no error: callers examine the log.
        let waiting = tokio::task::spawn_blocking(move || flushed.recv_timeout(timeout).ok());
        drop(waiting.await);
    }

    /// Current state of the log.
    #[must_use]
    pub fn status(&self) -> LogStatus {
        let busy_s = self.progress.stalled().map(|busy| busy.as_secs_f64());
        let queued = self.progress.queued.load(Ordering::Relaxed);
        let status = self.status.borrow().clone();
        LogStatus { busy_s, waiting: status.waiting + queued, ..status }
    }

    /// Number of records written since the log was opened.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.status.borrow().written
    }

    /// Returns `true` if records can be written.
    #[must_use]
    pub fn is_writable(&self) -> bool {
        self.status.borrow().error.is_none()
    }

    fn push(&self, entry: JournalEntry) {
        self.progress.queued.fetch_add(1, Ordering::Relaxed);
        // A thread that has ended was reported by the supervisor.
        drop(self.entries.send(entry));
    }

    /// Completes when the log begins to fail, or can be written again.
    pub async fn changed(&mut self) {
        if self.status.changed().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}

impl JournalThread {
    /// Writes and syncs all records, ends the thread, and returns the last state. Blocks, for at
    /// most `CLOSE_TIMEOUT` if the disk hangs.
    #[must_use]
    pub fn close(self) -> LogStatus {
        // A thread that has ended was reported by the supervisor.
        let _ = self.entries.send(JournalEntry::Close);
        let deadline = Instant::now() + CLOSE_TIMEOUT;
        while !self.thread.is_finished() && Instant::now() < deadline {
            thread::sleep(Duration::from_millis(5));
        }
        if self.thread.is_finished() {
            return self.thread.join().ok().flatten().unwrap_or_default();
        }
        let status = self.status.borrow().clone();
        let queued = self.progress.queued.load(Ordering::Relaxed);
        let unsynced = status.written - status.synced - status.uncertain;
        let busy_s = self.progress.busy().unwrap_or_default().as_secs_f64();
        let waiting = status.waiting + queued;
        let error = format!(
            "the disk has not responded for {busy_s:.0} s: {unsynced} record(s) written but not synced, \
             {waiting} not written"
        );
        LogStatus { error: Some(error), waiting, busy_s: Some(busy_s), ..status }
    }
}

/// Reports a disk that does not respond, for as long as the log's thread lives. Scanning pauses
/// once the queue is full.
async fn watch_stalls(
    progress: Arc<WriteProgress>,
    status: watch::Sender<LogStatus>,
    folder: PathBuf,
) {
    let mut is_reported = false;
    // The thread's sender and this one.
    while status.receiver_count() > 0 {
        tokio::time::sleep(STALL_CHECK).await;
        let stalled = progress.stalled();
        match stalled {
            Some(busy) if !is_reported => tracing::warn!(
                "the disk of {} does not respond: a write or sync has taken {:.0} s so far",
                folder.display(),
                busy.as_secs_f64()
            ),
            None if is_reported => tracing::info!("the disk responds again"),
            _ => {}
        }
        is_reported = stalled.is_some();
        if let Some(busy) = stalled.filter(|_| progress.is_full()) {
            let error = format!("the disk has not responded for {:.0} s", busy.as_secs_f64());
            status.send_if_modified(|status| status.error.replace(error).is_none());
        }
    }
}

/// Queues records; never fails.
impl Sink for Journal {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        Self::record(self, record);
        Ok(())
    }
}

struct JournalWriter {
    log: LogFolder,
    waiting: VecDeque<Box<Record>>,
    /// Wait between attempts after a failure.
    retry: Backoff,
    /// Time of the next attempt, after a failure.
    retry_at: Option<Instant>,
    /// Time of the last failure, until the log has been written without one for `CALM`.
    failed_at: Option<Instant>,
    next_file_check: Instant,
    /// Time and description of the last replacement of the log file.
    incident: Option<(Instant, String)>,
    status: watch::Sender<LogStatus>,
    progress: Arc<WriteProgress>,
}

impl JournalWriter {
    fn run(mut self, incoming: &Receiver<JournalEntry>) -> LogStatus {
        loop {
            let entry = incoming.recv_timeout(self.timeout());
            let received = usize::from(entry.is_ok());
            let mut flushing = None;
            match entry {
                Ok(JournalEntry::Record(record)) => self.waiting.push_back(record),
                Ok(JournalEntry::Rotation(rotation)) => self.log.set_rotation(rotation),
                Ok(JournalEntry::Flush(done)) => flushing = Some(done),
                Err(RecvTimeoutError::Timeout) => {}
                Ok(JournalEntry::Close) | Err(RecvTimeoutError::Disconnected) => {
                    return self.finish();
                }
            }
            // After a failure only time triggers the next attempt, however many records arrive.
            if self.retry_at.is_none_or(|at| at <= Instant::now()) {
                self.write();
            }
            // Counted until it is written or among the waiting ones.
            self.progress.queued.fetch_sub(received, Ordering::Relaxed);
            if let Some(done) = flushing {
                // The caller may have given up.
                done.send(()).ok();
            }
        }
    }

    /// Time until the next periodic task, if no entry arrives.
    fn timeout(&self) -> Duration {
        let check = self.next_file_check.saturating_duration_since(Instant::now());
        match self.retry_at {
            Some(at) => at.saturating_duration_since(Instant::now()),
            None if self.log.synced() + self.log.uncertain() < self.log.appended() => {
                check.min(SYNC_CHECK)
            }
            None => check,
        }
    }

    /// Writes the waiting records, as far as possible.
    fn write(&mut self) {
        self.progress.begin();
        let outcome = self.write_waiting();
        self.progress.end();
        self.schedule_retry(outcome.is_ok());
        if let Some(incident) = self.log.take_incident() {
            tracing::warn!("the log: {incident}");
            self.incident = Some((Instant::now(), incident));
        }
        self.publish(outcome.err().map(|error| format!("{error}; {}", error.help())));
    }

    /// Increases the wait with each failure. A success resets it only after `CALM`, so that an
    /// intermittent fault is not reported repeatedly.
    fn schedule_retry(&mut self, is_ok: bool) {
        let now = Instant::now();
        if is_ok {
            self.retry_at = None;
            if self.failed_at.is_some_and(|at| now.saturating_duration_since(at) >= CALM) {
                self.retry.reset();
                self.failed_at = None;
            }
        } else {
            self.retry_at = Some(now + self.retry.next_wait());
            self.failed_at = Some(now);
        }
    }

    fn write_waiting(&mut self) -> Result<(), StoreError> {
        if self.next_file_check <= Instant::now() {
            self.next_file_check = Instant::now() + FILE_CHECK;
            self.log.inspect(Timestamp::now())?;
        }
        while let Some(record) = self.waiting.front() {
            let outcome = match self.log.append(record, Timestamp::now()) {
                Ok(()) => Ok(()),
                // The record is in the log, but not synced.
                Err(error @ StoreError::Sync { .. }) => Err(error),
                Err(error @ StoreError::Record { .. }) => {
                    // A record that can never be written must not delay the next ones.
                    tracing::error!("a record was skipped: {error}");
                    Ok(())
                }
                Err(error) => return Err(error),
            };
            self.waiting.pop_front();
            outcome?;
        }
        self.log.sync_if_due(Timestamp::now())
    }

    fn publish(&mut self, error: Option<String>) {
        let (log, waiting) = (&self.log, self.waiting.len());
        let (written, synced, uncertain) = (log.appended(), log.synced(), log.uncertain());
        let incident = self.incident.take_if(|(at, _)| at.elapsed() >= INCIDENT_TIME);
        drop(incident);
        let incident = self.incident.as_ref().map(|(_, incident)| incident.clone());
        self.status.send_if_modified(|status| {
            if status.file.as_deref() != Some(log.path()) {
                status.file = Some(log.path().into());
            }
            let changed = status.error.is_some() != error.is_some();
            (status.written, status.synced, status.uncertain) = (written, synced, uncertain);
            (status.waiting, status.error, status.incident) = (waiting, error, incident);
            changed
        });
    }

    fn finish(mut self) -> LogStatus {
        self.write();
        let failed = self.status.borrow().error.clone();
        self.progress.begin();
        let closed = self.log.close(Timestamp::now());
        if let Some(incident) = self.log.take_incident() {
            tracing::warn!("the log: {incident}");
        }
        self.publish(None);
        let mut last = self.status.borrow().clone();
        last.error = match (failed, closed) {
            (_, Err(error)) => Some(format!("{error}; {}", error.help())),
            (Some(error), Ok(())) if last.waiting > 0 => {
                Some(format!("{} record(s) could not be written: {error}", last.waiting))
            }
            (_, Ok(())) => None,
        };
        last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flush returns after the records before it, even if the runtime's clock skips all waits.
    #[tokio::test(start_paused = true)]
    async fn flush_waits_for_earlier_records() {
        let folder = tempfile::tempdir().expect("a folder");
        let supervisor = Supervisor::default();
        let sync_interval = Duration::from_secs(2);
        let rotation = Rotation { max_bytes: 1 << 20, daily: true, keep_bytes: 0, sync_interval };
        let (journal, thread) = Journal::open(folder.path(), rotation, &supervisor).expect("opens");
        for round in 1..=20 {
            for number in 0..50 {
                journal.event(EventKind::Explanation, format!("{round}, {number}"));
            }
            journal.flush(Duration::from_secs(60)).await;
            assert_eq!(journal.written(), round * 50);
            assert_eq!(journal.status().waiting, 0);
        }
        assert_eq!(thread.close().error, None);
    }
}

//! Record broadcast. Ring buffers bounded by count and bytes are shared by all subscribers, and
//! publishing never blocks.
//!
//! A subscriber is a position in the buffers. When a buffer overflows, the oldest readings are
//! dropped, and each lagging subscriber receives a `dropped` line with their number. Scan starts,
//! scan ends and events have no gaps: a subscriber that missed one is disconnected.

mod deadband;
mod ring;
mod subscribers;

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicU64, AtomicUsize, Ordering},
};

use sonard_api::Annotations;
use sonard_records::{PingStatus, Record, ScanStart, ScanView, Session, encode_line};
use tokio::sync::watch;
use uuid::Uuid;

use super::annotate::annotated_line;
pub use deadband::DeadbandFilter;
pub(crate) use ring::Ring;
pub use subscribers::ClientGuard;
use subscribers::{CountGuard, SubscriberCounts};

/// Upper bound of the buffered readings, bytes.
const MAX_READING_BYTES: usize = 4 << 20;
/// Maximum number of buffered records other than readings, and of buffered scan ids.
const MAX_CONTROLS: usize = 1024;
/// Upper bound of the buffered records other than readings, bytes.
const MAX_CONTROL_BYTES: usize = 4 << 20;

/// Filter and format of a subscription.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SubscriptionFilter {
    /// Deadband of the range, metres: a reading is sent only if its range differs by more from the
    /// last one sent in its direction, or its status changed. `None` sends all readings.
    pub deadband_m: Option<f64>,
    /// Adds verdict and viewpoint ([`Annotations`]) to each reading.
    pub verdicts: bool,
}

/// Line of a stream: a JSON text with its newline, shared by all subscribers.
pub type StreamLine = Arc<[u8]>;

/// Broadcast of records and finished scans to subscribers. Cheap to clone; clones share their
/// state.
#[derive(Debug, Clone)]
pub struct Hub {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    buffers: Mutex<Buffers>,
    scan: Mutex<RunningScan>,
    /// Notifies subscribers of new records.
    records: watch::Sender<()>,
    /// Notifies subscribers of finished scans.
    scans: watch::Sender<()>,
    subscribers: AtomicUsize,
    /// Subscriptions to records, including those of the daemon's own outputs.
    record_subscribers: AtomicUsize,
    /// Subscriptions to records with verdicts.
    verdict_subscribers: AtomicUsize,
    dropped: AtomicU64,
    cut_off: AtomicU64,
}

/// Context of the readings, tracked from the records so that it is known in mid-scan.
#[derive(Debug, Default)]
struct RunningScan {
    session: Option<Arc<Session>>,
    /// Running scan, without its readings.
    view: Option<ScanView>,
}

#[derive(Debug)]
struct Buffers {
    readings: Ring<BufferedReading>,
    controls: Ring<BufferedControl>,
    scans: Ring<Uuid>,
    closed: bool,
}

#[derive(Debug)]
struct BufferedReading {
    line: StreamLine,
    /// Line with verdict and viewpoint, if a subscriber requested them.
    annotated: Option<StreamLine>,
    step: i32,
    ranger: Option<Box<str>>,
    status: PingStatus,
    range_m: Option<f64>,
}

#[derive(Debug)]
struct BufferedControl {
    line: StreamLine,
    /// Number of the first reading after this record.
    before: u64,
}

impl Hub {
    /// Creates a hub that buffers up to `readings` readings for slow subscribers.
    #[must_use]
    pub fn new(readings: usize) -> Self {
        let buffers = Buffers {
            readings: Ring::new(readings, MAX_READING_BYTES),
            controls: Ring::new(MAX_CONTROLS, MAX_CONTROL_BYTES),
            scans: Ring::new(MAX_CONTROLS, MAX_CONTROL_BYTES),
            closed: false,
        };
        let inner = Inner {
            buffers: Mutex::new(buffers),
            scan: Mutex::default(),
            records: watch::Sender::new(()),
            scans: watch::Sender::new(()),
            subscribers: AtomicUsize::new(0),
            record_subscribers: AtomicUsize::new(0),
            verdict_subscribers: AtomicUsize::new(0),
            dropped: AtomicU64::new(0),
            cut_off: AtomicU64::new(0),
        };
        Self { inner: Arc::new(inner) }
    }

    /// Subscribes a client to records, from the next one on.
    #[must_use]
    pub fn subscribe(&self, wanted: SubscriptionFilter) -> Subscription {
        let verdicts = usize::from(wanted.verdicts);
        self.subscribe_counted(wanted, SubscriberCounts { subscribers: 1, records: 1, verdicts })
    }

    /// Subscribes an output of the daemon itself to all records, without counting it as a client.
    #[must_use]
    pub fn follow(&self) -> Subscription {
        self.subscribe_counted(
            SubscriptionFilter::default(),
            SubscriberCounts { records: 1, ..SubscriberCounts::default() },
        )
    }

    fn subscribe_counted(
        &self,
        wanted: SubscriptionFilter,
        counts: SubscriberCounts,
    ) -> Subscription {
        let guard = CountGuard::new(self, counts);
        let changed = self.inner.records.subscribe();
        let buffers = lock(&self.inner.buffers);
        Subscription {
            reading: buffers.readings.end(),
            control: buffers.controls.end(),
            wanted,
            moved: DeadbandFilter::new(wanted.deadband_m),
            changed,
            guard,
        }
    }

    /// Counts a client served through a [`follow`](Self::follow) subscription, until the returned
    /// value is dropped.
    #[must_use]
    pub fn register_client(&self) -> ClientGuard {
        ClientGuard::new(self)
    }

    /// Subscribes a client to the ids of finished scans, from the next one on.
    #[must_use]
    pub fn subscribe_scans(&self) -> ScanSubscription {
        let counts = SubscriberCounts { subscribers: 1, ..SubscriberCounts::default() };
        let changed = self.inner.scans.subscribe();
        let scan = lock(&self.inner.buffers).scans.end();
        ScanSubscription { scan, changed, guard: CountGuard::new(self, counts) }
    }

    /// Publishes a record to all subscribers. Never blocks.
    pub fn publish(&self, record: &Record) {
        lock(&self.inner.scan).update(record);
        if self.inner.record_subscribers.load(Ordering::Relaxed) == 0 {
            return;
        }
        let mut line = Vec::new();
        if encode_line(record, &mut line).is_err() {
            // The log rejects this record as well, and reports it.
            return;
        }
        if let Record::Ping(ping) = record {
            let wants_verdicts = self.inner.verdict_subscribers.load(Ordering::Relaxed) > 0;
            let annotations = || Annotations::for_ping(ping, lock(&self.inner.scan).view.as_ref());
            let annotated: Option<StreamLine> =
                wants_verdicts.then(|| annotated_line(&line, &annotations()).into());
            let bytes = line.len() + annotated.as_ref().map_or(0, |line| line.len());
            let reading = BufferedReading {
                line: line.into(),
                annotated,
                step: ping.step,
                ranger: ping.ranger.as_deref().map(Box::from),
                status: ping.status,
                range_m: ping.range_m,
            };
            lock(&self.inner.buffers).readings.push(bytes, reading);
        } else {
            let mut buffers = lock(&self.inner.buffers);
            let (bytes, before) = (line.len(), buffers.readings.end());
            buffers.controls.push(bytes, BufferedControl { line: line.into(), before });
        }
        self.inner.records.send_replace(());
    }

    /// Publishes the id of a finished scan.
    pub fn publish_scan(&self, scan: Uuid) {
        lock(&self.inner.buffers).scans.push(size_of::<Uuid>(), scan);
        self.inner.scans.send_replace(());
    }

    /// Ends every subscription after its buffered lines.
    pub fn close(&self) {
        lock(&self.inner.buffers).closed = true;
        self.inner.records.send_replace(());
        self.inner.scans.send_replace(());
    }

    /// Returns `true` once the hub is closed.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        lock(&self.inner.buffers).closed
    }

    /// Current number of clients.
    #[must_use]
    pub fn subscribers(&self) -> usize {
        self.inner.subscribers.load(Ordering::Relaxed)
    }

    /// Total number of readings dropped for slow subscribers.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.inner.dropped.load(Ordering::Relaxed)
    }

    /// Total number of clients disconnected because they did not read.
    #[must_use]
    pub fn cut_off(&self) -> u64 {
        self.inner.cut_off.load(Ordering::Relaxed)
    }

    /// Counts a client disconnected by the server because its connection accepted no data.
    pub fn count_cut_off(&self) {
        self.inner.cut_off.fetch_add(1, Ordering::Relaxed);
    }
}

/// Receiving end of a subscription to records; dropping it unsubscribes.
#[derive(Debug)]
pub struct Subscription {
    /// Number of the next reading.
    reading: u64,
    /// Number of the next other record.
    control: u64,
    wanted: SubscriptionFilter,
    moved: DeadbandFilter,
    changed: watch::Receiver<()>,
    guard: CountGuard,
}

/// Next item of a subscription.
enum NextItem {
    Line(StreamLine),
    /// Reading within the deadband.
    Filtered,
    /// All buffered items were returned.
    Empty,
    End,
}

impl Subscription {
    /// Waits for the next line. Returns `None` at the end of the stream. Cancel-safe.
    pub async fn next(&mut self) -> Option<StreamLine> {
        loop {
            // A record published after this line completes `changed` below.
            self.changed.mark_unchanged();
            match self.poll_buffers() {
                NextItem::Line(line) => return Some(line),
                NextItem::Filtered => {}
                NextItem::Empty => self.changed.changed().await.ok()?,
                NextItem::End => return None,
            }
        }
    }

    fn poll_buffers(&mut self) -> NextItem {
        let inner = Arc::clone(&self.guard.hub().inner);
        let buffers = lock(&inner.buffers);
        if self.control < buffers.controls.first() {
            drop(buffers);
            inner.cut_off.fetch_add(1, Ordering::Relaxed);
            (self.reading, self.control) = (u64::MAX, u64::MAX);
            return NextItem::End;
        }
        let control = buffers.controls.get(self.control);
        let until = control.map_or(buffers.readings.end(), |control| control.before);
        if self.reading < until {
            let missed = buffers.readings.first().min(until).saturating_sub(self.reading);
            if missed > 0 {
                self.reading += missed;
                inner.dropped.fetch_add(missed, Ordering::Relaxed);
                let line = format!("{{\"type\":\"dropped\",\"readings\":{missed}}}\n");
                return NextItem::Line(line.into_bytes().into());
            }
            let Some(reading) = buffers.readings.get(self.reading) else { return NextItem::Empty };
            self.reading += 1;
            let (ranger, status) = (reading.ranger.as_deref(), reading.status);
            if !self.moved.pass(reading.step, ranger, status, reading.range_m) {
                return NextItem::Filtered;
            }
            let annotated = reading.annotated.as_ref().filter(|_| self.wanted.verdicts);
            return NextItem::Line(Arc::clone(annotated.unwrap_or(&reading.line)));
        }
        match control {
            Some(control) => {
                self.control += 1;
                NextItem::Line(Arc::clone(&control.line))
            }
            None if buffers.closed || self.control == u64::MAX => NextItem::End,
            None => NextItem::Empty,
        }
    }
}

impl RunningScan {
    fn update(&mut self, record: &Record) {
        match record {
            Record::Session(session) => self.session = Some(Arc::from(session.clone())),
            Record::ScanStart(start) => self.view = Some(self.begin(start)),
            Record::Ping(_) | Record::ScanEnd(_) | Record::Event(_) => {}
        }
    }

    fn begin(&self, start: &ScanStart) -> ScanView {
        ScanView {
            scan: start.scan,
            session: self.session.clone(),
            start: Some(start.clone()),
            pings: Vec::new(),
            events: Vec::new(),
            end: None,
        }
    }
}

/// Receiving end of a subscription to finished scans; dropping it unsubscribes.
#[derive(Debug)]
pub struct ScanSubscription {
    scan: u64,
    changed: watch::Receiver<()>,
    guard: CountGuard,
}

impl ScanSubscription {
    /// Waits for the id of the next finished scan. Returns `None` at the end of the stream.
    /// Cancel-safe.
    pub async fn next(&mut self) -> Option<Uuid> {
        loop {
            self.changed.mark_unchanged();
            {
                let buffers = lock(&self.guard.hub().inner.buffers);
                if self.scan < buffers.scans.first() {
                    self.guard.hub().count_cut_off();
                    return None;
                }
                if let Some(scan) = buffers.scans.get(self.scan) {
                    self.scan += 1;
                    return Some(*scan);
                }
                if buffers.closed {
                    return None;
                }
            }
            self.changed.changed().await.ok()?;
        }
    }
}

/// Locks a mutex. No code under these locks can panic, so a poisoned value is valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;

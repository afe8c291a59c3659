//! Hands records to subscribers. What waits for them is kept once for all, within a bound in bytes,
//! and nobody waits for anybody.
//!
//! A subscriber is no more than its place in what waits. A shelf that is full drops its oldest: how many
//! readings a subscriber missed by that is told in their place. Scan starts, scan ends and events are
//! told without a gap: a subscriber that missed one is cut off.

mod counted;
mod moved;
mod shelf;

use std::sync::{
    Arc, Mutex, MutexGuard, PoisonError,
    atomic::{AtomicU64, AtomicUsize, Ordering},
};

use sonard_api::Beside;
use sonard_records::{PingStatus, Record, ScanStart, ScanView, Session, encode_line};
use tokio::sync::watch;
use uuid::Uuid;

use super::judged::judged_line;
pub use counted::Attendance;
use counted::{Counted, Counts};
pub use moved::Moved;
pub(crate) use shelf::Shelf;

/// Most readings that wait, bytes.
const READING_BYTES: usize = 4 << 20;
/// Records other than readings that may wait, and scans that are over.
const CONTROLS: usize = 1024;
/// The same in bytes.
const CONTROL_BYTES: usize = 4 << 20;

/// The records that a subscriber wants.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wanted {
    /// Only readings whose range moved by more than this since it was last sent for that
    /// direction, metres, or whose status changed.
    pub moved_m: Option<f64>,
    /// Readings with what is told [beside](Beside) them.
    pub verdicts: bool,
}

/// One line of a stream: a JSON text with its newline. All subscribers share it.
pub type Line = Arc<[u8]>;

/// Hands records to subscribers. Cheap to clone: all clones are one hub.
#[derive(Debug, Clone)]
pub struct Hub {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    waiting: Mutex<Waiting>,
    scan: Mutex<UnderWay>,
    /// Changes with whatever records subscribers have to look at, and with whatever scans.
    records: watch::Sender<()>,
    scans: watch::Sender<()>,
    subscribers: AtomicUsize,
    /// Those of them who want records, and verdicts.
    of_records: AtomicUsize,
    of_verdicts: AtomicUsize,
    dropped: AtomicU64,
    cut_off: AtomicU64,
}

/// What readings are seen in, also those that somebody asks for in mid-scan.
#[derive(Debug, Default)]
struct UnderWay {
    session: Option<Arc<Session>>,
    /// The scan under way, without its readings.
    view: Option<ScanView>,
}

#[derive(Debug)]
struct Waiting {
    readings: Shelf<Reading>,
    controls: Shelf<Control>,
    scans: Shelf<Uuid>,
    closed: bool,
}

#[derive(Debug)]
struct Reading {
    line: Line,
    /// With what is told beside it, if somebody wanted that.
    judged: Option<Line>,
    step: i32,
    ranger: Option<Box<str>>,
    status: PingStatus,
    range_m: Option<f64>,
}

#[derive(Debug)]
struct Control {
    line: Line,
    /// Number of the reading that came after it.
    before: u64,
}

impl Hub {
    /// A hub that keeps so many readings for slow subscribers.
    #[must_use]
    pub fn new(readings: usize) -> Self {
        let waiting = Waiting {
            readings: Shelf::new(readings, READING_BYTES),
            controls: Shelf::new(CONTROLS, CONTROL_BYTES),
            scans: Shelf::new(CONTROLS, CONTROL_BYTES),
            closed: false,
        };
        let inner = Inner {
            waiting: Mutex::new(waiting),
            scan: Mutex::default(),
            records: watch::Sender::new(()),
            scans: watch::Sender::new(()),
            subscribers: AtomicUsize::new(0),
            of_records: AtomicUsize::new(0),
            of_verdicts: AtomicUsize::new(0),
            dropped: AtomicU64::new(0),
            cut_off: AtomicU64::new(0),
        };
        Self { inner: Arc::new(inner) }
    }

    /// Begins to listen for records.
    #[must_use]
    pub fn subscribe(&self, wanted: Wanted) -> Subscription {
        let verdicts = usize::from(wanted.verdicts);
        self.listen(wanted, Counts { subscribers: 1, of_records: 1, of_verdicts: verdicts })
    }

    /// Begins to listen for all records as a part of the daemon, which is no subscriber.
    #[must_use]
    pub fn follow(&self) -> Subscription {
        self.listen(Wanted::default(), Counts { of_records: 1, ..Counts::default() })
    }

    fn listen(&self, wanted: Wanted, counts: Counts) -> Subscription {
        let counted = Counted::new(self, counts);
        let changed = self.inner.records.subscribe();
        let waiting = held(&self.inner.waiting);
        Subscription {
            reading: waiting.readings.end(),
            control: waiting.controls.end(),
            wanted,
            moved: Moved::new(wanted.moved_m),
            changed,
            counted,
        }
    }

    /// Counts somebody as a subscriber whom a follower tells, until what is returned is dropped.
    #[must_use]
    pub fn attend(&self) -> Attendance {
        Attendance::new(self)
    }

    /// Begins to listen for scans that are over.
    #[must_use]
    pub fn subscribe_scans(&self) -> ScanSubscription {
        let counts = Counts { subscribers: 1, ..Counts::default() };
        let changed = self.inner.scans.subscribe();
        let scan = held(&self.inner.waiting).scans.end();
        ScanSubscription { scan, changed, counted: Counted::new(self, counts) }
    }

    /// Hands a record to everybody who wants records.
    pub fn publish(&self, record: &Record) {
        held(&self.inner.scan).follow(record);
        if self.inner.of_records.load(Ordering::Relaxed) == 0 {
            return;
        }
        let mut line = Vec::new();
        if encode_line(record, &mut line).is_err() {
            // The log refuses the same record and says so.
            return;
        }
        if let Record::Ping(ping) = record {
            let wants_verdicts = self.inner.of_verdicts.load(Ordering::Relaxed) > 0;
            let beside = || Beside::of(ping, held(&self.inner.scan).view.as_ref());
            let judged: Option<Line> = wants_verdicts.then(|| judged_line(&line, &beside()).into());
            let bytes = line.len() + judged.as_ref().map_or(0, |judged| judged.len());
            let reading = Reading {
                line: line.into(),
                judged,
                step: ping.step,
                ranger: ping.ranger.as_deref().map(Box::from),
                status: ping.status,
                range_m: ping.range_m,
            };
            held(&self.inner.waiting).readings.put(bytes, reading);
        } else {
            let mut waiting = held(&self.inner.waiting);
            let (bytes, before) = (line.len(), waiting.readings.end());
            waiting.controls.put(bytes, Control { line: line.into(), before });
        }
        self.inner.records.send_replace(());
    }

    /// Tells everybody who wants scans that one is over.
    pub fn publish_scan(&self, scan: Uuid) {
        held(&self.inner.waiting).scans.put(size_of::<Uuid>(), scan);
        self.inner.scans.send_replace(());
    }

    /// Ends every stream after what is waiting for it.
    pub fn close(&self) {
        held(&self.inner.waiting).closed = true;
        self.inner.records.send_replace(());
        self.inner.scans.send_replace(());
    }

    /// Whether every stream ends after what is waiting for it.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        held(&self.inner.waiting).closed
    }

    /// Streams at the moment.
    #[must_use]
    pub fn subscribers(&self) -> usize {
        self.inner.subscribers.load(Ordering::Relaxed)
    }

    /// Readings that slow subscribers missed.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.inner.dropped.load(Ordering::Relaxed)
    }

    /// Subscribers that were cut off because they read nothing.
    #[must_use]
    pub fn cut_off(&self) -> u64 {
        self.inner.cut_off.load(Ordering::Relaxed)
    }

    /// Counts a client that was cut off elsewhere, because its connection took nothing.
    pub fn count_cut_off(&self) {
        self.inner.cut_off.fetch_add(1, Ordering::Relaxed);
    }
}

/// A subscriber's end; dropping it ends the subscription.
#[derive(Debug)]
pub struct Subscription {
    /// Numbers of the next reading and of the next other record.
    reading: u64,
    control: u64,
    wanted: Wanted,
    moved: Moved,
    changed: watch::Receiver<()>,
    counted: Counted,
}

/// What a subscriber finds.
enum Found {
    Line(Line),
    /// A reading that it does not want.
    Unwanted,
    Nothing,
    Over,
}

impl Subscription {
    /// The next line; `None` when the stream is over. Cancel-safe.
    pub async fn next(&mut self) -> Option<Line> {
        loop {
            // What comes after this look makes it ready again.
            self.changed.mark_unchanged();
            match self.look() {
                Found::Line(line) => return Some(line),
                Found::Unwanted => {}
                Found::Nothing => self.changed.changed().await.ok()?,
                Found::Over => return None,
            }
        }
    }

    fn look(&mut self) -> Found {
        let inner = Arc::clone(&self.counted.hub().inner);
        let waiting = held(&inner.waiting);
        if self.control < waiting.controls.first() {
            drop(waiting);
            inner.cut_off.fetch_add(1, Ordering::Relaxed);
            (self.reading, self.control) = (u64::MAX, u64::MAX);
            return Found::Over;
        }
        let control = waiting.controls.get(self.control);
        let until = control.map_or(waiting.readings.end(), |control| control.before);
        if self.reading < until {
            let missed = waiting.readings.first().min(until).saturating_sub(self.reading);
            if missed > 0 {
                self.reading += missed;
                inner.dropped.fetch_add(missed, Ordering::Relaxed);
                let told = format!("{{\"type\":\"dropped\",\"readings\":{missed}}}\n");
                return Found::Line(told.into_bytes().into());
            }
            let Some(reading) = waiting.readings.get(self.reading) else { return Found::Nothing };
            self.reading += 1;
            let (ranger, status) = (reading.ranger.as_deref(), reading.status);
            if !self.moved.is_news(reading.step, ranger, status, reading.range_m) {
                return Found::Unwanted;
            }
            let judged = reading.judged.as_ref().filter(|_| self.wanted.verdicts);
            return Found::Line(Arc::clone(judged.unwrap_or(&reading.line)));
        }
        match control {
            Some(control) => {
                self.control += 1;
                Found::Line(Arc::clone(&control.line))
            }
            None if waiting.closed || self.control == u64::MAX => Found::Over,
            None => Found::Nothing,
        }
    }
}

impl UnderWay {
    fn follow(&mut self, record: &Record) {
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

/// The end of a subscriber to whole scans.
#[derive(Debug)]
pub struct ScanSubscription {
    scan: u64,
    changed: watch::Receiver<()>,
    counted: Counted,
}

impl ScanSubscription {
    /// The next scan that is over; `None` when the stream is. Cancel-safe.
    pub async fn next(&mut self) -> Option<Uuid> {
        loop {
            self.changed.mark_unchanged();
            {
                let waiting = held(&self.counted.hub().inner.waiting);
                if self.scan < waiting.scans.first() {
                    self.counted.hub().count_cut_off();
                    return None;
                }
                if let Some(scan) = waiting.scans.get(self.scan) {
                    self.scan += 1;
                    return Some(*scan);
                }
                if waiting.closed {
                    return None;
                }
            }
            self.changed.changed().await.ok()?;
        }
    }
}

/// Nothing under this lock can panic, so a poisoned one holds what it should.
fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;

//! Hands records to subscribers: each has a queue with a bound, and nobody waits for anybody.
//!
//! A reading that finds a queue full pushes out the oldest reading in it; how many went is told
//! in their place. Scan starts, scan ends and events are never pushed out: a subscriber with too
//! many of them waiting is cut off.

use std::{
    collections::{BTreeMap, HashMap, VecDeque},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use tokio::sync::Notify;

use super::status::ScanReport;
use crate::scan::{Ping, PingStatus, Record, encode_line};

/// Records other than readings that may wait for one subscriber.
const CONTROL_LIMIT: usize = 1024;

/// What a subscriber wants.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wanted {
    /// Only readings whose range moved by more than this since it was last sent for that
    /// direction, metres, or whose status changed; of whole scans, too.
    pub moved_m: Option<f64>,
    /// Whole scans when they are over, instead of single records.
    pub scans: bool,
}

/// One line of a stream: a JSON text, without its newline.
pub type Line = Arc<[u8]>;

/// Hands records to subscribers. Cheap to clone: all clones are one hub.
#[derive(Debug, Clone)]
pub struct Hub {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    capacity: usize,
    subscribers: Mutex<BTreeMap<u64, Arc<Subscriber>>>,
    next_id: AtomicU64,
    dropped: AtomicU64,
    cut_off: AtomicU64,
}

#[derive(Debug)]
struct Subscriber {
    wanted: Wanted,
    queue: Mutex<Queue>,
    wake: Notify,
}

#[derive(Debug, Default)]
struct Queue {
    lines: VecDeque<(Class, Line)>,
    readings: usize,
    /// Readings pushed out since that was last told.
    dropped: u64,
    closed: bool,
    /// What was last sent for each direction: a motor step, or a ranger of an array.
    sent: HashMap<(i32, Option<String>), (PingStatus, Option<f64>)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    Reading,
    Control,
}

impl Hub {
    /// A hub whose subscribers each may have so many readings waiting.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        let inner = Inner {
            capacity: capacity.max(1),
            subscribers: Mutex::default(),
            next_id: AtomicU64::new(0),
            dropped: AtomicU64::new(0),
            cut_off: AtomicU64::new(0),
        };
        Self { inner: Arc::new(inner) }
    }

    /// Begins to listen.
    #[must_use]
    pub fn subscribe(&self, wanted: Wanted) -> Subscription {
        let id = self.inner.next_id.fetch_add(1, Ordering::Relaxed);
        let subscriber =
            Arc::new(Subscriber { wanted, queue: Mutex::default(), wake: Notify::new() });
        held(&self.inner.subscribers).insert(id, Arc::clone(&subscriber));
        Subscription { hub: self.clone(), id, subscriber }
    }

    /// Hands a record to everybody who wants single records.
    pub fn publish(&self, record: &Record) {
        let subscribers = held(&self.inner.subscribers);
        let mut wanting = subscribers.values().filter(|one| !one.wanted.scans).peekable();
        if wanting.peek().is_none() {
            return;
        }
        let mut line = Vec::new();
        if encode_line(record, &mut line).is_err() {
            // The log refuses the same record and says so.
            return;
        }
        line.pop();
        let line: Line = line.into();
        for subscriber in wanting {
            match record {
                Record::Ping(ping) => self.push_reading(subscriber, ping, &line),
                _ => self.push_control(subscriber, &line),
            }
        }
    }

    /// Hands a whole scan to everybody who wants those; to who wants only what moved, with those
    /// readings alone.
    pub fn publish_scan(&self, scan: &ScanReport) {
        let subscribers = held(&self.inner.subscribers);
        let mut whole: Option<Line> = None;
        for subscriber in subscribers.values().filter(|one| one.wanted.scans) {
            let line = match subscriber.wanted.moved_m {
                None => Arc::clone(whole.get_or_insert_with(|| json(scan))),
                Some(_) => {
                    let mut queue = held(&subscriber.queue);
                    let moved = |ping: &&Ping| queue.is_news(ping, subscriber.wanted.moved_m);
                    let pings = scan.pings.iter().filter(moved).cloned().collect();
                    json(&ScanReport { pings, ..scan.clone() })
                }
            };
            self.push_control(subscriber, &line);
        }
    }

    /// Ends every stream after what is waiting in it.
    pub fn close(&self) {
        for subscriber in held(&self.inner.subscribers).values() {
            held(&subscriber.queue).closed = true;
            subscriber.wake.notify_one();
        }
    }

    /// Streams at the moment.
    #[must_use]
    pub fn subscribers(&self) -> usize {
        held(&self.inner.subscribers).len()
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

    fn push_reading(&self, subscriber: &Subscriber, ping: &Ping, line: &Line) {
        let mut queue = held(&subscriber.queue);
        if queue.closed || !queue.is_news(ping, subscriber.wanted.moved_m) {
            return;
        }
        if queue.readings >= self.inner.capacity {
            queue.drop_oldest_reading();
            self.inner.dropped.fetch_add(1, Ordering::Relaxed);
        }
        queue.readings += 1;
        queue.lines.push_back((Class::Reading, Arc::clone(line)));
        subscriber.wake.notify_one();
    }

    fn push_control(&self, subscriber: &Subscriber, line: &Line) {
        let mut queue = held(&subscriber.queue);
        if queue.closed {
            return;
        }
        if queue.lines.len() - queue.readings >= CONTROL_LIMIT {
            queue.closed = true;
            queue.lines.clear();
            queue.readings = 0;
            self.inner.cut_off.fetch_add(1, Ordering::Relaxed);
        } else {
            queue.lines.push_back((Class::Control, Arc::clone(line)));
        }
        subscriber.wake.notify_one();
    }
}

impl Queue {
    /// Whether this reading differs enough from the last one sent in its direction.
    fn is_news(&mut self, ping: &Ping, moved_m: Option<f64>) -> bool {
        let Some(moved_m) = moved_m else { return true };
        let now = (ping.status, ping.range_m);
        let direction = (ping.step, ping.ranger.clone());
        let same = self.sent.get(&direction).is_some_and(|&(status, range_m)| {
            let moved = range_m.zip(ping.range_m).map_or(0.0, |(before, now)| (now - before).abs());
            status == ping.status && moved <= moved_m
        });
        if !same {
            self.sent.insert(direction, now);
        }
        !same
    }

    fn drop_oldest_reading(&mut self) {
        let oldest = self.lines.iter().position(|(class, _)| *class == Class::Reading);
        if let Some(oldest) = oldest {
            self.lines.remove(oldest);
            self.readings -= 1;
            self.dropped += 1;
        }
    }

    fn pop(&mut self) -> Option<Line> {
        if self.dropped > 0 {
            let told = format!(r#"{{"type":"dropped","readings":{}}}"#, self.dropped);
            self.dropped = 0;
            return Some(told.into_bytes().into());
        }
        let (class, line) = self.lines.pop_front()?;
        self.readings -= usize::from(class == Class::Reading);
        Some(line)
    }
}

/// A subscriber's end; dropping it ends the subscription.
#[derive(Debug)]
pub struct Subscription {
    hub: Hub,
    id: u64,
    subscriber: Arc<Subscriber>,
}

impl Subscription {
    /// The next line; `None` when the stream is over. Cancel-safe.
    pub async fn next(&mut self) -> Option<Line> {
        loop {
            {
                let mut queue = held(&self.subscriber.queue);
                if let Some(line) = queue.pop() {
                    return Some(line);
                }
                if queue.closed {
                    return None;
                }
            }
            self.subscriber.wake.notified().await;
        }
    }
}

impl Drop for Subscription {
    fn drop(&mut self) {
        held(&self.hub.inner.subscribers).remove(&self.id);
    }
}

fn json(scan: &ScanReport) -> Line {
    serde_json::to_vec(scan).unwrap_or_default().into()
}

/// Nothing under these locks can panic, so a poisoned one holds what it should.
fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::decode_line;

    const LOG: &str = include_str!("../../tests/fixtures/small.jsonl");

    fn ping(step: i32, range_m: Option<f64>) -> Record {
        let record = decode_line(LOG.lines().nth(2).expect("a reading").as_bytes());
        let Ok(Record::Ping(mut ping)) = record else { panic!("a reading") };
        (ping.step, ping.range_m, ping.residual_m) = (step, range_m, None);
        Record::Ping(ping)
    }

    fn control() -> Record {
        decode_line(LOG.lines().nth(1).expect("a start").as_bytes()).expect("clean")
    }

    async fn all(subscription: &mut Subscription, hub: &Hub) -> Vec<serde_json::Value> {
        hub.close();
        let mut lines = Vec::new();
        while let Some(line) = subscription.next().await {
            lines.push(serde_json::from_slice(&line).expect("JSON"));
        }
        lines
    }

    #[tokio::test]
    async fn a_slow_subscriber_loses_the_oldest_readings_with_a_count_and_no_control() {
        let hub = Hub::new(10);
        let mut slow = hub.subscribe(Wanted::default());
        hub.publish(&control());
        for step in 0..25 {
            hub.publish(&ping(step, Some(1.0)));
        }
        hub.publish(&control());
        let lines = all(&mut slow, &hub).await;
        assert_eq!(lines[0], serde_json::json!({"type": "dropped", "readings": 15}));
        let steps: Vec<i64> = lines.iter().filter_map(|line| line["step"].as_i64()).collect();
        assert_eq!(steps, (15..25).collect::<Vec<_>>());
        assert_eq!(lines.iter().filter(|line| line["type"] == "scan_start").count(), 2);
        assert_eq!(hub.dropped(), 15);
    }

    #[tokio::test]
    async fn only_what_moved_is_sent_on_request() {
        let hub = Hub::new(100);
        let mut some = hub.subscribe(Wanted { moved_m: Some(0.05), scans: false });
        for (step, range_m) in [
            (0, Some(1.0)),
            (0, Some(1.04)),
            // Creeping away in small steps is noticed against what was sent, not the last one.
            (0, Some(1.08)),
            (1, Some(1.08)),
            (0, Some(1.09)),
            (0, Some(0.9)),
        ] {
            hub.publish(&ping(step, range_m));
        }
        let ranges: Vec<_> = all(&mut some, &hub)
            .await
            .iter()
            .map(|line| (line["step"].as_i64().unwrap_or(-1), line["range_m"].as_f64()))
            .collect();
        assert_eq!(ranges, [(0, Some(1.0)), (0, Some(1.08)), (1, Some(1.08)), (0, Some(0.9))]);
    }

    #[tokio::test]
    async fn whole_scans_hold_only_what_moved_for_who_wants_that() {
        let hub = Hub::new(100);
        let mut all_of_it = hub.subscribe(Wanted { moved_m: None, scans: true });
        let mut some = hub.subscribe(Wanted { moved_m: Some(0.05), scans: true });
        let Record::ScanStart(start) = control() else { panic!("a start") };
        let pinged = |range_m| match ping(3, Some(range_m)) {
            Record::Ping(ping) => *ping,
            _ => panic!("a reading"),
        };
        for range_m in [1.0, 1.01, 1.2] {
            let fixed = Ping { step: 9, ..pinged(0.5) };
            let pings = vec![pinged(range_m), fixed];
            let (start, events) = (start.clone(), Vec::new());
            hub.publish_scan(&ScanReport { start, pings, events, end: None });
        }
        let counts = |lines: Vec<serde_json::Value>| -> Vec<usize> {
            lines.iter().map(|scan| scan["pings"].as_array().map_or(0, Vec::len)).collect()
        };
        assert_eq!(counts(all(&mut some, &hub).await), [2, 0, 1]);
        assert_eq!(counts(all(&mut all_of_it, &hub).await), [2, 2, 2]);
    }

    #[tokio::test]
    async fn a_subscriber_that_never_reads_is_cut_off_and_one_that_leaves_is_forgotten() {
        let hub = Hub::new(10);
        let mut dead = hub.subscribe(Wanted::default());
        for _ in 0..=CONTROL_LIMIT {
            hub.publish(&control());
        }
        assert_eq!((hub.cut_off(), dead.next().await), (1, None));
        assert_eq!(hub.subscribers(), 1);
        drop(dead);
        assert_eq!(hub.subscribers(), 0);
    }
}

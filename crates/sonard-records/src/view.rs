//! A log's records gathered scan by scan, for everything that looks at whole scans.

use std::{collections::VecDeque, iter::Fuse, sync::Arc};

use uuid::Uuid;

use super::{Event, Ping, Record, ScanEnd, ScanStart, SceneRef, Session};
use sonard_model::geometry::Pose;

/// One scan with the session it was taken in.
///
/// Parts that a damaged or unfinished log lacks are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanView {
    /// Identifies the scan.
    pub scan: Uuid,
    /// The session in force when the scan's first record was written.
    pub session: Option<Arc<Session>>,
    /// How it began.
    pub start: Option<ScanStart>,
    /// Its readings, in the order of the log.
    pub pings: Vec<Ping>,
    /// Events between its first and its last record.
    pub events: Vec<Event>,
    /// How it ended.
    pub end: Option<ScanEnd>,
}

impl ScanView {
    /// Gathers records into scans, in the order in which the scans begin.
    ///
    /// Readings belong to their scan by its id, wherever they stand; events to the scan that is
    /// open when they happen.
    pub fn from_records(records: impl IntoIterator<Item = Record>) -> Vec<Self> {
        let mut gathered = Gathered::default();
        for record in records {
            gathered.add(record);
        }
        gathered.scans
    }

    /// Scans one by one as they end, for logs too long to be held whole.
    ///
    /// A scan without an end comes before the first that begins after its last record and ends,
    /// or with the last of the log. A reading that stands after its scan's end makes a scan by
    /// itself: no log of this program has one.
    pub fn one_by_one(records: impl IntoIterator<Item = Record>) -> impl Iterator<Item = Self> {
        OneByOne {
            records: records.into_iter().fuse(),
            gathered: Gathered::default(),
            ready: VecDeque::new(),
        }
    }

    /// Where the ranger stood, if the log says so.
    #[must_use]
    pub fn pose(&self) -> Option<Pose> {
        self.start.as_ref().map(|start| start.pose)
    }
}

/// What has been read and not been given away.
#[derive(Default)]
struct Gathered {
    session: Option<Arc<Session>>,
    /// The last scene that came with its text: its SHA-256, and the text.
    scene: Option<(String, Arc<str>)>,
    /// In the order in which they begin.
    scans: Vec<ScanView>,
    /// Numbers of the first and last record of each.
    records: Vec<[u64; 2]>,
    count: u64,
}

impl Gathered {
    fn add(&mut self, record: Record) {
        self.count += 1;
        match record {
            Record::Session(opened) => self.begin_session(opened),
            Record::ScanStart(start) => {
                let view = self.entry(start.scan);
                view.start = Some(start);
            }
            Record::Ping(ping) => self.entry(ping.scan).pings.push(*ping),
            Record::ScanEnd(end) => {
                let view = self.entry(end.scan);
                view.end = Some(end);
            }
            Record::Event(event) => {
                if let Some(open) = self.scans.last_mut().filter(|scan| scan.end.is_none()) {
                    open.events.push(event);
                }
            }
        }
    }

    /// A log has the text of a scene once: later sessions get it back.
    fn begin_session(&mut self, mut session: Box<Session>) {
        if let Some(SceneRef { sha256, .. }) = &session.scene {
            match (&session.scene_text, &self.scene) {
                (Some(text), _) => self.scene = Some((sha256.clone(), Arc::clone(text))),
                (None, Some((known, text))) if known == sha256 => {
                    session.scene_text = Some(Arc::clone(text));
                }
                (None, _) => {}
            }
        }
        self.session = Some(Arc::from(session));
    }

    /// The view of `scan`, made if this is its first record.
    fn entry(&mut self, scan: Uuid) -> &mut ScanView {
        // Records of a scan stand together, so the search from the end stops at once.
        let at = self.scans.iter().rposition(|view| view.scan == scan).unwrap_or_else(|| {
            self.scans.push(ScanView {
                scan,
                session: self.session.clone(),
                start: None,
                pings: Vec::new(),
                events: Vec::new(),
                end: None,
            });
            self.records.push([self.count; 2]);
            self.scans.len() - 1
        });
        self.records[at][1] = self.count;
        &mut self.scans[at]
    }

    /// Gives `scan` away, and before it those that were left without an end when it began.
    fn take_ended(&mut self, scan: Uuid, ready: &mut VecDeque<ScanView>) {
        let Some(at) = self.scans.iter().rposition(|view| view.scan == scan) else { return };
        let [first, _] = self.records[at];
        let (mut kept, mut kept_records) = (Vec::new(), Vec::new());
        for (view, records) in self.scans.drain(..).zip(self.records.drain(..)) {
            if view.scan == scan || records[1] < first {
                ready.push_back(view);
            } else {
                kept.push(view);
                kept_records.push(records);
            }
        }
        (self.scans, self.records) = (kept, kept_records);
    }
}

/// See [`ScanView::one_by_one`].
struct OneByOne<I> {
    records: Fuse<I>,
    gathered: Gathered,
    ready: VecDeque<ScanView>,
}

impl<I: Iterator<Item = Record>> Iterator for OneByOne<I> {
    type Item = ScanView;

    fn next(&mut self) -> Option<ScanView> {
        while self.ready.is_empty() {
            let Some(record) = self.records.next() else {
                self.ready.extend(std::mem::take(&mut self.gathered.scans));
                break;
            };
            let ended = match &record {
                Record::ScanEnd(end) => Some(end.scan),
                _ => None,
            };
            self.gathered.add(record);
            if let Some(scan) = ended {
                self.gathered.take_ended(scan, &mut self.ready);
            }
        }
        self.ready.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EventKind, PingStatus, ScanPlan};

    fn ping(scan: Uuid, index: u32) -> Record {
        Record::Ping(Box::new(Ping::new(scan, index, 0.0, PingStatus::NoEcho)))
    }

    fn start(scan: Uuid) -> Record {
        Record::ScanStart(ScanStart {
            scan,
            time: jiff::Timestamp::UNIX_EPOCH,
            pose: Pose { x_m: 1.0, y_m: 2.0, heading_deg: 0.0 },
            plan: ScanPlan::default(),
            air: None,
            provenance: None,
            request: None,
        })
    }

    #[test]
    fn readings_find_their_scan_even_after_the_next_one_began() {
        let (first, second) = (Uuid::from_u128(1), Uuid::from_u128(2));
        let event = Record::Event(Event {
            time: jiff::Timestamp::UNIX_EPOCH,
            kind: EventKind::LinkLost,
            detail: String::new(),
        });
        let views = ScanView::from_records([
            event.clone(),
            start(first),
            ping(first, 0),
            start(second),
            ping(first, 1),
            event,
            ping(second, 0),
        ]);
        let shape: Vec<_> = views.iter().map(|v| (v.scan, v.pings.len(), v.events.len())).collect();
        assert_eq!(shape, [(first, 2, 0), (second, 1, 1)]);
        assert_eq!(views[0].pose().map(|pose| pose.y_m), Some(2.0));
    }

    fn end(scan: Uuid) -> Record {
        Record::ScanEnd(ScanEnd {
            scan,
            time: jiff::Timestamp::UNIX_EPOCH,
            beams: 1,
            missing: 0,
            repaired: 0,
            duration_s: 0.0,
            acoustic_limit_s: 0.0,
            home_drift_steps: None,
            provenance: None,
        })
    }

    #[test]
    fn one_by_one_gives_the_same_scans_as_soon_as_they_end() {
        let [first, killed, second, last] = [1, 2, 3, 4].map(Uuid::from_u128);
        let records = [
            start(first),
            ping(first, 0),
            end(first),
            start(killed),
            ping(killed, 0),
            start(second),
            ping(second, 0),
            end(second),
            start(last),
            ping(last, 0),
        ];
        let whole = ScanView::from_records(records.clone());
        let read = std::cell::Cell::new(0);
        let counted = records.into_iter().inspect(|_| read.set(read.get() + 1));
        let given: Vec<_> = ScanView::one_by_one(counted).map(|view| (read.get(), view)).collect();
        assert_eq!(given.iter().map(|(_, view)| view).collect::<Vec<_>>(), Vec::from_iter(&whole));
        assert_eq!(given.iter().map(|(read, _)| *read).collect::<Vec<_>>(), [3, 8, 8, 10]);
    }

    #[test]
    fn one_by_one_keeps_a_scan_that_goes_on_beside_another() {
        let (long, short) = (Uuid::from_u128(1), Uuid::from_u128(2));
        let records = [
            start(long),
            start(short),
            ping(long, 0),
            ping(short, 0),
            end(short),
            ping(long, 1),
            end(long),
            ping(short, 1),
        ];
        let given: Vec<_> = ScanView::one_by_one(records)
            .map(|view| (view.scan, view.start.is_some(), view.pings.len()))
            .collect();
        assert_eq!(given, [(short, true, 1), (long, true, 2), (short, false, 1)]);
    }

    #[test]
    fn a_scan_without_its_start_is_still_there() {
        let scan = Uuid::from_u128(7);
        let views = ScanView::from_records([ping(scan, 3)]);
        assert_eq!((views.len(), views[0].pings.len()), (1, 1));
        assert_eq!((views[0].pose(), views[0].session.is_none()), (None, true));
    }
}

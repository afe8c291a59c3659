//! Grouping of a log's records into scans.

use std::{collections::VecDeque, iter::Fuse, sync::Arc};

use uuid::Uuid;

use super::{Event, Ping, Record, ScanEnd, ScanStart, SceneRef, Session};
use sonard_model::geometry::Pose;

/// Single scan with its session.
///
/// Parts missing in a damaged or unfinished log are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanView {
    /// Identifier of the scan.
    pub scan: Uuid,
    /// Current session at the scan's first record.
    pub session: Option<Arc<Session>>,
    /// Start record of the scan.
    pub start: Option<ScanStart>,
    /// Readings of the scan, in the order of the log.
    pub pings: Vec<Ping>,
    /// Events between the first and the last record of the scan.
    pub events: Vec<Event>,
    /// End record of the scan.
    pub end: Option<ScanEnd>,
}

impl ScanView {
    /// Groups records into scans, in the order of the scans' first records.
    ///
    /// Readings are assigned by scan id, wherever they occur; events to the scan open at that time.
    pub fn from_records(records: impl IntoIterator<Item = Record>) -> Vec<Self> {
        let mut assembler = ScanAssembler::default();
        for record in records {
            assembler.add(record);
        }
        assembler.scans
    }

    /// Yields scans one by one as they end, for logs too long to be held in memory.
    ///
    /// A scan without an end record is yielded before the first scan that begins after its last
    /// record and ends, or at the end of the log. A reading after its scan's end record forms a
    /// scan of its own; logs of this program have none.
    pub fn stream(records: impl IntoIterator<Item = Record>) -> impl Iterator<Item = Self> {
        ScanStream {
            records: records.into_iter().fuse(),
            assembler: ScanAssembler::default(),
            ready: VecDeque::new(),
        }
    }

    /// Pose of the ranger, if the log contains the start record.
    #[must_use]
    pub fn pose(&self) -> Option<Pose> {
        self.start.as_ref().map(|start| start.pose)
    }
}

/// Assembler of scans from consecutive records.
#[derive(Default)]
struct ScanAssembler {
    session: Option<Arc<Session>>,
    /// SHA-256 and text of the last scene with a text.
    scene: Option<(String, Arc<str>)>,
    /// Scans in the order of their first records.
    scans: Vec<ScanView>,
    /// Numbers of the first and last record of each scan.
    records: Vec<[u64; 2]>,
    count: u64,
}

impl ScanAssembler {
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

    /// Restores the scene text, which a log contains only once.
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

    /// View of `scan`, created at its first record.
    fn entry(&mut self, scan: Uuid) -> &mut ScanView {
        // Records of a scan are adjacent, so the backward search is short.
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

    /// Moves `scan` to `ready`, preceded by scans left without an end when it began.
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

/// Iterator returned by [`ScanView::one_by_one`].
struct ScanStream<I> {
    records: Fuse<I>,
    assembler: ScanAssembler,
    ready: VecDeque<ScanView>,
}

impl<I: Iterator<Item = Record>> Iterator for ScanStream<I> {
    type Item = ScanView;

    fn next(&mut self) -> Option<ScanView> {
        while self.ready.is_empty() {
            let Some(record) = self.records.next() else {
                self.ready.extend(std::mem::take(&mut self.assembler.scans));
                break;
            };
            let ended = match &record {
                Record::ScanEnd(end) => Some(end.scan),
                _ => None,
            };
            self.assembler.add(record);
            if let Some(scan) = ended {
                self.assembler.take_ended(scan, &mut self.ready);
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
    fn readings_are_assigned_by_id() {
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
    fn stream_yields_scans_as_they_end() {
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
        let given: Vec<_> = ScanView::stream(counted).map(|view| (read.get(), view)).collect();
        assert_eq!(given.iter().map(|(_, view)| view).collect::<Vec<_>>(), Vec::from_iter(&whole));
        assert_eq!(given.iter().map(|(read, _)| *read).collect::<Vec<_>>(), [3, 8, 8, 10]);
    }

    #[test]
    fn stream_keeps_interleaved_scans() {
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
        let given: Vec<_> = ScanView::stream(records)
            .map(|view| (view.scan, view.start.is_some(), view.pings.len()))
            .collect();
        assert_eq!(given, [(short, true, 1), (long, true, 2), (short, false, 1)]);
    }

    #[test]
    fn keeps_scans_without_start() {
        let scan = Uuid::from_u128(7);
        let views = ScanView::from_records([ping(scan, 3)]);
        assert_eq!((views.len(), views[0].pings.len()), (1, 1));
        assert_eq!((views[0].pose(), views[0].session.is_none()), (None, true));
    }
}

//! A log's records gathered scan by scan, for everything that looks at whole scans.

use std::sync::Arc;

use uuid::Uuid;

use super::{Event, Ping, Record, ScanEnd, ScanStart, Session};
use crate::geometry::Pose;

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
        let mut scans: Vec<Self> = Vec::new();
        let mut session: Option<Arc<Session>> = None;
        for record in records {
            match record {
                Record::Session(opened) => session = Some(Arc::from(opened)),
                Record::ScanStart(start) => {
                    let view = entry(&mut scans, start.scan, session.as_ref());
                    view.start = Some(start);
                }
                Record::Ping(ping) => {
                    entry(&mut scans, ping.scan, session.as_ref()).pings.push(*ping);
                }
                Record::ScanEnd(end) => {
                    let view = entry(&mut scans, end.scan, session.as_ref());
                    view.end = Some(end);
                }
                Record::Event(event) => {
                    if let Some(open) = scans.last_mut().filter(|scan| scan.end.is_none()) {
                        open.events.push(event);
                    }
                }
            }
        }
        scans
    }

    /// Where the ranger stood, if the log says so.
    #[must_use]
    pub fn pose(&self) -> Option<Pose> {
        self.start.as_ref().map(|start| start.pose)
    }
}

/// The view of `scan`, made if this is its first record.
fn entry<'a>(
    scans: &'a mut Vec<ScanView>,
    scan: Uuid,
    session: Option<&Arc<Session>>,
) -> &'a mut ScanView {
    // Records of a scan stand together, so the search from the end stops at once.
    let at = scans.iter().rposition(|view| view.scan == scan).unwrap_or_else(|| {
        scans.push(ScanView {
            scan,
            session: session.cloned(),
            start: None,
            pings: Vec::new(),
            events: Vec::new(),
            end: None,
        });
        scans.len() - 1
    });
    &mut scans[at]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::{EventKind, PingStatus, ScanPlan};

    fn ping(scan: Uuid, index: u32) -> Record {
        Record::Ping(Box::new(Ping {
            scan,
            index,
            step: 0,
            azimuth_deg: 0.0,
            ranger: None,
            pose: None,
            provenance: None,
            time: None,
            time_sigma_us: None,
            status: PingStatus::NoEcho,
            fired_ticks: None,
            echo_ticks: Vec::new(),
            tof_us: None,
            range_m: None,
            repaired: false,
            amplitude: None,
            margin_db: None,
            path: None,
            sim: None,
            residual_m: None,
            confidence: None,
        }))
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

    #[test]
    fn a_scan_without_its_start_is_still_there() {
        let scan = Uuid::from_u128(7);
        let views = ScanView::from_records([ping(scan, 3)]);
        assert_eq!((views.len(), views[0].pings.len()), (1, 1));
        assert_eq!((views[0].pose(), views[0].session.is_none()), (None, true));
    }
}

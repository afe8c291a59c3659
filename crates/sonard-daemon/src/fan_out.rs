//! Distribution of records to log, subscribers and status.

use std::sync::Arc;

use jiff::Timestamp;
use sonard_log::MAX_LOGGED_SCENE_BYTES;
use sonard_records::{Event, EventKind, Record, ScanView, Session, Sink, SinkError};
use tokio::sync::Semaphore;

use super::{
    broadcast::Hub,
    fit::explanations,
    journal::Journal,
    state::{DaemonState, StateEvent},
};

/// Publisher of records to log, subscribers and status.
#[derive(Clone)]
pub(super) struct RecordFanOut {
    pub(super) journal: Journal,
    pub(super) hub: Hub,
    pub(super) state: Arc<DaemonState>,
    /// Limits the search for explanations to one scan at a time.
    explaining: Arc<Semaphore>,
}

impl RecordFanOut {
    pub(super) fn new(journal: Journal, hub: Hub, state: Arc<DaemonState>) -> Self {
        Self { journal, hub, state, explaining: Arc::new(Semaphore::new(1)) }
    }

    /// Publishes an event with the current time.
    pub(super) fn event(&self, kind: EventKind, detail: String) {
        self.publish(&Record::Event(Event { time: Timestamp::now(), kind, detail }));
    }

    /// Adds the robot's name to a session.
    pub(super) fn with_robot_name(&self, session: Session) -> Session {
        Session { robot: Some(self.state.robot.clone()), ..session }
    }

    /// Publishes a record to all outputs.
    pub(super) fn publish(&self, record: &Record) {
        let ended = self.state.update(record);
        self.journal.record(record);
        match record {
            Record::Session(session) => self.publish_session(session),
            _ => self.hub.publish(record),
        }
        if let Some((scan, readings)) = ended {
            self.hub.publish_scan(scan);
            readings.into_iter().for_each(|readings| self.explain(readings));
        }
    }

    /// Searches explanations that fit a scan better than its settings, in a thread of its own: the
    /// next scan is not delayed. A scan that ends during a search is skipped.
    fn explain(&self, scan: ScanView) {
        let Ok(permit) = Arc::clone(&self.explaining).try_acquire_owned() else { return };
        let out = self.clone();
        tokio::task::spawn_blocking(move || {
            let id = scan.scan;
            if let Some(change) = out.state.set_explanations(id, &explanations(scan)) {
                out.event(EventKind::Explanation, format!("scan {id}: {change}"));
            }
            drop(permit);
        });
    }

    /// Publishes a session. Live streams omit the text of the scene, and the API serves it only up
    /// to the limit of a log line, so that responses are bounded for any scene.
    fn publish_session(&self, session: &Session) {
        let fits = |text: &Arc<str>| text.len() <= MAX_LOGGED_SCENE_BYTES;
        let mut session = session.clone();
        let scene_text = session.scene_text.take().filter(fits);
        let record = Record::Session(Box::new(session.clone()));
        let session = Arc::new(Session { scene_text, ..session });
        // Set before the record is published: followers read the text from the published status.
        self.state.apply([StateEvent::SessionStarted(session)]);
        self.hub.publish(&record);
    }
}

impl Sink for RecordFanOut {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        if let Record::ScanStart(start) = record {
            let (scan, beams) = (start.scan, start.plan.beams());
            self.state.apply([StateEvent::ScanStarted { scan, beams }]);
        }
        self.publish(record);
        Ok(())
    }
}

//! Where records and news go: log, subscribers, status.

use std::sync::Arc;

use jiff::Timestamp;
use sonard_log::MAX_LOGGED_SCENE_BYTES;
use sonard_records::{Event, EventKind, Record, ScanView, Session, Sink, SinkError};
use tokio::sync::Semaphore;

use super::{fit::explanations, hub::Hub, journal::Journal, shared::Shared};

/// Where records and news go.
#[derive(Clone)]
pub(super) struct RecordFanOut {
    pub(super) journal: Journal,
    pub(super) hub: Hub,
    pub(super) shared: Arc<Shared>,
    /// One scan at a time is looked at for what would explain it better.
    explaining: Arc<Semaphore>,
}

impl RecordFanOut {
    pub(super) fn new(journal: Journal, hub: Hub, shared: Arc<Shared>) -> Self {
        Self { journal, hub, shared, explaining: Arc::new(Semaphore::new(1)) }
    }

    /// An event, now.
    pub(super) fn event(&self, kind: EventKind, detail: String) {
        self.put(&Record::Event(Event { time: Timestamp::now(), kind, detail }));
    }

    /// A session with the robot's name in it.
    pub(super) fn named(&self, session: Session) -> Session {
        Session { robot: Some(self.shared.robot.clone()), ..session }
    }

    /// A record for everybody.
    pub(super) fn put(&self, record: &Record) {
        let over = self.shared.collect(record);
        self.journal.record(record);
        match record {
            Record::Session(session) => self.begin(session),
            _ => self.hub.publish(record),
        }
        if let Some((scan, readings)) = over {
            self.hub.publish_scan(scan);
            readings.into_iter().for_each(|readings| self.explain(readings));
        }
    }

    /// Looks for what would explain a scan better, beside all else: the ranger does not wait for it. A scan that ends
    /// while another is looked at is passed over.
    fn explain(&self, scan: ScanView) {
        let Ok(turn) = Arc::clone(&self.explaining).try_acquire_owned() else { return };
        let out = self.clone();
        tokio::task::spawn_blocking(move || {
            let id = scan.scan;
            if let Some(news) = out.shared.explained(id, &explanations(scan)) {
                out.event(EventKind::Explanation, format!("scan {id}: {news}"));
            }
            drop(turn);
        });
    }

    /// Live streams go without the scene's text, and the API has it as far as a log's line has: what a
    /// client asks for is bounded, whatever the scene.
    fn begin(&self, session: &Session) {
        let fits = |text: &Arc<str>| text.len() <= MAX_LOGGED_SCENE_BYTES;
        let mut session = session.clone();
        let scene_text = session.scene_text.take().filter(fits);
        let record = Record::Session(Box::new(session.clone()));
        let session = Arc::new(Session { scene_text, ..session });
        // Who follows the records finds the text there.
        self.shared.view.send_modify(|view| view.session = Some(session));
        self.hub.publish(&record);
    }
}

impl Sink for RecordFanOut {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        if let Record::ScanStart(start) = record {
            let begun = (start.scan, start.plan.beams());
            self.shared.view.send_modify(|view| view.scan = Some(begun));
        }
        self.put(record);
        Ok(())
    }
}

//! Conversion of live records to messages of visualization tools (Foxglove, ROS 2).

use std::sync::Arc;

use super::{
    Handle,
    broadcast::{StreamLine, Subscription},
};
use sonard_export::{LiveConverter, LiveMessage, SkippedScan, Topic};
use sonard_records::{Record, Session, decode_line};

/// Output of live messages.
pub trait LiveMessageSink {
    /// Replaces the list of topics; later messages belong to these topics only.
    fn set_topics(&mut self, topics: &[Topic]);
    /// Sends a message of one of the topics.
    fn send(&mut self, message: &LiveMessage<'_>);
    /// Reports missing messages, with a description of the reason.
    fn report_loss(&mut self, words: String);
    /// Marks the end of the messages of a record.
    fn end_of_record(&mut self);
}

/// Converter of the daemon's live records to messages.
pub struct MessageConverter {
    daemon: Handle,
    records: Subscription,
    live: LiveConverter,
}

impl MessageConverter {
    /// Subscribes to the records of a daemon. The current session is taken as context; a running
    /// scan is not replayed.
    pub fn subscribe(
        daemon: &Handle,
        live: LiveConverter,
        audience: &mut impl LiveMessageSink,
    ) -> Self {
        let records = daemon.hub().follow();
        let mut follower = Self { daemon: daemon.clone(), records, live };
        if let Some(session) = daemon.session() {
            follower.take(Record::Session(Box::new((*session).clone())), audience);
        }
        follower
    }

    /// Converts the next record. Returns `false` at the end of the stream. Cancel-safe.
    pub async fn next(&mut self, audience: &mut impl LiveMessageSink) -> bool {
        match self.records.next().await {
            Some(line) => self.take_line(&line, audience),
            None if self.daemon.hub().is_closed() => return false,
            None => {
                let message =
                    "records arrived faster than they could be sent: a scan is incomplete";
                audience.report_loss(message.into());
                self.records = self.daemon.hub().follow();
            }
        }
        true
    }

    fn take_line(&mut self, line: &StreamLine, audience: &mut impl LiveMessageSink) {
        match decode_line(line.trim_ascii_end()) {
            Ok(Record::Session(mut session)) => {
                session.scene_text = self.scene_text(&session);
                self.take(Record::Session(session), audience);
            }
            // Converting a whole scan takes long, and may be triggered by the next scan's start.
            Ok(record @ (Record::ScanStart(_) | Record::ScanEnd(_))) => {
                crate::blocking::block_in_place(|| self.take(record, audience));
            }
            Ok(record) => self.take(record, audience),
            Err(_dropped) => {
                let message = "readings arrived faster than they could be sent: some were dropped";
                audience.report_loss(message.into());
            }
        }
        audience.end_of_record();
    }

    /// Text of a session's scene, which live records omit.
    fn scene_text(&self, session: &Session) -> Option<Arc<str>> {
        let current = self.daemon.session()?;
        current.scene_text.clone().filter(|_| current.scene == session.scene)
    }

    fn take(&mut self, record: Record, audience: &mut impl LiveMessageSink) {
        let is_session = matches!(record, Record::Session(_));
        let taken = self.live.convert(record, |message| audience.send(&message));
        if let Err(why) = taken {
            let message = match why {
                SkippedScan::Map(_) => why.to_string(),
                why => format!("these scans can't be converted: {why}"),
            };
            tracing::warn!("live messages: {message}");
            audience.report_loss(message);
        }
        if is_session {
            audience.set_topics(self.live.topics());
        }
    }
}

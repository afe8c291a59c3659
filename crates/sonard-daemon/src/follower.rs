//! What makes live messages of the daemon's records, for whoever tells them.

use std::sync::Arc;

use super::{
    Handle,
    hub::{Line, Subscription},
};
use sonard_export::{LeftOut, Live, LiveMessage, Topic};
use sonard_records::{Record, Session, decode_line};

/// Who tells them.
pub trait Audience {
    /// There are messages of these topics from now on, and of no other.
    fn set_topics(&mut self, topics: &[Topic]);
    /// A message of one of them.
    fn tell(&mut self, message: &LiveMessage<'_>);
    /// Something is not told, in words.
    fn announce(&mut self, words: String);
    /// All that there is to be told of a record was.
    fn told(&mut self);
}

/// What makes messages of the daemon's records.
pub struct Follower {
    daemon: Handle,
    records: Subscription,
    live: Live,
}

impl Follower {
    /// Begins to follow; what is in force already is told to nobody.
    pub fn begin(daemon: &Handle, live: Live, audience: &mut impl Audience) -> Self {
        let records = daemon.hub().follow();
        let mut follower = Self { daemon: daemon.clone(), records, live };
        if let Some(session) = daemon.session() {
            follower.take(Record::Session(Box::new((*session).clone())), audience);
        }
        follower
    }

    /// Tells the next record; false when there will be none. Cancel-safe.
    pub async fn next(&mut self, audience: &mut impl Audience) -> bool {
        match self.records.next().await {
            Some(line) => self.take_line(&line, audience),
            None if self.daemon.hub().is_closed() => return false,
            None => {
                let words = "records came faster than they could be told: a scan is not whole";
                audience.announce(words.into());
                self.records = self.daemon.hub().follow();
            }
        }
        true
    }

    fn take_line(&mut self, line: &Line, audience: &mut impl Audience) {
        match decode_line(line.trim_ascii_end()) {
            Ok(Record::Session(mut session)) => {
                session.scene_text = self.scene_text(&session);
                self.take(Record::Session(session), audience);
            }
            // A whole scan takes its time, and may end with the next one's start.
            Ok(record @ (Record::ScanStart(_) | Record::ScanEnd(_))) => {
                crate::blocking::block_in_place(|| self.take(record, audience));
            }
            Ok(record) => self.take(record, audience),
            Err(_missed) => {
                let words = "readings came faster than they could be told: some are left out";
                audience.announce(words.into());
            }
        }
        audience.told();
    }

    /// The text of a session's scene, which live records go without.
    fn scene_text(&self, session: &Session) -> Option<Arc<str>> {
        let in_force = self.daemon.session()?;
        in_force.scene_text.clone().filter(|_| in_force.scene == session.scene)
    }

    fn take(&mut self, record: Record, audience: &mut impl Audience) {
        let is_session = matches!(record, Record::Session(_));
        let taken = self.live.take(record, |message| audience.tell(&message));
        if let Err(why) = taken {
            let words = match why {
                LeftOut::Map(_) => why.to_string(),
                why => format!("nothing can be told of these scans: {why}"),
            };
            tracing::warn!("live messages: {words}");
            audience.announce(words);
        }
        if is_session {
            audience.set_topics(self.live.topics());
        }
    }
}

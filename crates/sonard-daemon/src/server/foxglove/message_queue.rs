//! Messages that wait for viewers: kept once for all, within a bound in bytes. Pure: who is told when is up to others.
//!
//! A viewer is a place in what waits, and what it is subscribed to. Of what falls off before it was told it learns how
//! many messages it missed; the last message of a topic that stands still is kept for those who come late.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::Arc,
};

use sonard_export::{
    LiveMessage, Topic,
    foxglove::{Level, Session, Step, advertise, status, unadvertise},
};

use crate::Shelf;

/// A message that is longer is left out: each viewer may have one of them on its way.
pub(super) const MOST_MESSAGE_BYTES: usize = 1 << 20;
/// Messages that may wait, however small.
const MOST_MESSAGES: usize = 1 << 16;

/// What there is to be told to all viewers.
#[derive(Debug)]
pub(super) struct MessageQueue {
    channels: BTreeMap<u32, Channel>,
    /// Channels so far: numbers are not given twice.
    numbered: u32,
    /// Changes of the channels so far.
    changes: u64,
    waiting: Shelf<Message>,
    /// Words for all viewers so far, and the last ones.
    notices: (u64, String),
    is_closed: bool,
}

#[derive(Debug)]
struct Channel {
    topic: Topic,
    /// The last message, of a topic that stands still.
    kept: Option<Arc<Message>>,
    /// Numbers of the oldest message that waits, and of the next one.
    first: u64,
    end: u64,
}

#[derive(Debug, Clone)]
struct Message {
    channel: u32,
    /// Its number within the channel.
    number: u64,
    at_ns: u64,
    bytes: Arc<[u8]>,
}

/// What goes to a viewer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Outgoing {
    Text(String),
    Binary(Vec<u8>),
}

/// What a viewer finds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Found {
    Something(Outgoing),
    Nothing,
    /// There will be nothing more.
    Over,
    /// It sent too much that makes no sense.
    ShownOut,
}

impl MessageQueue {
    /// An empty one, on which so many bytes may wait.
    pub(super) fn new(most_bytes: usize) -> Self {
        Self {
            channels: BTreeMap::new(),
            numbered: 0,
            changes: 0,
            waiting: Shelf::new(MOST_MESSAGES, most_bytes),
            notices: (0, String::new()),
            is_closed: false,
        }
    }

    /// Has a channel for each of these topics, and no other.
    pub(super) fn set_topics(&mut self, topics: &[Topic]) {
        let before = self.channels.len();
        self.channels.retain(|_, channel| topics.contains(&channel.topic));
        let mut is_changed = self.channels.len() < before;
        for topic in topics {
            if self.channels.values().any(|channel| channel.topic == *topic) {
                continue;
            }
            self.numbered += 1;
            let channel = Channel { topic: topic.clone(), kept: None, first: 0, end: 0 };
            self.channels.insert(self.numbered, channel);
            is_changed = true;
        }
        self.changes += u64::from(is_changed);
    }

    /// Puts a message up. One that is too long counts as missed by everybody.
    pub(super) fn put(&mut self, message: &LiveMessage<'_>) {
        let of_topic = |(_, channel): &(&u32, &mut Channel)| channel.topic.name == message.topic;
        let Some((id, channel)) = self.channels.iter_mut().find(of_topic) else { return };
        let number = channel.end;
        channel.end += 1;
        channel.kept = None;
        if message.bytes.len() > MOST_MESSAGE_BYTES {
            return;
        }
        let bytes = Arc::from(message.bytes);
        let message = Message { channel: *id, number, at_ns: message.at_ns, bytes };
        channel.kept = channel.topic.is_kept.then(|| Arc::new(message.clone()));
        for fallen in self.waiting.put(message.bytes.len(), message) {
            if let Some(channel) = self.channels.get_mut(&fallen.channel) {
                channel.first = fallen.number + 1;
            }
        }
    }

    /// Tells all viewers that are there something in words.
    pub(super) fn announce(&mut self, words: String) {
        self.notices = (self.notices.0 + 1, words);
    }

    /// Shows all viewers out.
    pub(super) fn close(&mut self) {
        self.is_closed = true;
    }

    fn has(&self, channel: u32) -> bool {
        self.channels.contains_key(&channel)
    }
}

/// One who looks at the queue. What it holds grows with the channels that there are and with nothing else.
#[derive(Debug)]
pub(super) struct Viewer {
    session: Session,
    /// Its place in what waits.
    place: u64,
    /// Numbers of the next message of each channel that it is subscribed to.
    due: BTreeMap<u32, u64>,
    /// Channels whose kept message it has to be told.
    late_for: BTreeSet<u32>,
    /// Channels that it was told of, and by which change.
    advertised: BTreeSet<u32>,
    changes: u64,
    notices: u64,
    /// Texts that go first.
    texts: VecDeque<String>,
    is_shown_out: bool,
}

impl Viewer {
    /// One that comes now.
    pub(super) fn new(queue: &MessageQueue, greeting: String) -> Self {
        let mut texts = VecDeque::from([greeting]);
        if queue.channels.is_empty() {
            let words = "there are no topics yet: they come with the first scan";
            texts.push_back(status(Level::Info, words));
        }
        Self {
            session: Session::default(),
            place: queue.waiting.end(),
            due: BTreeMap::new(),
            late_for: BTreeSet::new(),
            advertised: BTreeSet::new(),
            changes: 0,
            notices: queue.notices.0,
            texts,
            is_shown_out: false,
        }
    }

    /// Takes what it sent.
    pub(super) fn take_text(&mut self, text: &str, queue: &MessageQueue) {
        let steps = self.session.take_text(text, |channel| queue.has(channel));
        self.follow(steps, queue);
    }

    /// Takes what it sent, if that is binary.
    pub(super) fn take_binary(&mut self, queue: &MessageQueue) {
        let steps = self.session.take_binary();
        self.follow(steps, queue);
    }

    fn follow(&mut self, steps: Vec<Step>, queue: &MessageQueue) {
        for step in steps {
            match step {
                Step::Begin(channel) => {
                    let Some(begun) = queue.channels.get(&channel) else { continue };
                    self.due.insert(channel, begun.end);
                    if begun.kept.is_some() {
                        self.late_for.insert(channel);
                    }
                }
                Step::Cease(channel) => {
                    self.due.remove(&channel);
                    self.late_for.remove(&channel);
                }
                Step::Say(text) => self.texts.push_back(text),
                Step::End => self.is_shown_out = true,
            }
        }
    }

    /// What it is told next.
    pub(super) fn look(&mut self, queue: &MessageQueue) -> Found {
        self.hear_of_channels(queue);
        if self.notices != queue.notices.0 {
            self.notices = queue.notices.0;
            self.texts.push_back(status(Level::Warning, &queue.notices.1));
        }
        let missed = self.fall_behind(queue);
        if missed > 0 {
            self.texts.push_back(left_out(missed));
        }
        if let Some(text) = self.texts.pop_front() {
            return Found::Something(Outgoing::Text(text));
        }
        if self.is_shown_out {
            return Found::ShownOut;
        }
        match self.next_message(queue) {
            Some(outgoing) => Found::Something(outgoing),
            None if queue.is_closed => Found::Over,
            None => Found::Nothing,
        }
    }

    fn hear_of_channels(&mut self, queue: &MessageQueue) {
        if self.changes == queue.changes {
            return;
        }
        self.changes = queue.changes;
        let there: BTreeSet<u32> = queue.channels.keys().copied().collect();
        let gone: Vec<u32> = self.advertised.difference(&there).copied().collect();
        if !gone.is_empty() {
            self.session.keep_only(|channel| queue.has(channel));
            self.due.retain(|channel, _| queue.has(*channel));
            self.late_for.retain(|channel| queue.has(*channel));
            self.texts.push_back(unadvertise(&gone));
        }
        let new = queue.channels.iter().filter(|(id, _)| !self.advertised.contains(id));
        let mut new = new.map(|(id, channel)| (*id, &channel.topic)).peekable();
        if new.peek().is_some() {
            self.texts.push_back(advertise(new));
        }
        self.advertised = there;
    }

    /// Goes on to what is there if what it was to be told has fallen off; how many messages it missed by that.
    fn fall_behind(&mut self, queue: &MessageQueue) -> u64 {
        if self.place >= queue.waiting.first() {
            return 0;
        }
        self.place = queue.waiting.first();
        let mut missed = 0;
        for (id, due) in &mut self.due {
            let Some(channel) = queue.channels.get(id) else { continue };
            let fallen = channel.first.saturating_sub(*due);
            *due = channel.first.max(*due);
            // The last one of what stands still is told all the same.
            let is_kept = channel.kept.as_ref().is_some_and(|kept| kept.number < *due);
            if fallen > 0 && is_kept {
                self.late_for.insert(*id);
            }
            missed += fallen - u64::from(fallen > 0 && is_kept);
        }
        missed
    }

    fn next_message(&mut self, queue: &MessageQueue) -> Option<Outgoing> {
        while let Some(id) = self.late_for.pop_first() {
            let kept = queue.channels.get(&id).and_then(|channel| channel.kept.as_ref());
            // A newer one waits for it.
            let kept = kept.filter(|kept| self.due.get(&id).is_some_and(|due| kept.number < *due));
            let frame = kept.and_then(|kept| self.session.frame(id, kept.at_ns, &kept.bytes));
            if frame.is_some() {
                return frame.map(Outgoing::Binary);
            }
        }
        loop {
            let message = queue.waiting.get(self.place)?;
            let due = self.due.get_mut(&message.channel);
            let Some(due) = due.filter(|due| message.number >= **due) else {
                self.place += 1;
                continue;
            };
            let skipped = message.number - *due;
            if skipped > 0 {
                // Those between were too long. It is told so, and then comes back to this one.
                *due = message.number;
                return Some(Outgoing::Text(left_out(skipped)));
            }
            *due = message.number + 1;
            self.place += 1;
            let frame = self.session.frame(message.channel, message.at_ns, &message.bytes);
            return frame.map(Outgoing::Binary);
        }
    }
}

fn left_out(messages: u64) -> String {
    status(Level::Warning, &format!("{messages} messages left out"))
}

#[cfg(test)]
mod tests;

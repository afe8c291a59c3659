//! Message queue shared by all viewers, bounded in bytes. Pure: the caller does the sending.
//!
//! A viewer is a position in the queue and a set of subscriptions. When the queue overflows, the
//! oldest messages are dropped, and each lagging viewer is informed of the number that it missed.
//! The last message of a latched topic is kept for new subscribers.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::Arc,
};

use sonard_export::{
    LiveMessage, Topic,
    foxglove::{StatusLevel, ViewerAction, ViewerSession, advertise, status, unadvertise},
};

use crate::Ring;

/// Maximum size of a message, bytes; longer ones are dropped. Each viewer can have one such message
/// in flight.
pub(super) const MAX_MESSAGE_BYTES: usize = 1 << 20;
/// Maximum number of queued messages.
const MAX_MESSAGES: usize = 1 << 16;

/// Queue of messages with the channels that they belong to.
#[derive(Debug)]
pub(super) struct ViewerQueue {
    channels: BTreeMap<u32, TopicChannel>,
    /// Number of channels so far; channel ids are never reused.
    channel_count: u32,
    /// Number of changes of the channels so far.
    changes: u64,
    messages: Ring<QueuedMessage>,
    /// Number of notices to all viewers so far, and the last one.
    notices: (u64, String),
    is_closed: bool,
}

#[derive(Debug)]
struct TopicChannel {
    topic: Topic,
    /// Last message of a latched topic.
    latched: Option<Arc<QueuedMessage>>,
    /// Number of the oldest queued message, and of the next one.
    first: u64,
    end: u64,
}

#[derive(Debug, Clone)]
struct QueuedMessage {
    channel: u32,
    /// Number of the message within its channel.
    number: u64,
    at_ns: u64,
    bytes: Arc<[u8]>,
}

/// WebSocket message to a viewer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Outgoing {
    Text(String),
    Binary(Vec<u8>),
}

/// Next action for a viewer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Delivery {
    Message(Outgoing),
    Nothing,
    /// The queue is closed and empty.
    Closed,
    /// The viewer has sent too many invalid messages.
    Rejected,
}

impl ViewerQueue {
    /// Creates an empty queue of at most `max_bytes`.
    pub(super) fn new(max_bytes: usize) -> Self {
        Self {
            channels: BTreeMap::new(),
            channel_count: 0,
            changes: 0,
            messages: Ring::new(MAX_MESSAGES, max_bytes),
            notices: (0, String::new()),
            is_closed: false,
        }
    }

    /// Replaces the channels by one for each topic; channels of unchanged topics keep their ids.
    pub(super) fn set_topics(&mut self, topics: &[Topic]) {
        let before = self.channels.len();
        self.channels.retain(|_, channel| topics.contains(&channel.topic));
        let mut is_changed = self.channels.len() < before;
        for topic in topics {
            if self.channels.values().any(|channel| channel.topic == *topic) {
                continue;
            }
            self.channel_count += 1;
            let channel = TopicChannel { topic: topic.clone(), latched: None, first: 0, end: 0 };
            self.channels.insert(self.channel_count, channel);
            is_changed = true;
        }
        self.changes += u64::from(is_changed);
    }

    /// Appends a message. One that is too long counts as missed by every subscriber.
    pub(super) fn put(&mut self, message: &LiveMessage<'_>) {
        let has_topic =
            |(_, channel): &(&u32, &mut TopicChannel)| channel.topic.name == message.topic;
        let Some((id, channel)) = self.channels.iter_mut().find(has_topic) else { return };
        let number = channel.end;
        channel.end += 1;
        channel.latched = None;
        if message.bytes.len() > MAX_MESSAGE_BYTES {
            return;
        }
        let bytes = Arc::from(message.bytes);
        let message = QueuedMessage { channel: *id, number, at_ns: message.at_ns, bytes };
        channel.latched = channel.topic.is_retained.then(|| Arc::new(message.clone()));
        for dropped in self.messages.push(message.bytes.len(), message) {
            if let Some(channel) = self.channels.get_mut(&dropped.channel) {
                channel.first = dropped.number + 1;
            }
        }
    }

    /// Queues a status text for all present viewers.
    pub(super) fn announce(&mut self, text: String) {
        self.notices = (self.notices.0 + 1, text);
    }

    /// Closes the queue; viewers end after the remaining messages.
    pub(super) fn close(&mut self) {
        self.is_closed = true;
    }

    fn has(&self, channel: u32) -> bool {
        self.channels.contains_key(&channel)
    }
}

/// Reading position and subscriptions of a viewer. Its memory is bounded by the number of channels.
#[derive(Debug)]
pub(super) struct Viewer {
    session: ViewerSession,
    /// Position in the queue.
    position: u64,
    /// Number of the next message of each subscribed channel.
    due: BTreeMap<u32, u64>,
    /// Channels whose latched message is still to be sent.
    latched_due: BTreeSet<u32>,
    /// Advertised channels, and the number of the change that they reflect.
    advertised: BTreeSet<u32>,
    changes: u64,
    notices: u64,
    /// Texts to send before messages.
    texts: VecDeque<String>,
    is_rejected: bool,
}

impl Viewer {
    /// Creates a viewer at the end of the queue.
    pub(super) fn new(queue: &ViewerQueue, greeting: String) -> Self {
        let mut texts = VecDeque::from([greeting]);
        if queue.channels.is_empty() {
            let text = "no topics yet: they are advertised with the first scan";
            texts.push_back(status(StatusLevel::Info, text));
        }
        Self {
            session: ViewerSession::default(),
            position: queue.messages.end(),
            due: BTreeMap::new(),
            latched_due: BTreeSet::new(),
            advertised: BTreeSet::new(),
            changes: 0,
            notices: queue.notices.0,
            texts,
            is_rejected: false,
        }
    }

    /// Handles a text message of the viewer.
    pub(super) fn take_text(&mut self, text: &str, queue: &ViewerQueue) {
        let steps = self.session.handle_text(text, |channel| queue.has(channel));
        self.apply(steps, queue);
    }

    /// Handles a binary message of the viewer.
    pub(super) fn take_binary(&mut self, queue: &ViewerQueue) {
        let steps = self.session.handle_binary();
        self.apply(steps, queue);
    }

    fn apply(&mut self, steps: Vec<ViewerAction>, queue: &ViewerQueue) {
        for step in steps {
            match step {
                ViewerAction::StartChannel(channel) => {
                    let Some(begun) = queue.channels.get(&channel) else { continue };
                    self.due.insert(channel, begun.end);
                    if begun.latched.is_some() {
                        self.latched_due.insert(channel);
                    }
                }
                ViewerAction::StopChannel(channel) => {
                    self.due.remove(&channel);
                    self.latched_due.remove(&channel);
                }
                ViewerAction::SendText(text) => self.texts.push_back(text),
                ViewerAction::Close => self.is_rejected = true,
            }
        }
    }

    /// Returns the next message for the viewer, or the reason why there is none.
    pub(super) fn next(&mut self, queue: &ViewerQueue) -> Delivery {
        self.update_channels(queue);
        if self.notices != queue.notices.0 {
            self.notices = queue.notices.0;
            self.texts.push_back(status(StatusLevel::Warning, &queue.notices.1));
        }
        let missed = self.skip_dropped(queue);
        if missed > 0 {
            self.texts.push_back(missed_status(missed));
        }
        if let Some(text) = self.texts.pop_front() {
            return Delivery::Message(Outgoing::Text(text));
        }
        if self.is_rejected {
            return Delivery::Rejected;
        }
        match self.next_message(queue) {
            Some(outgoing) => Delivery::Message(outgoing),
            None if queue.is_closed => Delivery::Closed,
            None => Delivery::Nothing,
        }
    }

    fn update_channels(&mut self, queue: &ViewerQueue) {
        if self.changes == queue.changes {
            return;
        }
        self.changes = queue.changes;
        let current: BTreeSet<u32> = queue.channels.keys().copied().collect();
        let gone: Vec<u32> = self.advertised.difference(&current).copied().collect();
        if !gone.is_empty() {
            self.session.retain_channels(|channel| queue.has(channel));
            self.due.retain(|channel, _| queue.has(*channel));
            self.latched_due.retain(|channel| queue.has(*channel));
            self.texts.push_back(unadvertise(&gone));
        }
        let new = queue.channels.iter().filter(|(id, _)| !self.advertised.contains(id));
        let mut new = new.map(|(id, channel)| (*id, &channel.topic)).peekable();
        if new.peek().is_some() {
            self.texts.push_back(advertise(new));
        }
        self.advertised = current;
    }

    /// Skips dropped messages, and returns the number that the viewer missed.
    fn skip_dropped(&mut self, queue: &ViewerQueue) -> u64 {
        if self.position >= queue.messages.first() {
            return 0;
        }
        self.position = queue.messages.first();
        let mut missed = 0;
        for (id, due) in &mut self.due {
            let Some(channel) = queue.channels.get(id) else { continue };
            let dropped = channel.first.saturating_sub(*due);
            *due = channel.first.max(*due);
            // The last message of a latched topic is sent all the same.
            let is_latched = channel.latched.as_ref().is_some_and(|latched| latched.number < *due);
            if dropped > 0 && is_latched {
                self.latched_due.insert(*id);
            }
            missed += dropped - u64::from(dropped > 0 && is_latched);
        }
        missed
    }

    fn next_message(&mut self, queue: &ViewerQueue) -> Option<Outgoing> {
        while let Some(id) = self.latched_due.pop_first() {
            let latched = queue.channels.get(&id).and_then(|channel| channel.latched.as_ref());
            // A newer message is in the queue otherwise.
            let latched = latched
                .filter(|latched| self.due.get(&id).is_some_and(|due| latched.number < *due));
            let frame =
                latched.and_then(|latched| self.session.frame(id, latched.at_ns, &latched.bytes));
            if frame.is_some() {
                return frame.map(Outgoing::Binary);
            }
        }
        loop {
            let message = queue.messages.get(self.position)?;
            let due = self.due.get_mut(&message.channel);
            let Some(due) = due.filter(|due| message.number >= **due) else {
                self.position += 1;
                continue;
            };
            let skipped = message.number - *due;
            if skipped > 0 {
                // The messages in between were too long. The viewer receives the count first, then
                // this message.
                *due = message.number;
                return Some(Outgoing::Text(missed_status(skipped)));
            }
            *due = message.number + 1;
            self.position += 1;
            let frame = self.session.frame(message.channel, message.at_ns, &message.bytes);
            return frame.map(Outgoing::Binary);
        }
    }
}

fn missed_status(messages: u64) -> String {
    status(StatusLevel::Warning, &format!("{messages} messages left out"))
}

#[cfg(test)]
mod tests;

//! Foxglove's WebSocket protocol, as a server that only tells. Version 1, which Lichtblick and others speak, too.
//!
//! Sans-IO: a [`Session`] takes what a client sends and says what is to be done; the other functions write what a
//! server sends. Texts are JSON, messages are binary: a byte 1, the number of the subscription (32 bits), the time
//! (nanoseconds, 64 bits), all little-endian, and the message itself.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::json;

use crate::Topic;

/// The sub-protocol by both its names, which mean the same: a client asks for one of them.
pub const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// Longest text that is taken of a client, bytes: it could subscribe to a thousand channels at once.
pub const MOST_TEXT_BYTES: usize = 1 << 16;

/// A client that sent so many texts which make no sense is shown out.
const MOST_FAULTS: u32 = 100;

/// Longest sentence that a client is told of its own text, characters.
const MOST_CHARACTERS: usize = 200;

/// How much a status matters to who reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Good to know.
    Info = 0,
    /// Something is missing.
    Warning = 1,
    /// Something was refused.
    Error = 2,
}

/// What is to be done after something came from a client.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// Messages of this channel go to it from now on; what is kept of the channel goes at once.
    Begin(u32),
    /// They do no more.
    Cease(u32),
    /// It is told this.
    Say(String),
    /// It is shown out.
    End,
}

/// A client's session: what it is subscribed to. It holds at most one subscription for each channel that there is,
/// whatever the client sends.
#[derive(Debug, Clone, Default)]
pub struct Session {
    /// The client's number of each subscription, by channel.
    subscriptions: BTreeMap<u32, u32>,
    faults: u32,
}

/// What a client asks for; other fields belong to what this server does not do.
#[derive(Debug, Deserialize)]
struct Order {
    op: String,
    #[serde(default)]
    subscriptions: Vec<Subscription>,
    #[serde(default, rename = "subscriptionIds")]
    subscription_ids: Vec<u32>,
}

#[derive(Debug, Deserialize)]
struct Subscription {
    id: u32,
    #[serde(rename = "channelId")]
    channel: u32,
}

impl Session {
    /// Takes a text of the client; `is_there` says which channels there are.
    pub fn take_text(&mut self, text: &str, is_there: impl Fn(u32) -> bool) -> Vec<Step> {
        if text.len() > MOST_TEXT_BYTES {
            return self.fault(&format!("texts have at most {MOST_TEXT_BYTES} bytes"));
        }
        let order: Order = match serde_json::from_str(text) {
            Ok(order) => order,
            Err(error) => {
                return self.fault(&format!("this is no message of the protocol: {error}"));
            }
        };
        match order.op.as_str() {
            "subscribe" => self.subscribe(&order.subscriptions, is_there),
            "unsubscribe" => self.unsubscribe(&order.subscription_ids),
            other => self.fault(&format!("`{other}` is not done here: this server only tells")),
        }
    }

    /// Takes something binary of the client, which could only be a message that it publishes.
    pub fn take_binary(&mut self) -> Vec<Step> {
        self.fault("messages are not taken here: this server only tells")
    }

    fn subscribe(&mut self, asked: &[Subscription], is_there: impl Fn(u32) -> bool) -> Vec<Step> {
        let (mut steps, mut refused) = (Vec::new(), Refusals::default());
        for Subscription { id, channel } in asked {
            if !is_there(*channel) {
                refused.add(|| format!("there is no channel {channel}"));
            } else if self.subscriptions.contains_key(channel) {
                refused.add(|| format!("channel {channel} is subscribed to already"));
            } else if self.subscriptions.values().any(|known| known == id) {
                refused.add(|| format!("subscription {id} is of another channel already"));
            } else {
                self.subscriptions.insert(*channel, *id);
                steps.push(Step::Begin(*channel));
            }
        }
        steps.extend(self.tell(refused));
        steps
    }

    fn unsubscribe(&mut self, ids: &[u32]) -> Vec<Step> {
        let (mut steps, mut refused) = (Vec::new(), Refusals::default());
        for id in ids {
            let known = self.subscriptions.iter().find(|(_, known)| *known == id);
            let Some(channel) = known.map(|(channel, _)| *channel) else {
                refused.add(|| format!("there is no subscription {id}"));
                continue;
            };
            self.subscriptions.remove(&channel);
            steps.push(Step::Cease(channel));
        }
        steps.extend(self.tell(refused));
        steps
    }

    /// Forgets subscriptions to channels that are no more.
    pub fn keep_only(&mut self, is_there: impl Fn(u32) -> bool) {
        self.subscriptions.retain(|channel, _| is_there(*channel));
    }

    /// The channels that it is subscribed to.
    pub fn channels(&self) -> impl Iterator<Item = u32> {
        self.subscriptions.keys().copied()
    }

    /// A message of a channel as it goes to the client; `None` if that is not subscribed to it.
    #[must_use]
    pub fn frame(&self, channel: u32, at_ns: u64, message: &[u8]) -> Option<Vec<u8>> {
        const MESSAGE: u8 = 1;
        let id = self.subscriptions.get(&channel)?;
        let mut frame = Vec::with_capacity(1 + 4 + 8 + message.len());
        frame.push(MESSAGE);
        frame.extend(id.to_le_bytes());
        frame.extend(at_ns.to_le_bytes());
        frame.extend(message);
        Some(frame)
    }

    fn tell(&mut self, refused: Refusals) -> Vec<Step> {
        refused.in_words().map_or_else(Vec::new, |words| self.fault(&words))
    }

    fn fault(&mut self, what: &str) -> Vec<Step> {
        self.faults = self.faults.saturating_add(1);
        let shown: String = what.chars().take(MOST_CHARACTERS).collect();
        let said = Step::Say(status(Level::Error, &shown));
        if self.faults < MOST_FAULTS { vec![said] } else { vec![said, Step::End] }
    }
}

/// What was refused of one text: the first in words, the others as a number.
#[derive(Debug, Default)]
struct Refusals {
    first: Option<String>,
    others: usize,
}

impl Refusals {
    fn add(&mut self, words: impl FnOnce() -> String) {
        match self.first {
            None => self.first = Some(words()),
            Some(_) => self.others += 1,
        }
    }

    fn in_words(self) -> Option<String> {
        let Self { first, others } = self;
        first.map(|first| match others {
            0 => first,
            _ => format!("{first}, and {others} more of this text were refused"),
        })
    }
}

/// What a client is told first: who the server is, and by which session, so that it knows when that is another.
#[must_use]
pub fn server_info(session: &str) -> String {
    json!({
        "op": "serverInfo",
        "name": concat!("sonard ", env!("CARGO_PKG_VERSION")),
        "capabilities": [],
        "supportedEncodings": [],
        "metadata": {},
        "sessionId": session,
    })
    .to_string()
}

/// Tells of channels that there are now, by their numbers.
pub fn advertise<'a>(channels: impl IntoIterator<Item = (u32, &'a Topic)>) -> String {
    let channel = |(id, topic): (u32, &Topic)| {
        json!({
            "id": id,
            "topic": topic.name,
            "encoding": "cdr",
            "schemaName": topic.type_name(),
            "schemaEncoding": "ros2msg",
            "schema": topic.definition(),
        })
    };
    let channels: Vec<_> = channels.into_iter().map(channel).collect();
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// Tells of channels that are no more.
#[must_use]
pub fn unadvertise(channels: &[u32]) -> String {
    json!({ "op": "unadvertise", "channelIds": channels }).to_string()
}

/// Tells something in words.
#[must_use]
pub fn status(level: Level, message: &str) -> String {
    json!({ "op": "status", "level": level as u8, "message": message }).to_string()
}

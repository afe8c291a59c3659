//! Server side of Foxglove's WebSocket protocol, version 1, for publishing only. Lichtblick
//! supports it, too.
//!
//! Sans-IO: a [`ViewerSession`] handles client messages and returns the actions to take; the other
//! functions encode server messages. Text messages are JSON. Binary messages are a byte 1, the
//! subscription id (32 bits), the time (nanoseconds, 64 bits), all little-endian, and the encoded
//! message.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::json;

use crate::Topic;

/// Equivalent names of the sub-protocol, of which a client requests one.
pub const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// Maximum length of a client's text message: sufficient to subscribe to a thousand channels.
pub const MAX_TEXT_BYTES: usize = 1 << 16;

/// Number of invalid messages after which a client is disconnected.
const MAX_FAULTS: u32 = 100;

/// Maximum length of a status message that quotes a client's text, characters.
const MAX_STATUS_CHARACTERS: usize = 200;

/// Severity of a status message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StatusLevel {
    /// Information without consequences.
    Info = 0,
    /// Missing data that the client may need.
    Warning = 1,
    /// Rejected request of the client.
    Error = 2,
}

/// Action to take after a client message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ViewerAction {
    /// Send messages of this channel from now on, beginning with its retained message.
    StartChannel(u32),
    /// Stop sending messages of this channel.
    StopChannel(u32),
    /// Send this text to the client.
    SendText(String),
    /// Close the connection.
    Close,
}

/// Subscriptions of a client, limited to one per existing channel.
#[derive(Debug, Clone, Default)]
pub struct ViewerSession {
    /// Client's subscription id, by channel.
    subscriptions: BTreeMap<u32, u32>,
    faults: u32,
}

/// Client message; fields of unsupported operations are ignored.
#[derive(Debug, Deserialize)]
struct ClientMessage {
    op: String,
    #[serde(default)]
    subscriptions: Vec<SubscribeRequest>,
    #[serde(default, rename = "subscriptionIds")]
    subscription_ids: Vec<u32>,
}

#[derive(Debug, Deserialize)]
struct SubscribeRequest {
    id: u32,
    #[serde(rename = "channelId")]
    channel: u32,
}

impl ViewerSession {
    /// Handles a text message of the client; `is_there` returns `true` for existing channels.
    pub fn handle_text(&mut self, text: &str, is_there: impl Fn(u32) -> bool) -> Vec<ViewerAction> {
        if text.len() > MAX_TEXT_BYTES {
            return self.fault(&format!("text messages have at most {MAX_TEXT_BYTES} bytes"));
        }
        let message: ClientMessage = match serde_json::from_str(text) {
            Ok(message) => message,
            Err(error) => {
                return self.fault(&format!("invalid message: {error}"));
            }
        };
        match message.op.as_str() {
            "subscribe" => self.subscribe(&message.subscriptions, is_there),
            "unsubscribe" => self.unsubscribe(&message.subscription_ids),
            other => self
                .fault(&format!("operation `{other}` not supported: this server only publishes")),
        }
    }

    /// Handles a binary message of the client, which could only be a publication.
    pub fn handle_binary(&mut self) -> Vec<ViewerAction> {
        self.fault("client publications not supported: this server only publishes")
    }

    fn subscribe(
        &mut self,
        requests: &[SubscribeRequest],
        is_there: impl Fn(u32) -> bool,
    ) -> Vec<ViewerAction> {
        let (mut steps, mut rejected) = (Vec::new(), Rejections::default());
        for SubscribeRequest { id, channel } in requests {
            if !is_there(*channel) {
                rejected.add(|| format!("unknown channel {channel}"));
            } else if self.subscriptions.contains_key(channel) {
                rejected.add(|| format!("already subscribed to channel {channel}"));
            } else if self.subscriptions.values().any(|used| used == id) {
                rejected.add(|| format!("subscription {id} already used for another channel"));
            } else {
                self.subscriptions.insert(*channel, *id);
                steps.push(ViewerAction::StartChannel(*channel));
            }
        }
        steps.extend(self.report(rejected));
        steps
    }

    fn unsubscribe(&mut self, ids: &[u32]) -> Vec<ViewerAction> {
        let (mut steps, mut rejected) = (Vec::new(), Rejections::default());
        for id in ids {
            let found = self.subscriptions.iter().find(|(_, used)| *used == id);
            let Some(channel) = found.map(|(channel, _)| *channel) else {
                rejected.add(|| format!("unknown subscription {id}"));
                continue;
            };
            self.subscriptions.remove(&channel);
            steps.push(ViewerAction::StopChannel(channel));
        }
        steps.extend(self.report(rejected));
        steps
    }

    /// Removes subscriptions to channels that no longer exist.
    pub fn retain_channels(&mut self, is_there: impl Fn(u32) -> bool) {
        self.subscriptions.retain(|channel, _| is_there(*channel));
    }

    /// Returns the channels to which the client is subscribed.
    pub fn channels(&self) -> impl Iterator<Item = u32> {
        self.subscriptions.keys().copied()
    }

    /// Encodes a message of a channel for the client; `None` without a subscription.
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

    fn report(&mut self, rejected: Rejections) -> Vec<ViewerAction> {
        rejected.message().map_or_else(Vec::new, |message| self.fault(&message))
    }

    fn fault(&mut self, what: &str) -> Vec<ViewerAction> {
        self.faults = self.faults.saturating_add(1);
        let shown: String = what.chars().take(MAX_STATUS_CHARACTERS).collect();
        let status = ViewerAction::SendText(status(StatusLevel::Error, &shown));
        if self.faults < MAX_FAULTS { vec![status] } else { vec![status, ViewerAction::Close] }
    }
}

/// Rejected requests of one client message: the first as text, the others counted.
#[derive(Debug, Default)]
struct Rejections {
    first: Option<String>,
    others: usize,
}

impl Rejections {
    fn add(&mut self, text: impl FnOnce() -> String) {
        match self.first {
            None => self.first = Some(text()),
            Some(_) => self.others += 1,
        }
    }

    fn message(self) -> Option<String> {
        let Self { first, others } = self;
        first.map(|first| match others {
            0 => first,
            _ => format!("{first}, and {others} more requests of this message rejected"),
        })
    }
}

/// Encodes the first message to a client: server name and session id, by which clients detect a
/// restart.
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

/// Encodes the advertisement of channels with their ids.
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

/// Encodes the removal of channels.
#[must_use]
pub fn unadvertise(channels: &[u32]) -> String {
    json!({ "op": "unadvertise", "channelIds": channels }).to_string()
}

/// Encodes a status message.
#[must_use]
pub fn status(level: StatusLevel, message: &str) -> String {
    json!({ "op": "status", "level": level as u8, "message": message }).to_string()
}

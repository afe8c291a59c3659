//! A viewer: another implementation of WebSockets' client side, and as much of the messages as tests look at.

use std::{
    collections::BTreeMap,
    io::{Read, Write},
    time::Duration,
};

use serde_json::{Value, json};
use sonard_test_support::in_process::Connection;
use tungstenite::{
    Message, WebSocket,
    client::IntoClientRequest as _,
    handshake::{HandshakeError, client::Response},
    http::HeaderValue,
};

/// Connected viewer.
pub(crate) struct Viewer<S> {
    pub(crate) socket: WebSocket<S>,
    /// The sub-protocol that the server has chosen.
    pub(crate) protocol: String,
    /// Number and schema of each channel by topic.
    pub(crate) channels: BTreeMap<String, (u64, Value)>,
    /// Topics by subscription.
    topics: BTreeMap<u32, String>,
}

/// Messages from the server.
#[derive(Debug)]
pub(crate) enum Came {
    Text(Value),
    Message(u32, Vec<u8>),
    /// The code with which it closed.
    End(u16),
}

/// Messages as they came.
#[derive(Debug, Default)]
pub(crate) struct Received {
    messages: Vec<(String, Vec<u8>)>,
    /// Words of statuses.
    pub(crate) words: Vec<String>,
}

impl Received {
    pub(crate) fn of<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = (&'a str, &'a [u8])> {
        let messages = self.messages.iter().filter(move |(of, _)| of == topic);
        messages.map(|(topic, bytes)| (topic.as_str(), bytes.as_slice()))
    }

    pub(crate) fn topics(&self) -> impl Iterator<Item = &str> {
        let topics: std::collections::BTreeSet<&str> =
            self.messages.iter().map(|(topic, _)| topic.as_str()).collect();
        topics.into_iter()
    }
}

/// Opens a viewer's WebSocket with further headers; returns the status if it is rejected.
pub(crate) fn request_viewer<S: Read + Write>(
    stream: S,
    path: &str,
    headers: &[(&'static str, &str)],
) -> Result<(WebSocket<S>, Response), u16> {
    let mut request = format!("ws://localhost{path}").into_client_request().expect("a request");
    for (name, value) in headers {
        request.headers_mut().insert(*name, HeaderValue::from_str(value).expect("a header"));
    }
    tungstenite::client(request, stream).map_err(|error| match error {
        HandshakeError::Failure(tungstenite::Error::Http(response)) => response.status().as_u16(),
        other => panic!("no answer: {other:?}"),
    })
}

impl<S: Read + Write> Viewer<S> {
    pub(crate) fn new(stream: S, protocol: &str) -> Self {
        let requested =
            request_viewer(stream, "/foxglove/", &[("sec-websocket-protocol", protocol)]);
        let (socket, response) = requested.expect("it may come");
        let chosen = response.headers()["sec-websocket-protocol"].to_str().expect("text");
        let protocol = chosen.to_owned();
        Self { socket, protocol, channels: BTreeMap::new(), topics: BTreeMap::new() }
    }

    /// Returns the next message, or `None` if the connection broke.
    pub(crate) fn next(&mut self) -> Option<Came> {
        loop {
            match self.socket.read().ok()? {
                Message::Text(text) => {
                    let text: Value = serde_json::from_str(&text).expect("JSON");
                    self.receive(&text);
                    return Some(Came::Text(text));
                }
                Message::Binary(frame) => {
                    assert_eq!(frame[0], 1, "a message's opcode");
                    let id = u32::from_le_bytes(frame[1..5].try_into().expect("four"));
                    return Some(Came::Message(id, frame[13..].to_vec()));
                }
                Message::Close(close) => {
                    return Some(Came::End(close.map_or(1005, |close| close.code.into())));
                }
                Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => {}
            }
        }
    }

    fn receive(&mut self, text: &Value) {
        if text["op"] == "advertise" {
            for channel in text["channels"].as_array().expect("channels") {
                let topic = channel["topic"].as_str().expect("a topic").to_owned();
                let number = channel["id"].as_u64().expect("a number");
                self.channels.insert(topic, (number, channel.clone()));
            }
        }
    }

    /// The next text.
    pub(crate) fn text(&mut self) -> Value {
        loop {
            match self.next() {
                Some(Came::Text(text)) => return text,
                Some(Came::Message(..)) => {}
                other => panic!("{other:?}"),
            }
        }
    }

    pub(crate) fn wait_for_channels(&mut self) {
        while self.channels.is_empty() {
            drop(self.text());
        }
    }

    pub(crate) fn send(&mut self, order: &Value) {
        self.socket.send(Message::text(order.to_string())).expect("it takes that");
    }

    pub(crate) fn subscribe_to_all(&mut self) {
        let wishes: Vec<Value> = self
            .channels
            .values()
            .map(|(number, _)| json!({"id": number + 100, "channelId": number}))
            .collect();
        for (topic, (number, _)) in &self.channels {
            self.topics.insert(*number as u32 + 100, topic.clone());
        }
        self.send(&json!({"op": "subscribe", "subscriptions": wishes}));
    }

    /// All that comes until a message of this topic, with it.
    pub(crate) fn until(&mut self, topic: &str) -> Received {
        let mut reported = Received::default();
        while reported.of(topic).next().is_none() {
            let came = self.next().expect("it goes on");
            self.take(came, &mut reported);
        }
        reported
    }

    fn take(&self, came: Came, reported: &mut Received) {
        match came {
            Came::Message(id, bytes) => reported.messages.push((self.topics[&id].clone(), bytes)),
            Came::Text(text) => {
                reported.words.extend(text["message"].as_str().map(str::to_owned));
            }
            Came::End(code) => panic!("it closed with {code}"),
        }
    }

    pub(crate) fn close(&mut self) {
        drop(self.socket.close(None));
        while let Some(came) = self.next() {
            if matches!(came, Came::End(_)) {
                break;
            }
        }
    }
}

impl<S: Read + Write> Viewer<S> {
    /// All that comes while the condition holds.
    pub(crate) fn receive_while(&mut self, condition: impl Fn(&S) -> bool) -> Received {
        let mut reported = Received::default();
        while condition(self.socket.get_ref()) {
            // Without a message within the connection's read timeout, the condition decides.
            if let Some(came) = self.next() {
                self.take(came, &mut reported);
            }
        }
        reported
    }
}

impl Viewer<Connection> {
    /// All that comes within a span of simulated time.
    pub(crate) fn receive_for(&mut self, span: Duration) -> Received {
        let until = self.socket.get_ref().now() + span;
        self.socket.get_mut().set_read_timeout(Duration::from_millis(200));
        let reported = self.receive_while(|connection| connection.now() < until);
        self.socket.get_mut().set_read_timeout(Duration::from_secs(20));
        reported
    }
}

/// Stamp, nanoseconds, and range of a `sensor_msgs/Range` in CDR.
pub(crate) fn range_of(bytes: &[u8]) -> (i128, f32) {
    let word = |at: usize| bytes[4 + at..8 + at].try_into().expect("four bytes");
    let seconds = i32::from_le_bytes(word(0));
    let nanoseconds = u32::from_le_bytes(word(4));
    let frame = u32::from_le_bytes(word(8)) as usize;
    // Behind the frame's name the kind of radiation, then field of view, limits and the range.
    let floats = (12 + frame + 1).next_multiple_of(4);
    let range = f32::from_le_bytes(word(floats + 12));
    (i128::from(seconds) * 1_000_000_000 + i128::from(nanoseconds), range)
}

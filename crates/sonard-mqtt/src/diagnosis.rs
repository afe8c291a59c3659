//! Diagnosis of disconnections by the broker, and of the messages that it rejects.
//!
//! MQTT 3.1.1 has no reason codes: a broker that rejects a message closes the connection. After
//! such a disconnection messages are sent one at a time, so that the next one identifies its
//! message. A message that is alone in flight at two disconnections is not sent again, if the
//! broker accepts others. Pure: the caller reports the messages in flight.

use std::time::Duration;

use super::{
    in_flight::MAX_IN_FLIGHT,
    topics::{MessageKind, Topics},
};

/// Number of disconnections with a single message in flight until the message is dropped.
const MAX_STRIKES: u8 = 2;
/// Number of consecutive unexplained disconnections until a duplicate client is suspected.
const MAX_UNEXPLAINED: u8 = 4;
/// Duration of a connection that ends such a sequence.
pub(super) const STABLE_AFTER: Duration = Duration::from_secs(120);

/// Message in flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SentMessage {
    /// Sequence number, if the message is a record.
    pub(super) record: Option<u64>,
    /// Kind of the message; `None` for the subscription to commands.
    pub(super) kind: Option<MessageKind>,
    /// Length of topic and payload, bytes.
    pub(super) bytes: usize,
}

impl SentMessage {
    /// Returns `true` for the same record, or another message of the same kind: the length of a
    /// repeated status differs.
    fn is_repeated_by(&self, later: &Self) -> bool {
        (self.record, self.kind) == (later.record, later.kind)
    }
}

/// Finding after the end of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Finding {
    /// No cause is identified yet.
    Open,
    /// The broker rejects everything, or another client has the same id: no message is dropped.
    Cause(Cause),
    /// The broker rejects a message, which is dropped.
    Rejected(SentMessage, Cause),
}

/// Cause of repeated disconnections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cause {
    /// Messages of this size in bytes or larger; the broker accepted only smaller ones.
    Size(usize),
    /// Messages of this kind, none of which the broker accepted.
    Kind(Option<MessageKind>),
    /// A single message, although others of the same size and kind were accepted.
    Message,
    /// All messages, from the first on.
    Everything,
    /// No message: the broker closes working connections.
    OtherClient,
}

impl Cause {
    /// Describes the cause, with a remedy. `kind` is the kind of the rejected message.
    #[must_use]
    pub(super) fn describe(
        self,
        kind: Option<MessageKind>,
        topics: &Topics,
        client_id: &str,
    ) -> String {
        let topic = |kind: Option<MessageKind>| {
            kind.map_or_else(|| topics.commands(), |kind| topics.topic_for(kind))
        };
        match self {
            Self::Size(bytes) => format!(
                "the broker closes the connection at messages of {bytes} bytes and more: raise its \
                 maximum message size (mosquitto: max_packet_size)"
            ),
            Self::Kind(kind) => format!(
                "the broker closes the connection at every message for {}: permit this client to use that topic",
                topic(kind)
            ),
            Self::Message => format!(
                "the broker closes the connection at a message to {}: see the broker's log",
                topic(kind)
            ),
            Self::Everything => format!(
                "the broker closes the connection at the first message: permit this client to publish to {}",
                topics.all()
            ),
            Self::OtherClient => format!(
                "the broker keeps closing working connections: probably another client uses the id \
                 {client_id} (set a different fleet.robot for each daemon); otherwise see the \
                 broker's log"
            ),
        }
    }
}

/// State of the diagnosis across connections.
#[derive(Debug, Default)]
pub(super) struct Diagnosis {
    /// Number of further messages to send one at a time.
    careful: usize,
    /// Number of messages in flight.
    waiting: usize,
    /// Message in flight, if it is the only one.
    alone: Option<SentMessage>,
    /// Message that was alone in flight at the latest disconnections, with its smallest length, and
    /// their number.
    suspect: Option<(SentMessage, u8)>,
    /// `true` if the broker acknowledged a message on this connection.
    has_accepted: bool,
    /// Maximum accepted length on any connection, bytes.
    accepted_bytes: usize,
    /// Kinds of message accepted on any connection.
    accepted_kinds: Vec<Option<MessageKind>>,
    /// Minimum rejected length, bytes.
    limit_bytes: Option<usize>,
    denied: Vec<Option<MessageKind>>,
    unexplained: u8,
}

impl Diagnosis {
    /// Returns `true` if a message may be sent while others are in flight.
    #[must_use]
    pub(super) const fn allows_many(&self) -> bool {
        self.careful == 0
    }

    /// Returns the cause for which such a message is not sent, if any.
    #[must_use]
    pub(super) fn rejects(&self, kind: Option<MessageKind>, bytes: usize) -> Option<Cause> {
        if self.denied.contains(&kind) {
            return Some(Cause::Kind(kind));
        }
        self.limit_bytes.filter(|limit| bytes >= *limit).map(Cause::Size)
    }

    /// Returns `true` if some messages are not sent.
    #[must_use]
    pub(super) const fn rejects_any(&self) -> bool {
        self.limit_bytes.is_some() || !self.denied.is_empty()
    }

    /// Notes a sent message.
    pub(super) fn sent(&mut self, sending: SentMessage) {
        self.alone = (self.waiting == 0).then_some(sending);
        self.waiting += 1;
    }

    /// Notes an acknowledged message.
    pub(super) fn acknowledged(&mut self, sending: SentMessage) {
        self.has_accepted = true;
        self.accepted_bytes = self.accepted_bytes.max(sending.bytes);
        if !self.accepted_kinds.contains(&sending.kind) {
            self.accepted_kinds.push(sending.kind);
        }
        self.suspect.take_if(|(suspect, _)| {
            suspect.is_repeated_by(&sending) && suspect.bytes <= sending.bytes
        });
        self.waiting = self.waiting.saturating_sub(1);
        self.careful = self.careful.saturating_sub(1);
        self.alone = self.alone.filter(|alone| *alone != sending);
    }

    /// Resets the diagnosis after a failed connection attempt: the broker's limits may have
    /// changed.
    pub(super) fn not_accepted(&mut self) {
        *self = Self::default();
    }

    /// Evaluates the end of a connection after the duration `after`; `by_broker` if the broker
    /// closed it.
    pub(super) fn ended(&mut self, by_broker: bool, after: Duration) -> Finding {
        let (waiting, alone) = (std::mem::take(&mut self.waiting), self.alone.take());
        let has_accepted = std::mem::take(&mut self.has_accepted);
        if after >= STABLE_AFTER {
            self.unexplained = 0;
        }
        if !by_broker {
            return Finding::Open;
        }
        if waiting > 0 {
            self.careful = MAX_IN_FLIGHT;
        }
        self.suspect = alone.map(|alone| match self.suspect {
            Some((suspect, strikes)) if suspect.is_repeated_by(&alone) => {
                let bytes = suspect.bytes.min(alone.bytes);
                (SentMessage { bytes, ..alone }, strikes + 1)
            }
            _ => (alone, 1),
        });
        match self.suspect.filter(|(_, strikes)| *strikes >= MAX_STRIKES).map(|(alone, _)| alone) {
            Some(alone) if has_accepted => self.reject(alone),
            Some(alone) if alone.kind == Some(MessageKind::Online) => {
                // The first message; the next one shows whether it is the only rejected one.
                self.denied.push(alone.kind);
                Finding::Cause(Cause::Everything)
            }
            Some(_) => {
                self.denied.clear();
                Finding::Cause(Cause::Everything)
            }
            // The connection never worked.
            None if !has_accepted => Finding::Open,
            None => {
                self.unexplained = self.unexplained.saturating_add(1);
                match self.unexplained >= MAX_UNEXPLAINED {
                    true => Finding::Cause(Cause::OtherClient),
                    false => Finding::Open,
                }
            }
        }
    }

    fn reject(&mut self, sending: SentMessage) -> Finding {
        let SentMessage { kind, bytes, .. } = sending;
        let cause = if bytes > self.accepted_bytes {
            let limit = self.limit_bytes.map_or(bytes, |limit| limit.min(bytes));
            self.limit_bytes = Some(limit);
            Cause::Size(limit)
        } else if self.accepted_kinds.contains(&kind) {
            Cause::Message
        } else {
            self.denied.push(kind);
            Cause::Kind(kind)
        };
        (self.suspect, self.careful, self.unexplained) = (None, 0, 0);
        Finding::Rejected(sending, cause)
    }
}

#[cfg(test)]
mod tests;

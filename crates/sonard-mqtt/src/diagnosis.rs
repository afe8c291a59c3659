//! Why a broker ends connections that it has accepted, and which messages it does not take.
//!
//! MQTT 3.1.1 has no reason codes: a broker that objects to a message closes the connection. Pure: the diagnosis is
//! given what was under way each time. After such a loss messages are sent one at a time, so that the next loss names
//! its message; one that is lost twice by itself is not sent again, if the broker takes others.

use std::time::Duration;

use super::{
    topics::{Kind, Topics},
    window::MOST_UNDER_WAY,
};

/// Losses of one message by itself until it is given up.
const STRIKES: u8 = 2;
/// Losses in a row without a message to blame until another client is suspected.
const UNEXPLAINED: u8 = 4;
/// A connection that lasts so long ends such a row.
pub(super) const STEADY: Duration = Duration::from_secs(120);

/// A message that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sending {
    /// Number of the record, if it is one.
    pub(super) record: Option<u64>,
    /// Its kind; `None` for the subscription to commands.
    pub(super) kind: Option<Kind>,
    /// Length of its payload.
    pub(super) bytes: usize,
}

/// The finding after a connection has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Finding {
    /// None yet.
    Open,
    /// The broker takes nothing at all, or another client has the same id: nothing is left out.
    Cause(Cause),
    /// The broker does not take this message.
    Refused(Sending, Cause),
}

/// A cause of repeated losses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cause {
    /// Messages of so many bytes and more, which is more than any that the broker has taken.
    Size(usize),
    /// Messages of this kind, none of which the broker has taken.
    Kind(Option<Kind>),
    /// This message, although others of its size and kind were taken.
    Message,
    /// Every message, from the first on.
    Everything,
    /// No message: the broker ends connections that work.
    OtherClient,
}

impl Cause {
    /// The cause in words; `kind` is that of the message that showed it.
    #[must_use]
    pub(super) fn words(self, kind: Option<Kind>, topics: &Topics, client_id: &str) -> String {
        let topic =
            |kind: Option<Kind>| kind.map_or_else(|| topics.commands(), |kind| topics.of(kind));
        match self {
            Self::Size(bytes) => format!(
                "the broker closes the connection at messages of {bytes} bytes and more: raise its limit for the size \
                 of messages (mosquitto: max_packet_size)"
            ),
            Self::Kind(kind) => format!(
                "the broker closes the connection at every message for {}: permit this client to use that topic",
                topic(kind)
            ),
            Self::Message => format!(
                "the broker closes the connection at one message to {}: see the broker's log",
                topic(kind)
            ),
            Self::Everything => format!(
                "the broker closes the connection at the first message: permit this client to publish to {}",
                topics.all()
            ),
            Self::OtherClient => format!(
                "the broker keeps closing connections that work: probably another client uses the id {client_id} (give \
                 each daemon a fleet.robot of its own); otherwise see the broker's log"
            ),
        }
    }
}

/// Memory of losses, from connection to connection.
#[derive(Debug, Default)]
pub(super) struct Diagnosis {
    /// Messages to be sent one at a time from now on.
    careful: usize,
    /// Messages under way.
    waiting: usize,
    /// The message under way, if it is the only one.
    alone: Option<Sending>,
    struck: Option<(Sending, u8)>,
    /// Whether the broker has taken a message on this connection.
    has_taken: bool,
    /// Largest payload, and kinds, that it has taken at all.
    taken_bytes: usize,
    taken_kinds: Vec<Option<Kind>>,
    /// Least payload that it does not take.
    limit_bytes: Option<usize>,
    denied: Vec<Option<Kind>>,
    unexplained: u8,
}

impl Diagnosis {
    /// Whether a message may be sent while others are under way.
    #[must_use]
    pub(super) const fn allows_many(&self) -> bool {
        self.careful == 0
    }

    /// Why such a message is not sent at all, if so.
    #[must_use]
    pub(super) fn refuses(&self, kind: Option<Kind>, bytes: usize) -> Option<Cause> {
        if self.denied.contains(&kind) {
            return Some(Cause::Kind(kind));
        }
        self.limit_bytes.filter(|limit| bytes >= *limit).map(Cause::Size)
    }

    /// Whether there are messages that are not sent at all.
    #[must_use]
    pub(super) const fn leaves_out(&self) -> bool {
        self.limit_bytes.is_some() || !self.denied.is_empty()
    }

    /// This is under way from now on.
    pub(super) fn sent(&mut self, sending: Sending) {
        self.alone = (self.waiting == 0).then_some(sending);
        self.waiting += 1;
    }

    /// The broker has this message.
    pub(super) fn acknowledged(&mut self, sending: Sending) {
        self.has_taken = true;
        self.taken_bytes = self.taken_bytes.max(sending.bytes);
        if !self.taken_kinds.contains(&sending.kind) {
            self.taken_kinds.push(sending.kind);
        }
        if self.struck.is_some_and(|(struck, _)| struck == sending) {
            self.struck = None;
        }
        self.waiting = self.waiting.saturating_sub(1);
        self.careful = self.careful.saturating_sub(1);
        self.alone = self.alone.filter(|alone| *alone != sending);
    }

    /// The broker was not reached, or did not accept the connection: what it takes may be different afterwards.
    pub(super) fn not_accepted(&mut self) {
        *self = Self::default();
    }

    /// The connection has ended `after` this time; `by_broker` if the broker has closed it.
    pub(super) fn ended(&mut self, by_broker: bool, after: Duration) -> Finding {
        let (waiting, alone) = (std::mem::take(&mut self.waiting), self.alone.take());
        let has_taken = std::mem::take(&mut self.has_taken);
        if after >= STEADY {
            self.unexplained = 0;
        }
        if !by_broker {
            return Finding::Open;
        }
        if waiting > 0 {
            self.careful = MOST_UNDER_WAY;
        }
        let strikes = match (alone, self.struck) {
            (Some(alone), Some((struck, strikes))) if alone == struck => strikes + 1,
            (Some(_), _) => 1,
            (None, _) => 0,
        };
        self.struck = alone.map(|alone| (alone, strikes));
        match alone.filter(|_| strikes >= STRIKES) {
            Some(alone) if has_taken => self.refuse(alone),
            Some(alone) if alone.kind == Some(Kind::Online) => {
                // The first of all; the next one tells whether it is the only one.
                self.denied.push(alone.kind);
                Finding::Cause(Cause::Everything)
            }
            Some(_) => {
                self.denied.clear();
                Finding::Cause(Cause::Everything)
            }
            // Nothing worked that could be ended.
            None if !has_taken => Finding::Open,
            None => {
                self.unexplained = self.unexplained.saturating_add(1);
                match self.unexplained >= UNEXPLAINED {
                    true => Finding::Cause(Cause::OtherClient),
                    false => Finding::Open,
                }
            }
        }
    }

    fn refuse(&mut self, sending: Sending) -> Finding {
        let Sending { kind, bytes, .. } = sending;
        let cause = if bytes > self.taken_bytes {
            let limit = self.limit_bytes.map_or(bytes, |limit| limit.min(bytes));
            self.limit_bytes = Some(limit);
            Cause::Size(limit)
        } else if self.taken_kinds.contains(&kind) {
            Cause::Message
        } else {
            self.denied.push(kind);
            Cause::Kind(kind)
        };
        (self.struck, self.careful, self.unexplained) = (None, 0, 0);
        Finding::Refused(sending, cause)
    }
}

#[cfg(test)]
mod tests;

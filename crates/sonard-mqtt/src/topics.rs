//! MQTT topics of a robot.

use sonard_api::config::MqttKeys;
use sonard_records::Record;

/// Kind of a published record, which determines its topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageKind {
    /// Presence of the daemon, `true` or `false`; retained.
    Online,
    /// Status of the daemon; retained.
    Status,
    /// Conditions of the readings that follow; retained.
    Session,
    /// Start of a scan.
    ScanStart,
    /// Reading of one beam.
    Ping,
    /// End of a scan.
    ScanEnd,
    /// Event record.
    Event,
    /// Reply to a command.
    Answer,
}

impl MessageKind {
    /// Returns the kind of message for a record.
    #[must_use]
    pub const fn for_record(record: &Record) -> Self {
        match record {
            Record::Session(_) => Self::Session,
            Record::ScanStart(_) => Self::ScanStart,
            Record::Ping(_) => Self::Ping,
            Record::ScanEnd(_) => Self::ScanEnd,
            Record::Event(_) => Self::Event,
        }
    }

    /// Returns `true` for messages that the broker retains for later subscribers.
    #[must_use]
    pub const fn is_retained(self) -> bool {
        matches!(self, Self::Online | Self::Status | Self::Session)
    }

    const fn level(self) -> &'static str {
        match self {
            Self::Online => "online",
            Self::Status => "status",
            Self::Session => "session",
            Self::ScanStart => "scan_start",
            Self::Ping => "ping",
            Self::ScanEnd => "scan_end",
            Self::Event => "event",
            Self::Answer => "answer",
        }
    }
}

/// Topics of a robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topics {
    /// Common prefix, with a trailing slash.
    prefix: String,
}

impl Topics {
    /// Creates the topics for a robot name.
    #[must_use]
    pub fn new(keys: &MqttKeys, robot: &str) -> Self {
        Self { prefix: format!("{}/{robot}/", keys.topic) }
    }

    /// Returns the topic for a kind of message.
    #[must_use]
    pub fn topic_for(&self, kind: MessageKind) -> String {
        format!("{}{}", self.prefix, kind.level())
    }

    /// Topic filter for all published messages.
    #[must_use]
    pub fn all(&self) -> String {
        format!("{}#", self.prefix)
    }

    /// Topic filter for commands.
    #[must_use]
    pub fn commands(&self) -> String {
        format!("{}command/+", self.prefix)
    }

    /// Extracts the name of a command from its topic.
    #[must_use]
    pub fn command<'a>(&self, topic: &'a str) -> Option<&'a str> {
        topic.strip_prefix(&self.prefix)?.strip_prefix("command/")
    }
}

//! Which topic what is sent under.

use sonard_api::config::MqttKeys;
use sonard_records::Record;

/// A kind of message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Whether the daemon is there; kept by the broker.
    Online,
    /// What the daemon is doing; kept by the broker.
    Status,
    /// What the readings that follow are of; kept by the broker.
    Session,
    /// A scan begins.
    ScanStart,
    /// A reading.
    Ping,
    /// A scan is over.
    ScanEnd,
    /// Something happened.
    Event,
    /// What became of a command.
    Answer,
}

impl Kind {
    /// The kind of a record.
    #[must_use]
    pub const fn of(record: &Record) -> Self {
        match record {
            Record::Session(_) => Self::Session,
            Record::ScanStart(_) => Self::ScanStart,
            Record::Ping(_) => Self::Ping,
            Record::ScanEnd(_) => Self::ScanEnd,
            Record::Event(_) => Self::Event,
        }
    }

    /// Whether the broker keeps the last one for who comes later.
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

/// The topics of a robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topics {
    /// With the slash at its end.
    prefix: String,
}

impl Topics {
    /// Those of the robot of this name.
    #[must_use]
    pub fn new(keys: &MqttKeys, robot: &str) -> Self {
        Self { prefix: format!("{}/{robot}/", keys.topic) }
    }

    /// The topic of a kind of message.
    #[must_use]
    pub fn of(&self, kind: Kind) -> String {
        format!("{}{}", self.prefix, kind.level())
    }

    /// A filter of everything that is published.
    #[must_use]
    pub fn all(&self) -> String {
        format!("{}#", self.prefix)
    }

    /// What commands are published under.
    #[must_use]
    pub fn commands(&self) -> String {
        format!("{}command/+", self.prefix)
    }

    /// The command that a topic names.
    #[must_use]
    pub fn command<'a>(&self, topic: &'a str) -> Option<&'a str> {
        topic.strip_prefix(&self.prefix)?.strip_prefix("command/")
    }
}

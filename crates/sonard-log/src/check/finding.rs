//! What can be found in a log.

use std::fmt;

use serde::Serialize;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Data is damaged, missing or contradicts itself.
    Problem,
    /// Worth knowing; the data is consistent.
    Warning,
}

/// The kind of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The file holds no line.
    EmptyLog,
    /// The last line is cut off in mid-record.
    TornTail,
    /// The last record is whole but its newline is missing.
    NoNewline,
    /// A line that is not a record.
    Damaged,
    /// A session of another log format.
    UnsupportedFormat,
    /// A scan before any session.
    NoSession,
    /// A ping, or an end, of a scan that was not begun or is over.
    OutsideScan,
    /// A scan's identifier begun twice.
    ScanTwice,
    /// The plan can't be carried out.
    BadPlan,
    /// A beam with two readings.
    DuplicateBeam,
    /// A beam that the plan does not have.
    NoSuchBeam,
    /// `scan_end` counts otherwise than the lines do.
    WrongCount,
    /// A scan without `scan_end`.
    NotEnded,
    /// Status, range, prediction and residual of a reading contradict each other.
    Contradiction,
    /// A reading's azimuth is not the plan's, or not its ranger's.
    WrongAzimuth,
    /// A reading of a ranger that the session's array does not have.
    UnknownRanger,
    /// A record older than the one before it.
    TimeBackwards,
}

/// A finding in a log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Number of the line, from 1 (for what is missing at the end: of the last line).
    pub line: u64,
    /// How bad it is.
    pub severity: Severity,
    /// What kind of thing.
    pub kind: FindingKind,
    /// In words.
    pub detail: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let warning = if self.severity == Severity::Warning { "warning: " } else { "" };
        write!(f, "line {}: {warning}{}", self.line, self.detail)
    }
}

/// Numbers of records in a log.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Totals {
    /// Lines, damaged ones included.
    pub lines: u64,
    /// Sessions.
    pub sessions: u64,
    /// Scans begun.
    pub scans: u64,
    /// Readings.
    pub pings: u64,
    /// Events.
    pub events: u64,
    /// Findings that make the log not clean.
    pub problems: u64,
    /// Findings that do not.
    pub warnings: u64,
}

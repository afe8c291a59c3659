//! Findings of a log check.

use std::fmt;

use serde::Serialize;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Damaged, missing or contradictory data.
    Problem,
    /// Remark on consistent data.
    Warning,
}

/// Kind of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// Log without any line.
    EmptyLog,
    /// Last line that ends within a record.
    TornTail,
    /// Complete last record without newline.
    NoNewline,
    /// Line that is not a record.
    Damaged,
    /// Session of another log format.
    UnsupportedFormat,
    /// Scan before the first session.
    NoSession,
    /// Ping or end of a scan that has not started or has ended.
    OutsideScan,
    /// Second start with the same scan identifier.
    ScanTwice,
    /// Invalid scan plan.
    BadPlan,
    /// Beam with two readings.
    DuplicateBeam,
    /// Beam index beyond the plan.
    NoSuchBeam,
    /// Counts in `scan_end` that differ from the log.
    WrongCount,
    /// Scan without `scan_end`.
    NotEnded,
    /// Contradiction between status, range, prediction and residual of a reading.
    Contradiction,
    /// Azimuth that differs from the plan or from the ranger's mounting.
    WrongAzimuth,
    /// Reading of a ranger that is not in the session's array.
    UnknownRanger,
    /// Record that is older than its predecessor.
    TimeBackwards,
}

/// Finding in a log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LogFinding {
    /// Line number, from 1; for findings at the end of the log, the last line.
    pub line: u64,
    /// Severity of the finding.
    pub severity: Severity,
    /// Kind of the finding.
    pub kind: FindingKind,
    /// Description with the values found.
    pub detail: String,
}

impl fmt::Display for LogFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let warning = if self.severity == Severity::Warning { "warning: " } else { "" };
        write!(f, "line {}: {warning}{}", self.line, self.detail)
    }
}

/// Numbers of records in a log.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct LogTotals {
    /// Lines, damaged ones included.
    pub lines: u64,
    /// Number of sessions.
    pub sessions: u64,
    /// Number of started scans.
    pub scans: u64,
    /// Number of readings.
    pub pings: u64,
    /// Number of events.
    pub events: u64,
    /// Findings of severity [`Problem`](Severity::Problem).
    pub problems: u64,
    /// Findings of severity [`Warning`](Severity::Warning).
    pub warnings: u64,
}

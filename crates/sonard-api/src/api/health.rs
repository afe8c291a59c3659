//! Whether all is well.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_interpret::compare::Explanation;
use uuid::Uuid;

/// Health of the daemon, with the underlying figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Health {
    /// Whether the device can be used, the log written, and the temperature is valid and fresh.
    pub healthy: bool,
    /// Why not.
    pub reasons: Vec<String>,
    /// The serial line, since the start.
    pub line: LineTotals,
    /// Scans since the start.
    pub scans: ScanTotals,
    /// The device's clock in the last scan.
    pub clock: ClockReport,
    /// How the last scan that ended agrees with the model.
    pub fit: Option<ScanFit>,
    /// Time since that scan ended, seconds, by a clock that is never set.
    #[serde(default)]
    pub last_scan_age_s: Option<f64>,
    /// How long after its firing the last reading came in, seconds, if it is known when that was.
    pub reading_lateness_s: Option<f64>,
    /// Messages dropped because standard error was blocked or gone.
    #[serde(default)]
    pub dropped_messages: u64,
}

/// Agreement of a scan with the model's prediction, by its last reading of each beam.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanFit {
    /// The scan.
    pub scan: Uuid,
    /// When it ended.
    pub ended: Timestamp,
    /// Beams with an echo on both sides.
    pub both_echo: u32,
    /// Share of them whose ranges agree.
    pub agree_fraction: Option<f64>,
    /// Median distance between their ranges, metres.
    pub median_abs_residual_m: Option<f64>,
    /// Median of measured minus predicted range, metres.
    pub median_residual_m: Option<f64>,
    /// Beams that the scan lacked at its end.
    pub missing: u32,
    /// What would explain its readings better than what is believed, most gain first; told some milliseconds after
    /// the scan's end, and of scans of at most 4,096 readings.
    #[serde(default)]
    pub explanations: Vec<Explanation>,
}

/// Figures of the serial line since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LineTotals {
    /// Bytes sent.
    pub bytes_sent: u64,
    /// Bytes received.
    pub bytes_received: u64,
    /// Frames received whose checksum was right.
    pub frames_received: u64,
    /// Frames whose checksum was wrong.
    pub crc_errors: u64,
    /// Frames that were damaged otherwise.
    pub framing_errors: u64,
    /// Requests sent again.
    pub retries: u64,
    /// Readings that were lost at first and fetched again.
    pub repaired: u64,
    /// Readings and answers that made no sense.
    pub refused: u64,
    /// Times that the device was lost from use.
    pub losses: u64,
}

/// Figures of the scans since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ScanTotals {
    /// Every beam was measured.
    pub completed: u64,
    /// Stopped on request.
    pub stopped: u64,
    /// Given up.
    pub failed: u64,
    /// Beams measured.
    pub beams: u64,
    /// Beams that scans lacked at their end.
    pub missing: u64,
    /// Restarts of the device that scans survived.
    pub restarts: u64,
}

/// The device's clock.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClockReport {
    /// Deviation from its nominal rate, parts in a million.
    pub drift_ppm: Option<f64>,
    /// Standard deviation of the times in records, microseconds.
    pub sigma_us: Option<f64>,
    /// Times that the computer's wall clock was set.
    pub steps: u64,
}

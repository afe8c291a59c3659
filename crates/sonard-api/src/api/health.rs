//! Health of the daemon.

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_interpret::compare::Explanation;
use uuid::Uuid;

/// Health of the daemon, with the underlying figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Health {
    /// `true` if the device is usable, the log can be written and the temperature is valid and
    /// fresh.
    pub healthy: bool,
    /// Reasons why the daemon is unhealthy.
    pub reasons: Vec<String>,
    /// Counters of the serial line since the start.
    pub line: LineTotals,
    /// Counters of scans since the start.
    pub scans: ScanTotals,
    /// Device clock during the last scan.
    pub clock: ClockReport,
    /// Agreement of the last completed scan with the model.
    pub fit: Option<ScanFit>,
    /// Time since the end of that scan, seconds, by a monotonic clock.
    #[serde(default)]
    pub last_scan_age_s: Option<f64>,
    /// Delay from firing to arrival of the last reading, seconds, if the firing time is known.
    pub reading_lateness_s: Option<f64>,
    /// Messages dropped because standard error was blocked or gone.
    #[serde(default)]
    pub dropped_messages: u64,
}

/// Agreement of a scan with the prediction, by the last reading of each beam.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanFit {
    /// Id of the scan.
    pub scan: Uuid,
    /// End of the scan.
    pub ended: Timestamp,
    /// Number of beams with both a measured and a predicted echo.
    pub both_echo: u32,
    /// Fraction of `both_echo` whose ranges agree.
    pub agree_fraction: Option<f64>,
    /// Median of |measured − predicted range|, metres.
    pub median_abs_residual_m: Option<f64>,
    /// Median of measured minus predicted range, metres.
    pub median_residual_m: Option<f64>,
    /// Number of beams without a reading at the end of the scan.
    pub missing: u32,
    /// Hypotheses that fit the readings better than the configured setup, largest gain first. They
    /// are added some milliseconds after the end of the scan, for scans of at most 4,096 readings.
    #[serde(default)]
    pub explanations: Vec<Explanation>,
}

/// Counters of the serial line since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LineTotals {
    /// Bytes sent.
    pub bytes_sent: u64,
    /// Bytes received.
    pub bytes_received: u64,
    /// Frames received with a correct checksum.
    pub frames_received: u64,
    /// Frames received with a wrong checksum.
    pub crc_errors: u64,
    /// Frames with other damage.
    pub framing_errors: u64,
    /// Retransmitted requests.
    pub retries: u64,
    /// Lost readings that were fetched again.
    pub repaired: u64,
    /// Readings and responses rejected as invalid.
    pub rejected: u64,
    /// Number of times that the connection to a device in use was lost.
    pub losses: u64,
}

/// Counters of the scans since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ScanTotals {
    /// Scans with all beams measured.
    pub completed: u64,
    /// Scans stopped on request.
    pub stopped: u64,
    /// Scans that failed.
    pub failed: u64,
    /// Number of beams measured.
    pub beams: u64,
    /// Number of beams without a reading at the end of their scan.
    pub missing: u64,
    /// Restarts of the device that scans survived.
    pub restarts: u64,
}

/// Rate and accuracy of the device's clock.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClockReport {
    /// Deviation from the nominal rate, parts per million.
    pub drift_ppm: Option<f64>,
    /// Standard deviation of timestamps in records, microseconds.
    pub sigma_us: Option<f64>,
    /// Number of times that the computer's wall clock was set.
    pub steps: u64,
}

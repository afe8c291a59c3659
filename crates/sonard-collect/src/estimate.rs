//! Estimates of a collection's duration and disk use.

use firmware_protocol::messages::{
    Capabilities, FirmwareVersion, Identity, PROTOCOL, ResetCause, limits::TICK_HZ,
};
use sonard_device::{
    link::BAUD,
    ranger::{ReceiverTiming, ScanDuration},
};

use super::{CollectError, CollectionPlan, error::MOTOR_STEP_HELP};

/// Mean size of a ping record with prediction, and of a scan's other records, bytes. Measured with
/// the mock in the shipped scenes.
const PING_BYTES: f64 = 540.0;
const SCAN_BYTES: f64 = 5_000.0;

/// Estimates the duration of one scan by a device with all capabilities.
///
/// # Errors
/// Returns an error if an azimuth is not a multiple of the motor step or the air is invalid.
pub fn budget(plan: &CollectionPlan) -> Result<ScanDuration, CollectError> {
    let steps_per_revolution = plan.steps_per_revolution;
    let motor = plan
        .azimuths
        .motor_steps(steps_per_revolution.into())
        .map_err(|error| CollectError::invalid(error, MOTOR_STEP_HELP))?;
    let air = plan.air(plan.keys.air.temperature_c)?;
    let listening = ReceiverTiming {
        max_range_m: plan.keys.sensor.options.max_range_m.unwrap_or(plan.sensor.max_range_m),
        sound_speed_m_s: air.sound_speed_m_s(),
        blanking_us: plan.sensor.blanking_us,
    };
    let settings = plan.motion().settings(&listening, &assumed_device(steps_per_revolution));
    Ok(ScanDuration::for_plan(&plan.azimuths, &settings, motor, BAUD))
}

/// Estimates the disk space of `scans` scans, bytes.
#[must_use]
pub fn disk_bytes(plan: &CollectionPlan, scans: u32) -> f64 {
    f64::from(scans) * (SCAN_BYTES + PING_BYTES * f64::from(plan.azimuths.beams()))
}

/// Estimate of the remaining time, corrected by the measured duration of this run's scans.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// Accumulated estimated and measured duration of this run's scans, seconds.
    estimated_s: f64,
    measured_s: f64,
    /// Estimated duration of one scan, and the pause after it, seconds.
    scan_s: f64,
    pause_s: f64,
}

impl Pace {
    pub(super) const fn new(scan_s: f64, pause_s: f64) -> Self {
        Self { estimated_s: 0.0, measured_s: 0.0, scan_s, pause_s }
    }

    /// Adds the measured duration of a scan, seconds.
    pub(super) fn record_scan(&mut self, wall_s: f64) {
        self.estimated_s += self.scan_s;
        self.measured_s += wall_s;
    }

    /// Estimates the duration of `scans` further scans, seconds.
    pub(super) fn left_s(&self, scans: u32) -> f64 {
        let ratio = if self.estimated_s > 0.0 { self.measured_s / self.estimated_s } else { 1.0 };
        f64::from(scans) * (self.scan_s * ratio + self.pause_s)
    }

    /// Returns the estimated and the measured duration of this run's scans, seconds.
    pub(super) const fn times_s(&self) -> (f64, f64) {
        (self.estimated_s, self.measured_s)
    }
}

/// Identity of a device with all capabilities that a plan can use.
fn assumed_device(steps_per_revolution: u16) -> Identity {
    Identity {
        protocol: PROTOCOL,
        firmware: FirmwareVersion { major: 0, minor: 0, patch: 0 },
        serial: [0; 10],
        boot: 1,
        last_seq: None,
        tick_hz: TICK_HZ,
        steps_per_revolution,
        capabilities: Capabilities::INDEX_SENSOR
            .with(Capabilities::SHORT_BLANKING)
            .with(Capabilities::MULTIPLE_ECHOES),
        ring_bytes: 0,
        reset_cause: ResetCause::PowerOn,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_with_measured_durations() {
        let mut pace = Pace::new(10.0, 2.0);
        assert!((pace.left_s(5) - 60.0).abs() < 1e-9);
        pace.record_scan(12.0);
        pace.record_scan(14.0);
        assert!((pace.left_s(5) - 5.0 * (13.0 + 2.0)).abs() < 1e-9);
    }
}

//! How long a collection takes.

use firmware_protocol::messages::{
    Capabilities, FirmwareVersion, Identity, PROTOCOL, ResetCause, limits::TICK_HZ,
};
use sonard_device::{
    link::BAUD,
    ranger::{Budget, Listening},
};

use super::{Halt, Plan};

/// A reading's record with its prediction, and what a scan has besides, bytes: means of scans on the
/// mock in the shipped scenes.
const PING_BYTES: f64 = 540.0;
const SCAN_BYTES: f64 = 5_000.0;

/// The time of one scan with the plan's settings, by a device with every capability.
///
/// # Errors
/// When the plan is not on the motor's steps, or its air is none.
pub fn budget(plan: &Plan) -> Result<Budget, Halt> {
    let steps_per_revolution = plan.steps_per_revolution;
    let motor = plan.azimuths.motor_steps(steps_per_revolution.into()).map_err(|error| {
        Halt::wrong(error, "give plan.from_deg and plan.step_deg on the motor's steps")
    })?;
    let air = plan.air(plan.keys.air.temperature_c)?;
    let listening = Listening {
        max_range_m: plan.keys.sensor.options.max_range_m.unwrap_or(plan.sensor.max_range_m),
        sound_speed_m_s: air.sound_speed_m_s(),
        blanking_us: plan.sensor.blanking_us,
    };
    let settings = plan.motion().settings(&listening, &assumed(steps_per_revolution));
    Ok(Budget::of(&plan.azimuths, &settings, motor, BAUD))
}

/// Disk that so many scans take, bytes.
#[must_use]
pub fn disk_bytes(plan: &Plan, scans: u32) -> f64 {
    f64::from(scans) * (SCAN_BYTES + PING_BYTES * f64::from(plan.azimuths.beams()))
}

/// The pace of a run: the estimate, corrected by what was measured.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// Estimated and measured time of the scans of this run, seconds.
    estimated_s: f64,
    measured_s: f64,
    /// Estimate for one scan, and the pause after it, seconds.
    scan_s: f64,
    pause_s: f64,
}

impl Pace {
    pub(super) const fn new(scan_s: f64, pause_s: f64) -> Self {
        Self { estimated_s: 0.0, measured_s: 0.0, scan_s, pause_s }
    }

    /// A scan took so long.
    pub(super) fn learn(&mut self, wall_s: f64) {
        self.estimated_s += self.scan_s;
        self.measured_s += wall_s;
    }

    /// Time that so many scans more take, seconds.
    pub(super) fn left_s(&self, scans: u32) -> f64 {
        let pace = if self.estimated_s > 0.0 { self.measured_s / self.estimated_s } else { 1.0 };
        f64::from(scans) * (self.scan_s * pace + self.pause_s)
    }

    /// Estimated and measured time of the scans of this run, seconds.
    pub(super) const fn times_s(&self) -> (f64, f64) {
        (self.estimated_s, self.measured_s)
    }
}

/// A device that can do everything a plan may ask for.
fn assumed(steps_per_revolution: u16) -> Identity {
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
    fn the_time_left_follows_what_was_measured() {
        let mut pace = Pace::new(10.0, 2.0);
        assert!((pace.left_s(5) - 60.0).abs() < 1e-9);
        pace.learn(12.0);
        pace.learn(14.0);
        assert!((pace.left_s(5) - 5.0 * (13.0 + 2.0)).abs() < 1e-9);
    }
}

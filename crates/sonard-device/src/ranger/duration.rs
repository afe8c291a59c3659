//! Estimated duration of a scan, split into acoustics, motor and serial link.

use firmware_protocol::{
    frame::{Frame, Header},
    messages::{
        Alive, Echoes, Identity, Reading, ReadingStatus, Reply, Request, Settings, Status, Sweep,
        Wire, limits::TICK_HZ,
    },
};
use serde::Serialize;
use sonard_model::motion::Trapezoid;
use sonard_records::ScanPlan;

use super::timing;

/// Bits on the line for each byte: 8N1.
const BITS_PER_BYTE: f64 = 10.0;

/// Estimated duration of a scan by cause, in seconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ScanDuration {
    /// Listening windows, and waits that protect the module from firing too often.
    pub acoustics_s: f64,
    /// Steps between stops with the settling time after each, and the travel from and to home.
    pub motor_s: f64,
    /// Transmission time that does not overlap with a measurement.
    pub link_s: f64,
}

impl ScanDuration {
    /// Estimates the duration of [`super::Ranger::scan`] from its first command to the return
    /// home. The motor is at home initially; the line runs at `baud` bits per second.
    ///
    /// `motor`: first step and stride of the plan. Each reading is transmitted while the next beam
    /// is measured; only the transmission time in excess of the beam counts.
    #[must_use]
    pub fn for_plan(plan: &ScanPlan, settings: &Settings, motor: (i32, i32), baud: u32) -> Self {
        let (from, stride) = motor;
        let seconds = |ticks: u32| f64::from(ticks) / f64::from(TICK_HZ);
        let travel_s =
            |steps| Trapezoid::new(steps, settings.speed, settings.acceleration).duration_s();
        let settle_s = seconds(settings.settle_ticks);
        let stops = plan.stops();
        let between_s = f64::from(stops.saturating_sub(1)) * (travel_s(stride) + settle_s);
        let last = from + stride * i32::try_from(stops.saturating_sub(1)).unwrap_or(0);
        let swept_s = timing::min_duration_s(plan, settings, stride);
        let byte_s = BITS_PER_BYTE / f64::from(baud);
        let reading_s = reading_bytes(settings.max_echoes) * byte_s;
        let beams = f64::from(plan.beams());
        let beam_s = if beams > 0.0 { swept_s / beams } else { 0.0 };
        Self {
            acoustics_s: (swept_s - between_s).max(0.0),
            motor_s: between_s.min(swept_s) + travel_s(from) + settle_s + travel_s(last),
            link_s: exchange_bytes(settings) * byte_s
                + (reading_s - beam_s).max(0.0) * beams
                + reading_s,
        }
    }

    /// Sum of the three parts, seconds.
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.acoustics_s + self.motor_s + self.link_s
    }

    /// Duration of a number of identical scans.
    #[must_use]
    pub fn times(&self, scans: f64) -> Self {
        Self {
            acoustics_s: scans * self.acoustics_s,
            motor_s: scans * self.motor_s,
            link_s: scans * self.link_s,
        }
    }

    /// Returns the sum of two durations, part by part.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            acoustics_s: self.acoustics_s + other.acoustics_s,
            motor_s: self.motor_s + other.motor_s,
            link_s: self.link_s + other.link_s,
        }
    }
}

/// Frame length of a reading with `echoes` echoes, bytes, with numbers as large as late in a scan.
fn reading_bytes(echoes: u8) -> f64 {
    let large = [60_000, 80_000, 100_000, 110_000, 115_000, 120_000, 124_000, 126_000];
    let echoes = Echoes::from_ticks(large.get(..usize::from(echoes)).unwrap_or(&large));
    bytes(&Reply::Reading(Reading {
        sweep: 300,
        index: 300,
        step: 300,
        fired_ticks: u32::MAX / 2,
        status: ReadingStatus::Echo,
        echoes,
    }))
}

/// Bytes of the commands around a sweep and of their replies, during which nothing is measured:
/// Identify, Stop, Configure, Home, four times Status for the clock's fit, Sweep, Home.
fn exchange_bytes(settings: &Settings) -> f64 {
    let sweep = Sweep {
        sweep: 300,
        first_step: 0,
        stride: 1,
        stops: 400,
        pings_per_stop: 1,
        lease_ms: 2_000,
    };
    let home =
        bytes(&Request::Home) + bytes(&Reply::Started) + bytes(&Reply::Homed { drift_steps: 0 });
    let status = bytes(&Request::Status) + bytes(&Reply::StatusReport(Status::BLANK));
    bytes(&Request::Identify)
        + bytes(&Reply::Identity(Identity::BLANK))
        + bytes(&Request::Stop)
        + bytes(&Request::Configure(*settings))
        + bytes(&Request::Sweep(sweep))
        + 3.0 * bytes(&Reply::Ack)
        + 2.0 * home
        + 4.0 * status
        // The report of the sweep's end.
        + bytes(&Reply::Alive(Alive::BLANK))
}

fn bytes<M: Wire>(message: &M) -> f64 {
    let header = Header { boot: 0x1234, seq: 0x1234 };
    Frame::encode(header, message).map_or(66.0, |frame| frame.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_protocol::messages::Blanking;

    fn settings() -> Settings {
        Settings {
            window_ticks: 46_513,
            min_interval_ticks: 40_000,
            settle_ticks: 10_000,
            max_echoes: 3,
            blanking: Blanking::Internal,
            speed: 800,
            acceleration: 40_000,
            hold_s: 0,
        }
    }

    #[test]
    fn duration_has_three_parts() {
        let plan = ScanPlan::default();
        let budget = ScanDuration::for_plan(&plan, &settings(), (0, 1), 115_200);
        assert!((budget.acoustics_s - 400.0 * 46_513.0 / 2e6).abs() < 1e-9, "{budget:?}");
        // 399 steps of 10 ms, 400 settling times of 5 ms, and 399 steps home at 800 steps/s.
        let home_s = 399.0 / 800.0 + 800.0 / 40_000.0;
        assert!((budget.motor_s - (3.99 + 2.0 + home_s)).abs() < 1e-9, "{budget:?}");
        // Some 300 bytes at 87 us each.
        assert!((0.015..0.035).contains(&budget.link_s), "{budget:?}");
        let limit_s = timing::min_duration_s(&plan, &settings(), 1);
        assert!((budget.total_s() - budget.link_s - limit_s - home_s - 0.005).abs() < 1e-9);
    }

    #[test]
    fn slow_line_dominates() {
        let plan = ScanPlan::default();
        let fast = ScanDuration::for_plan(&plan, &settings(), (0, 1), 115_200);
        let slow = ScanDuration::for_plan(&plan, &settings(), (0, 1), 4_800);
        assert_eq!(fast.acoustics_s, slow.acoustics_s);
        // Code byte, header, body (1 + 2 + 2 + 2 + 5 + 1, and 1 + 3 for each echo), CRC, delimiter.
        let bytes = f64::from(1 + 4 + (13 + 1 + 3 * 3) + 4 + 1);
        assert_eq!(reading_bytes(3), bytes);
        // A reading takes 69 ms at 4,800 baud and a beam 38 ms: the difference adds up.
        let (reading_s, beam_s) =
            (bytes * 10.0 / 4_800.0, timing::min_duration_s(&plan, &settings(), 1) / 400.0);
        let exchanges_s = exchange_bytes(&settings()) * 10.0 / 4_800.0;
        let expected_s = 400.0 * (reading_s - beam_s) + reading_s + exchanges_s;
        assert!((slow.link_s - expected_s).abs() < 1e-9 && slow.link_s > 10.0, "{slow:?}");
    }

    #[test]
    fn min_interval_counts_as_acoustics() {
        let guarded = Settings { min_interval_ticks: 200_000, ..settings() };
        let budget = ScanDuration::for_plan(&ScanPlan::default(), &guarded, (0, 1), 115_200);
        let limit_s = 399.0 * 0.1 + 46_513.0 / 2e6;
        assert!((budget.acoustics_s + 399.0 * 0.015 - limit_s).abs() < 1e-9, "{budget:?}");
    }
}

//! Physical minimum duration of a scan, and the lease of its sweeps.

use firmware_protocol::messages::{Settings, limits::TICK_HZ};
use sonard_model::motion::Trapezoid;
use sonard_records::ScanPlan;

/// Minimum time from the first firing to the end of the last listening window, seconds: all
/// windows and, between stops, the step and the settling time.
///
/// Windows do not overlap, because the sound of one firing has to decay before the next. Steps and
/// windows do not overlap, because the motor must not move while the receiver is open.
#[must_use]
pub fn min_duration_s(plan: &ScanPlan, settings: &Settings, stride: i32) -> f64 {
    let seconds = |ticks: u32| f64::from(ticks) / f64::from(TICK_HZ);
    let window_s = seconds(settings.window_ticks);
    let interval_s = window_s.max(seconds(settings.min_interval_ticks));
    let step_s = Trapezoid::new(stride, settings.speed, settings.acceleration).duration_s();
    let between_s = interval_s.max(window_s + step_s + seconds(settings.settle_ticks));
    let (stops, pings) = (f64::from(plan.stops()), f64::from(plan.pings_per_stop));
    if stops == 0.0 {
        return 0.0;
    }
    (stops - 1.0) * between_s + stops * (pings - 1.0) * interval_s + window_s
}

/// Lease of a sweep, milliseconds: the time it continues without a message from the host. About
/// ten beams, and at least two seconds, for which a busy computer may be blocked.
#[must_use]
pub(super) fn lease_ms(settings: &Settings) -> u16 {
    let ticks = u64::from(settings.window_ticks) + u64::from(settings.settle_ticks);
    let beam_ms = ticks * 1000 / u64::from(TICK_HZ);
    u16::try_from((10 * beam_ms).clamp(2_000, 30_000)).unwrap_or(u16::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_protocol::messages::Blanking;

    fn settings() -> Settings {
        Settings {
            window_ticks: 40_000,
            min_interval_ticks: 0,
            settle_ticks: 10_000,
            max_echoes: 1,
            blanking: Blanking::Internal,
            speed: 800,
            acceleration: 40_000,
            hold_s: 0,
        }
    }

    #[test]
    fn limit_sums_windows_and_steps() {
        let plan = ScanPlan::default();
        // 400 windows of 20 ms, and 399 times a step of 10 ms and 5 ms of settling.
        let expected = 400.0 * 0.020 + 399.0 * 0.015;
        assert!((min_duration_s(&plan, &settings(), 1) - expected).abs() < 1e-9);
        let twice = ScanPlan { pings_per_stop: 2, ..plan };
        assert!((min_duration_s(&twice, &settings(), 1) - expected - 400.0 * 0.020).abs() < 1e-9);
    }

    #[test]
    fn limit_respects_min_interval() {
        let slow = Settings { min_interval_ticks: 200_000, ..settings() };
        let expected = 399.0 * 0.1 + 0.020;
        assert!((min_duration_s(&ScanPlan::default(), &slow, 1) - expected).abs() < 1e-9);
    }
}

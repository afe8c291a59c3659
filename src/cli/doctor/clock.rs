//! Check of the board's clock from request round trips. Pure.

use super::report::{Cause, Check};

/// Largest acceptable deviation from the nominal rate; a ceramic resonator is good to half a
/// percent.
const MAX_DEVIATION: f64 = 0.01;

/// Readings of both clocks in one request: the device reads its clock between the two times of the
/// host.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Exchange {
    pub(super) sent_us: u64,
    pub(super) received_us: u64,
    pub(super) device_ticks: u32,
}

impl Exchange {
    fn middle_us(&self) -> f64 {
        0.5 * (self.sent_us as f64 + self.received_us as f64)
    }

    fn round_trip_us(&self) -> f64 {
        self.received_us.saturating_sub(self.sent_us) as f64
    }
}

/// Compares a clock of nominally `tick_hz` with this computer's, from requests in order. The
/// quickest request of the first half and that of the second half are used, because a request's
/// uncertainty is half its round trip.
pub(super) fn check_clock(exchanges: &[Exchange], tick_hz: u32) -> Check {
    let (early, late) = exchanges.split_at(exchanges.len() / 2);
    let quickest = |part: &[Exchange]| {
        part.iter().copied().min_by(|a, b| a.round_trip_us().total_cmp(&b.round_trip_us()))
    };
    let (Some(first), Some(last)) = (quickest(early), quickest(late)) else {
        return Check::skipped("clock", "no request succeeded without a retry");
    };
    let host_us = last.middle_us() - first.middle_us();
    // The 32-bit count wraps each 36 minutes; an examination is shorter.
    let ticks = last.device_ticks.wrapping_sub(first.device_ticks);
    let rate = f64::from(ticks) / f64::from(tick_hz) * 1e6 / host_us;
    let uncertainty = 0.5 * (first.round_trip_us() + last.round_trip_us()) / host_us;
    if (rate - 1.0).abs() <= MAX_DEVIATION + uncertainty {
        let uncertain = 100.0 * uncertainty;
        return Check::ok(
            "clock",
            format!("rate error {:+.2} % (+- {uncertain:.2} %)", 100.0 * (rate - 1.0)),
        );
    }
    let detail = match ticks {
        0 => format!("the clock is stopped: no tick in {:.1} s", host_us * 1e-6),
        _ => format!("the clock runs at {rate:.3} of its stated rate"),
    };
    Check::failed(
        "clock",
        Cause::Clock,
        detail,
        "every range has the same relative error: the firmware was built for another crystal (F_CPU), or the \
         timer that counts the ticks does not run",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exchanges each 50 ms for two seconds, 4 ms each, with a clock of this rate.
    fn exchanges(rate: f64, start: u32) -> Vec<Exchange> {
        (0..40_u64)
            .map(|number| Exchange {
                sent_us: 50_000 * number,
                received_us: 50_000 * number + 4_000,
                device_ticks: start
                    .wrapping_add((2.0 * rate * (50_000 * number + 1_000) as f64) as u32),
            })
            .collect()
    }

    #[test]
    fn rate_is_checked() {
        for (rate, cause) in [
            (1.0, None),
            (0.996, None),
            (1.005, None),
            (0.0, Some(Cause::Clock)),
            (0.5, Some(Cause::Clock)),
            (0.97, Some(Cause::Clock)),
            (2.0, Some(Cause::Clock)),
        ] {
            for start in [0, 5, u32::MAX - 100_000] {
                assert_eq!(check_clock(&exchanges(rate, start), 2_000_000).cause, cause, "{rate}");
            }
        }
        assert!(check_clock(&exchanges(0.0, 7), 2_000_000).detail.contains("is stopped"));
        assert!(check_clock(&exchanges(2.0, 7), 2_000_000).detail.contains("2.000"));
    }

    #[test]
    fn slow_requests() {
        let slow: Vec<Exchange> = exchanges(1.0, 0)
            .into_iter()
            .map(|exchange| Exchange { received_us: exchange.sent_us + 300_000, ..exchange })
            .collect();
        assert_eq!(check_clock(&slow, 2_000_000).cause, None);
        assert_eq!(check_clock(&[], 2_000_000).status, crate::cli::doctor::report::Status::Skipped);
    }
}

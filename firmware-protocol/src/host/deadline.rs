//! Durations of transmissions and of the device's work. Integers only; times in us.

use super::HostConfig;
use crate::frame::FRAME_MAX;
use crate::messages::{Settings, limits};

const US_PER_S: u64 = 1_000_000;
const TICKS_PER_US: u64 = limits::TICK_HZ as u64 / US_PER_S;
/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// Transmission time of `bytes` bytes at `baud` bit/s, us, rounded up.
pub(super) fn wire_us(bytes: usize, baud: u32) -> u64 {
    (bytes as u64 * BITS_PER_BYTE * US_PER_S).div_ceil(u64::from(baud.max(1)))
}

/// Transmission time of the longest frame, us.
pub(super) fn longest_frame_us(baud: u32) -> u64 {
    wire_us(FRAME_MAX, baud)
}

/// Converts device ticks to us, rounded up.
pub(super) fn ticks_us(ticks: u32) -> u64 {
    u64::from(ticks).div_ceil(TICKS_PER_US)
}

/// Time of a move by `steps` from rest to rest with a trapezoidal speed profile, us:
/// `2 sqrt(d / a)` if the speed `v` is not reached, else `d / v + v / a`.
pub(super) fn slew_us(steps: u32, settings: &Settings) -> u64 {
    let distance = u64::from(steps);
    let speed = u64::from(settings.speed.max(1));
    let acceleration = u64::from(settings.acceleration.max(1));
    if distance * acceleration <= speed * speed {
        2 * (distance * US_PER_S * US_PER_S / acceleration).isqrt() + 2
    } else {
        (distance * US_PER_S).div_ceil(speed) + (speed * US_PER_S).div_ceil(acceleration)
    }
}

/// Time of a beam, us: the longer of settling time and minimum interval, plus the window.
pub(super) fn beam_us(settings: &Settings) -> u64 {
    let apart = settings.settle_ticks.max(settings.min_interval_ticks);
    ticks_us(apart) + ticks_us(settings.window_ticks)
}

/// Estimator of the reply time beyond bytes and work, as in RFC 6298.
#[derive(Debug, Clone)]
pub(super) struct Margin {
    /// Smoothed mean and deviation, us; `None` before the first sample.
    estimate: Option<(u64, u64)>,
    initial_us: u64,
    min_us: u64,
    max_us: u64,
}

impl Margin {
    pub(super) fn new(config: &HostConfig) -> Self {
        let min_us = u64::from(config.min_margin_us);
        Self {
            estimate: None,
            initial_us: u64::from(config.initial_margin_us),
            min_us,
            max_us: u64::from(config.max_margin_us).max(min_us),
        }
    }

    /// Adds a sample. Samples of repeated requests must be excluded.
    pub(super) fn sample(&mut self, us: u64) {
        self.estimate = Some(match self.estimate {
            None => (us, us / 2),
            Some((mean, deviation)) => {
                ((7 * mean + us) / 8, (3 * deviation + mean.abs_diff(us)) / 4)
            }
        });
    }

    /// Margin for attempt `attempt` (1 for the first), us: doubled with each further attempt.
    pub(super) fn us(&self, attempt: u8) -> u64 {
        let base = match self.estimate {
            None => self.initial_us,
            Some((mean, deviation)) => mean + (4 * deviation).max(self.min_us),
        };
        let doublings = u32::from(attempt.saturating_sub(1)).min(16);
        base.clamp(self.min_us, self.max_us).saturating_mul(1 << doublings).min(self.max_us)
    }
}

#[cfg(test)]
mod tests {
    use super::{HostConfig, Margin, slew_us, wire_us};
    use crate::messages::{Blanking, Settings};

    fn settings(speed: u16, acceleration: u32) -> Settings {
        Settings {
            window_ticks: 48_000,
            min_interval_ticks: 0,
            settle_ticks: 0,
            max_echoes: 1,
            blanking: Blanking::Internal,
            speed,
            acceleration,
            hold_s: 0,
        }
    }

    #[test]
    fn byte_takes_ten_bits() {
        assert_eq!(wire_us(1, 1_000_000), 10);
        assert_eq!(wire_us(66, 115_200), 5_730);
    }

    #[test]
    fn slew_is_trapezoidal() {
        // 100 steps at 1000 steps/s^2 never reach 1000 steps/s: 2 sqrt(0.1) s.
        assert_eq!(slew_us(100, &settings(1_000, 1_000)), 632_456);
        // 3000 steps do: 3 s at speed, and 1 s more for both ramps.
        assert_eq!(slew_us(3_000, &settings(1_000, 1_000)), 4_000_000);
        // Both forms agree where the speed is just reached.
        assert!(slew_us(1_000, &settings(1_000, 1_000)).abs_diff(2_000_000) <= 2);
        assert!(slew_us(u32::MAX, &settings(1, 200_000)) > 4_000_000_000_000_000);
    }

    #[test]
    fn margin_follows_rfc_6298() {
        let config = HostConfig::new(115_200, 1);
        let mut margin = Margin::new(&config);
        assert_eq!(margin.us(1), 200_000);
        assert_eq!(margin.us(2), 400_000);
        assert_eq!(margin.us(200), 2_000_000);
        margin.sample(16_000);
        // RFC 6298: mean R, deviation R/2, so R + 4 R/2.
        assert_eq!(margin.us(1), 48_000);
        for _ in 0..100 {
            margin.sample(16_000);
        }
        assert!(margin.us(1).abs_diff(36_000) < 100, "{}", margin.us(1));
    }
}

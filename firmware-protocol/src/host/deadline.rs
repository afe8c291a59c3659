//! How long things may take. Integers only; times in us.

use super::HostConfig;
use crate::frame::FRAME_MAX;
use crate::messages::{Settings, limits};

const US_PER_S: u64 = 1_000_000;
const TICKS_PER_US: u64 = limits::TICK_HZ as u64 / US_PER_S;
/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;

/// Time that `bytes` bytes take at `baud` bit/s, rounded up.
pub(super) fn wire_us(bytes: usize, baud: u32) -> u64 {
    (bytes as u64 * BITS_PER_BYTE * US_PER_S).div_ceil(u64::from(baud.max(1)))
}

/// Time of the longest frame.
pub(super) fn longest_frame_us(baud: u32) -> u64 {
    wire_us(FRAME_MAX, baud)
}

/// Device ticks in us, rounded up.
pub(super) fn ticks_us(ticks: u32) -> u64 {
    u64::from(ticks).div_ceil(TICKS_PER_US)
}

/// Time to turn by `steps` with a trapezoid of speeds from rest to rest: `2 sqrt(d / a)` if the
/// speed `v` is not reached, else `d / v + v / a`.
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

/// Time of one beam: rest, the interval since the firing before, the listening window.
pub(super) fn beam_us(settings: &Settings) -> u64 {
    let apart = settings.settle_ticks.max(settings.min_interval_ticks);
    ticks_us(apart) + ticks_us(settings.window_ticks)
}

/// What replies take beyond the time of bytes and work, estimated as in RFC 6298.
#[derive(Debug, Clone)]
pub(super) struct Margin {
    /// Smoothed mean and deviation, us, once there was a sample.
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

    /// Takes in a sample. Those of requests that were sent more than once must be left out.
    pub(super) fn sample(&mut self, us: u64) {
        self.estimate = Some(match self.estimate {
            None => (us, us / 2),
            Some((mean, deviation)) => {
                ((7 * mean + us) / 8, (3 * deviation + mean.abs_diff(us)) / 4)
            }
        });
    }

    /// The margin for attempt `attempt` (1 for the first): doubled with each further one.
    pub(super) fn us(&self, attempt: u8) -> u64 {
        let base = match self.estimate {
            None => self.initial_us,
            Some((mean, deviation)) => mean + (4 * deviation).max(self.min_us),
        };
        let doublings = u32::from(attempt.saturating_sub(1)).min(16);
        base.clamp(self.min_us, self.max_us)
            .saturating_mul(1 << doublings)
            .min(self.max_us)
    }
}

//! The device's clock seen from the host: 32-bit ticks extended, offset and drift fitted.
//!
//! Pure: times of the host are given in microseconds since any fixed moment.

use std::collections::VecDeque;

/// Number of latest exchanges in the fit.
const SAMPLES: usize = 64;
/// Minimum span for fitting a drift; over a shorter span the nominal rate is used.
const MIN_SPAN_US: f64 = 5e6;
/// Maximum plausible drift: a board's ceramic resonator is accurate to half a percent.
const MAX_DRIFT: f64 = 0.006;

/// Extends wrapping 32-bit ticks to 64 bits by choosing the nearest candidate.
#[derive(Debug, Clone, Copy, Default)]
pub struct TickExtender {
    last: Option<u64>,
}

impl TickExtender {
    /// Returns the extended count. Values may arrive out of order by up to half a wrap (18
    /// minutes).
    pub fn extend(&mut self, ticks: u32) -> u64 {
        let Some(last) = self.last else {
            let first = u64::from(ticks);
            self.last = Some(first);
            return first;
        };
        let ahead = ticks.wrapping_sub(last as u32).cast_signed();
        let extended = last.saturating_add_signed(i64::from(ahead));
        self.last = Some(last.max(extended));
        extended
    }
}

/// Exchange of a request and a reply: the device read its clock between the two host times.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    middle_us: f64,
    round_trip_us: f64,
    ticks: u64,
}

/// Linear fit of host time over device ticks, from the exchanges with a short round trip.
#[derive(Debug, Clone)]
pub struct ClockFit {
    tick_us: f64,
    samples: VecDeque<Sample>,
}

/// A host time with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HostTime {
    /// Microseconds on the host's time line.
    pub us: f64,
    /// Standard deviation, microseconds.
    pub sigma_us: f64,
}

impl ClockFit {
    /// Creates a fit for a device clock of `tick_hz` ticks per second.
    #[must_use]
    pub fn new(tick_hz: u32) -> Self {
        Self { tick_us: 1e6 / f64::from(tick_hz.max(1)), samples: VecDeque::new() }
    }

    /// Adds an exchange. Retried exchanges must be omitted: the copy that was answered is unknown.
    pub fn push(&mut self, sent_us: u64, received_us: u64, ticks: u64) {
        if self.samples.len() == SAMPLES {
            self.samples.pop_front();
        }
        let round_trip_us = received_us.saturating_sub(sent_us) as f64;
        let middle_us = sent_us as f64 + round_trip_us / 2.0;
        self.samples.push_back(Sample { middle_us, round_trip_us, ticks });
    }

    /// Host time at which the device's clock read `ticks`; `None` before the first exchange.
    #[must_use]
    pub fn host_time(&self, ticks: u64) -> Option<HostTime> {
        let quick = self.quick_samples();
        let line = LinearFit::through(&quick, self.tick_us)?;
        Some(HostTime { us: line.at(ticks), sigma_us: line.sigma_us })
    }

    /// Relative deviation of the device's clock from its nominal rate; `None` until known.
    #[must_use]
    pub fn drift(&self) -> Option<f64> {
        let line = LinearFit::through(&self.quick_samples(), self.tick_us)?;
        line.fitted.then(|| line.tick_us / self.tick_us - 1.0)
    }

    /// Exchanges with a round trip close to the shortest: a delay in one direction biases the
    /// middle.
    fn quick_samples(&self) -> Vec<Sample> {
        let best = self.samples.iter().map(|s| s.round_trip_us).fold(f64::INFINITY, f64::min);
        self.samples.iter().filter(|s| s.round_trip_us <= 1.5 * best + 200.0).copied().collect()
    }
}

struct LinearFit {
    origin: Sample,
    offset_us: f64,
    tick_us: f64,
    sigma_us: f64,
    fitted: bool,
}

impl LinearFit {
    /// Least-squares fit; falls back to the nominal rate if the span is short or the slope
    /// implausible.
    fn through(samples: &[Sample], nominal_tick_us: f64) -> Option<Self> {
        let origin = *samples.first()?;
        let points: Vec<(f64, f64)> = samples
            .iter()
            .map(|s| {
                let ticks = s.ticks as i64 - origin.ticks as i64;
                (ticks as f64 * nominal_tick_us, s.middle_us - origin.middle_us)
            })
            .collect();
        let n = points.len() as f64;
        let mean_x = points.iter().map(|p| p.0).sum::<f64>() / n;
        let mean_y = points.iter().map(|p| p.1).sum::<f64>() / n;
        let sxx: f64 = points.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
        let sxy: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
        let span = points.iter().map(|p| p.0).fold(0.0_f64, |a, x| a.max(x.abs()));
        let slope = if sxx > 0.0 { sxy / sxx } else { 1.0 };
        let fitted = span >= MIN_SPAN_US && points.len() >= 4 && (slope - 1.0).abs() <= MAX_DRIFT;
        let slope = if fitted { slope } else { 1.0 };
        let offset_us = mean_y - slope * mean_x;
        let square: f64 = points.iter().map(|p| (p.1 - offset_us - slope * p.0).powi(2)).sum();
        // The instant of the device's clock reading is uniformly distributed over the round trip.
        let inside = samples.iter().map(|s| s.round_trip_us).sum::<f64>() / n / 12_f64.sqrt();
        Some(Self {
            origin,
            offset_us,
            tick_us: slope * nominal_tick_us,
            sigma_us: (square / n + inside * inside).sqrt(),
            fitted,
        })
    }

    fn at(&self, ticks: u64) -> f64 {
        let since = ticks as i64 - self.origin.ticks as i64;
        self.origin.middle_us + self.offset_us + since as f64 * self.tick_us
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_extend_over_wraps() {
        let mut extender = TickExtender::default();
        let first = extender.extend(u32::MAX - 10);
        assert_eq!(extender.extend(5), first + 16);
        assert_eq!(extender.extend(u32::MAX - 3), first + 7, "a repaired reading comes late");
        assert_eq!(extender.extend(100), first + 111);
        let mut total = first + 111;
        for turn in 1..20_u32 {
            total += 1 << 30;
            assert_eq!(extender.extend(100_u32.wrapping_add(turn << 30)), total);
        }
    }

    #[test]
    fn fit_follows_drift() {
        let mut fit = ClockFit::new(2_000_000);
        // 300 ppm slow: a tick takes 0.50015 us of host time.
        let host_us = |ticks: u64| 7e6 + ticks as f64 * 0.500_15;
        for second in 0..40_u64 {
            let ticks = second * 2_000_000;
            let slow = if second % 7 == 3 { 30_000 } else { 0 };
            let true_us = host_us(ticks) as u64;
            fit.push(true_us - 400, true_us + 400 + slow, ticks);
        }
        let at = fit.host_time(50_000_000).expect("samples");
        assert!((at.us - host_us(50_000_000)).abs() < 30.0, "{at:?}");
        assert!((200.0..400.0).contains(&at.sigma_us), "{at:?}");
        let drift = fit.drift().expect("40 s");
        assert!((drift - 3e-4).abs() < 1e-5, "{drift}");
    }

    #[test]
    fn one_exchange_gives_nominal_rate() {
        let mut fit = ClockFit::new(2_000_000);
        assert_eq!(fit.host_time(0), None);
        fit.push(1_000, 2_000, 500);
        let at = fit.host_time(2_000_500).expect("a sample");
        assert_eq!(at.us, 1_001_500.0);
        assert!(fit.drift().is_none());
    }
}

//! Plausibility of firing times on the wrapping clock of the device.

use super::ReadingFault;
use super::config::READINGS_AHEAD;
use super::deadline::{beam_us, slew_us, ticks_us};
use crate::messages::limits::TICK_HZ;
use crate::messages::{Reading, ReadingStatus, Settings, Sweep};

/// Longest interval that cannot be confused across a wrap: a quarter of the clock's period, ticks.
const NEAR_TICKS: u64 = 1 << 30;
const TICKS_PER_US: u64 = TICK_HZ as u64 / 1_000_000;
/// Tolerated rate error of the device clock, as the reciprocal of a fraction.
const MAX_RATE_ERROR_RECIPROCAL: u64 = 50;
/// Number of firings stored: the out-of-order window, and the same number before it.
const STORED: usize = 2 * READINGS_AHEAD as usize;

/// Last reported value of the device clock.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct DeviceTime {
    /// Time of the request, us, and a clock value reported after it.
    last: Option<(u64, u32)>,
}

impl DeviceTime {
    pub(super) const fn record(&mut self, sent_us: u64, ticks: u32) {
        self.last = Some((sent_us, ticks));
    }

    /// Discards the value after a restart, or before an operation that may exceed the clock's
    /// period.
    pub(super) const fn forget(&mut self) {
        self.last = None;
    }

    /// Earliest device clock at which a request sent now can be executed.
    pub(super) fn floor(&self, now_us: u64) -> Option<u32> {
        let (sent_us, ticks) = self.last?;
        let elapsed = now_us.saturating_sub(sent_us).saturating_mul(TICKS_PER_US);
        (elapsed < NEAR_TICKS).then_some(ticks)
    }

    /// Rejects a firing later than now, plus the time that the host may have been suspended.
    pub(super) fn check_past(
        &self,
        now_us: u64,
        fired_ticks: u32,
        slack_us: u64,
    ) -> Result<(), ReadingFault> {
        let Some((sent_us, ticks)) = self.last else { return Ok(()) };
        let elapsed = now_us.saturating_sub(sent_us).saturating_mul(TICKS_PER_US);
        let slack = slack_us.saturating_mul(TICKS_PER_US);
        let latest =
            elapsed.saturating_add(elapsed / MAX_RATE_ERROR_RECIPROCAL).saturating_add(slack);
        let after = fired_ticks.wrapping_sub(ticks).cast_signed();
        match u64::try_from(after) {
            Ok(after) if latest < NEAR_TICKS && after > latest => {
                let ticks = u32::try_from(after - elapsed).unwrap_or(u32::MAX);
                Err(ReadingFault::FiredInFuture { ticks })
            }
            _ => Ok(()),
        }
    }
}

/// Rejects a firing before `floor`.
pub(super) fn check_after(floor: Option<u32>, fired_ticks: u32) -> Result<(), ReadingFault> {
    floor.map_or(Ok(()), |floor| check_delay(floor, fired_ticks, 0))
}

fn check_delay(earlier: u32, later: u32, min_delay: u64) -> Result<(), ReadingFault> {
    let delay = i64::from(later.wrapping_sub(earlier).cast_signed());
    let lacking = i64::try_from(min_delay).unwrap_or(i64::MAX).saturating_sub(delay);
    if lacking <= 0 {
        return Ok(());
    }
    Err(ReadingFault::FiredTooEarly { ticks: u32::try_from(lacking).unwrap_or(u32::MAX) })
}

/// Times at which the beams of a sweep were fired.
#[derive(Debug, Clone)]
pub(super) struct FiringTimes {
    settings: Settings,
    /// Device clock before the sweep, ticks, and position of the motor at that time.
    floor: Option<(u32, i32)>,
    known: [Option<FiringTime>; STORED],
}

#[derive(Debug, Clone, Copy)]
struct FiringTime {
    index: u16,
    ticks: u32,
    /// `true` if the module was fired, so that a listening window followed.
    window_open: bool,
}

impl FiringTimes {
    pub(super) const fn new(settings: Settings, floor: Option<(u32, i32)>) -> Self {
        Self { settings, floor, known: [None; STORED] }
    }

    /// Stores the time of an accepted reading.
    pub(super) fn keep(&mut self, reading: &Reading) {
        let slot = self.known.get_mut(usize::from(reading.index) % STORED);
        if let Some(slot) = slot {
            *slot = Some(FiringTime::from_reading(reading));
        }
    }

    /// Checks a reading against the nearest stored readings before and after it.
    pub(super) fn check(&self, plan: &Sweep, reading: &Reading) -> Result<(), ReadingFault> {
        let this = FiringTime::from_reading(reading);
        let known = || self.known.iter().flatten();
        let before =
            known().filter(|firing| firing.index < this.index).max_by_key(|firing| firing.index);
        let after =
            known().filter(|firing| firing.index > this.index).min_by_key(|firing| firing.index);
        match before {
            Some(before) => self.check_pair(plan, *before, this)?,
            None => self.check_first(plan, this)?,
        }
        after.map_or(Ok(()), |after| self.check_pair(plan, this, *after))
    }

    fn check_first(&self, plan: &Sweep, this: FiringTime) -> Result<(), ReadingFault> {
        let Some((floor, from)) = self.floor else { return Ok(()) };
        let slew_us = slew_us(plan.first_step.abs_diff(from), &self.settings);
        let beams = u64::from(this.index) + 1;
        let longest = self.longest_us(plan, beams).saturating_add(slew_us);
        if longest.saturating_mul(TICKS_PER_US) > NEAR_TICKS {
            return Ok(());
        }
        check_delay(floor, this.ticks, 0)
    }

    /// Checks the time between two beams: at least the interval, or the window after a firing; at
    /// another stop also the settling time.
    fn check_pair(
        &self,
        plan: &Sweep,
        earlier: FiringTime,
        later: FiringTime,
    ) -> Result<(), ReadingFault> {
        let beams = u64::from(later.index.saturating_sub(earlier.index));
        if self.longest_us(plan, beams).saturating_mul(TICKS_PER_US) > NEAR_TICKS {
            return Ok(());
        }
        let Settings { window_ticks, min_interval_ticks, settle_ticks, .. } = self.settings;
        let moved = plan.step_of(earlier.index) != plan.step_of(later.index);
        let busy = if earlier.window_open { u64::from(window_ticks) } else { 0 }
            + if moved { u64::from(settle_ticks) } else { 0 };
        let interval = u64::from(min_interval_ticks);
        let min_delay = busy.max(interval) + beams.saturating_sub(1) * interval;
        check_delay(earlier.ticks, later.ticks, min_delay)
    }

    /// Upper bound of the time of `beams` beams, us.
    fn longest_us(&self, plan: &Sweep, beams: u64) -> u64 {
        let turn_us = slew_us(plan.stride.unsigned_abs().into(), &self.settings);
        let settle_us = ticks_us(self.settings.settle_ticks);
        let beam_us = beam_us(&self.settings).saturating_add(turn_us).saturating_add(settle_us);
        beams.saturating_mul(beam_us).saturating_mul(2)
    }
}

impl FiringTime {
    const fn from_reading(reading: &Reading) -> Self {
        let window_open = !matches!(reading.status, ReadingStatus::ModuleFault);
        Self { index: reading.index, ticks: reading.fired_ticks, window_open }
    }
}

#[cfg(test)]
mod tests {
    use super::{DeviceTime, FiringTimes};
    use crate::host::ReadingFault;
    use crate::messages::{Blanking, Echoes, Reading, ReadingStatus, Settings, Sweep};

    const SETTINGS: Settings = Settings {
        window_ticks: 40_000,
        min_interval_ticks: 50_000,
        settle_ticks: 20_000,
        max_echoes: 1,
        blanking: Blanking::Internal,
        speed: 1_000,
        acceleration: 40_000,
        hold_s: 0,
    };
    const PLAN: Sweep =
        Sweep { sweep: 1, first_step: 0, stride: 1, stops: 50, pings_per_stop: 2, lease_ms: 1_000 };

    fn reading(index: u16, fired_ticks: u32) -> Reading {
        Reading {
            sweep: 1,
            index,
            step: i32::from(index / 2),
            fired_ticks,
            status: ReadingStatus::NoEcho,
            echoes: Echoes::new(),
        }
    }

    fn early(ticks: u32) -> Result<(), ReadingFault> {
        Err(ReadingFault::FiredTooEarly { ticks })
    }

    #[test]
    fn interval_window_and_settling() {
        // Over a wrap of the clock.
        let start = u32::MAX - 30_000;
        let mut firings = FiringTimes::new(SETTINGS, Some((start, 0)));
        let at = |after: u32| start.wrapping_add(after);
        assert_eq!(firings.check(&PLAN, &reading(0, start.wrapping_sub(7))), early(7));
        assert_eq!(firings.check(&PLAN, &reading(0, at(0))), Ok(()));
        firings.keep(&reading(0, at(0)));
        // At the same stop the interval counts, at the next one window and settling time.
        assert_eq!(firings.check(&PLAN, &reading(1, at(49_999))), early(1));
        assert_eq!(firings.check(&PLAN, &reading(1, at(50_000))), Ok(()));
        firings.keep(&reading(1, at(50_000)));
        assert_eq!(firings.check(&PLAN, &reading(2, at(109_999))), early(1));
        assert_eq!(firings.check(&PLAN, &reading(2, at(110_000))), Ok(()));
        // A late reading must fit between its neighbours.
        firings.keep(&reading(4, at(300_000)));
        assert_eq!(firings.check(&PLAN, &reading(3, at(240_000))), Ok(()));
        assert_eq!(firings.check(&PLAN, &reading(3, at(240_001))), early(1));
        // Two beams earlier, hence another interval earlier.
        assert_eq!(firings.check(&PLAN, &reading(2, at(190_000))), Ok(()));
        assert_eq!(firings.check(&PLAN, &reading(2, at(190_001))), early(1));
    }

    #[test]
    fn unchecked_across_clock_period() {
        let slow = Settings { speed: 1, ..SETTINGS };
        let far = Sweep { stride: 30_000, ..PLAN };
        let mut firings = FiringTimes::new(slow, Some((1_000, 0)));
        firings.keep(&reading(0, 2_000));
        assert_eq!(firings.check(&far, &reading(2, 1_500)), Ok(()));
    }

    #[test]
    fn rejects_future_firing() {
        let mut time = DeviceTime::default();
        assert_eq!(time.check_past(5_000_000, 77, 0), Ok(()));
        time.record(1_000_000, u32::MAX);
        // One second later the clock has advanced by two million ticks, plus at most two percent.
        assert_eq!(time.check_past(2_000_000, 2_039_999, 0), Ok(()));
        let ahead = ReadingFault::FiredInFuture { ticks: 50_000 };
        assert_eq!(time.check_past(2_000_000, 2_049_999, 0), Err(ahead));
        assert_eq!(time.check_past(2_000_000, 2_049_999, 10_000), Ok(()));
        assert_eq!(time.floor(2_000_000), Some(u32::MAX));
        assert_eq!(time.floor(600_000_000_000), None, "so long ago that the clock has wrapped");
    }
}

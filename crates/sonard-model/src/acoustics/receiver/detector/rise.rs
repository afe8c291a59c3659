//! Search for the time at which the envelope has exceeded the threshold for the integration time.

use super::{
    envelope::EnvelopeDetector,
    firing::{EchoDetector as _, WINDOW_SLACK_US},
    pulse::ActivePulse,
    sum::Summation,
};
use crate::acoustics::Gain;

/// Sampling step of the envelope, microseconds: a third of the standard deviation of a 7 kHz
/// filter's response, the shortest rise.
const STEP_US: f64 = 8.0;

/// Maximum step while the envelope is above the threshold, microseconds.
const LONG_STEP_US: f64 = 30.0;

/// Maximum step over which the envelope provably stays below the threshold, microseconds. The gain
/// rises by at most one step in that time.
const LONG_QUIET_US: f64 = 200.0;

/// Accuracy of threshold crossings: natural logarithm of the envelope over the threshold, or
/// microseconds. Either is below 1e-12 m of range at usual slopes of the envelope.
const CROSSING_LEVEL: f64 = 1e-12;
const CROSSING_US: f64 = 1e-9;

/// Maximum number of evaluations per crossing, and of those by false position; five are usual. The
/// rest bisects [`LONG_QUIET_US`] down to [`CROSSING_US`].
const CROSSING_ROUNDS: u32 = 52;
const SECANT_ROUNDS: u32 = 12;

impl<S: Summation> EnvelopeDetector<'_, S> {
    /// Searches the next rise for a detector that is ready from `ready_us` on, at least up to
    /// `until_us`.
    pub(super) fn search_rise(&mut self, ready_us: f64, until_us: f64) -> Option<FoundRise> {
        let receiver = self.track.firing.receiver;
        let integration_us = receiver.integration_us;
        let window_us = receiver.window_us() + WINDOW_SLACK_US;
        let in_window = |rise_us: f64, begins_us: f64, isolated: Option<usize>| {
            let rise_us = rise_us.max(ready_us);
            (rise_us <= window_us).then_some(FoundRise { rise_us, begins_us, isolated })
        };
        let (mut t_us, mut here) = (ready_us, self.relative_level(ready_us));
        // A rise is found at the first sample after the integration time.
        let deadline_us = until_us + integration_us + STEP_US;
        let last_us = (window_us + 2.0 * integration_us).min(deadline_us);
        // Time above the threshold minus time below it since then, and when it was last 0.
        let (mut charge_us, mut begins_us) = (0.0_f64, ready_us);
        while t_us <= last_us && !self.track.exceeds_horizon() {
            if !here.is_above()
                && charge_us == 0.0
                && self.watched != Some(self.track.active_range())
            {
                match self.skip(t_us, deadline_us) {
                    Skip::Exhausted => return None,
                    Skip::Isolated { rise_us } => {
                        let is_isolated = self.has_tabulated_rises() && self.is_isolated_now();
                        let isolated = is_isolated.then_some(self.track.active_range().0);
                        return in_window(rise_us, rise_us, isolated);
                    }
                    Skip::To(later_us) if later_us > t_us => {
                        (t_us, here) = (later_us, self.relative_level(later_us));
                        continue;
                    }
                    Skip::To(_) => self.watched = Some(self.track.active_range()),
                }
            }
            let missing_us = integration_us - charge_us;
            if here.is_above() && missing_us <= 0.0 {
                return in_window(t_us - charge_us, begins_us, None);
            }
            let step_us = if here.is_above() {
                missing_us.clamp(1.0, LONG_STEP_US)
            } else {
                self.quiet_us(t_us, &here)
            };
            let next_us = t_us + step_us;
            let next = self.relative_level(next_us);
            let crossing_us = if here.is_above() == next.is_above() {
                next_us
            } else {
                self.crossing_us((t_us, here.relative), (next_us, next.relative))
            };
            // Before the crossing the state is that of `here`, after it that of `next`.
            let charged = |charge_us: f64, part_us: f64, above: bool| {
                (charge_us + if above { part_us } else { -part_us }).max(0.0)
            };
            charge_us = charged(charge_us, crossing_us - t_us, here.is_above());
            if charge_us == 0.0 {
                begins_us = crossing_us;
            }
            charge_us = charged(charge_us, next_us - crossing_us, next.is_above());
            (t_us, here) = (next_us, next);
        }
        None
    }

    /// Next time at which the envelope may cross the threshold, from a time at which it is below; as
    /// far as it is before `deadline_us`.
    fn skip(&mut self, mut t_us: f64, deadline_us: f64) -> Skip {
        if self.track.firing.noise.is_some() {
            return Skip::To(t_us);
        }
        while t_us <= deadline_us {
            self.track.advance(t_us);
            if self.track.exceeds_horizon() {
                return Skip::Exhausted;
            }
            let start_us = self.track.next_start_us();
            if self.may_pass(t_us) {
                let live = self.track.active();
                let [pulse] = live else { return Skip::To(t_us) };
                if self.gain_steps_during(pulse) {
                    return Skip::To(t_us);
                }
                let Some((rise_us, lasts)) = self.isolated_rise(pulse, t_us) else {
                    // The crossing is in the past or absent.
                    let end_us = pulse.tof_us + self.track.span_us.1 + 1e-3;
                    match start_us {
                        Some(start_us) => t_us = start_us.min(end_us),
                        None => return self.exhausted(),
                    }
                    continue;
                };
                let done_us = rise_us + self.track.firing.receiver.integration_us;
                if start_us.is_none_or(|start_us| start_us > done_us) {
                    if lasts {
                        self.track.examine(done_us);
                        return Skip::Isolated { rise_us };
                    }
                    t_us = pulse.tof_us + self.track.span_us.1 + 1e-3;
                    if let Some(start_us) = start_us {
                        t_us = t_us.min(start_us);
                    }
                    continue;
                }
                return Skip::To(t_us.max(rise_us.min(start_us.unwrap_or(rise_us)) - STEP_US));
            }
            match start_us {
                Some(start_us) => t_us = start_us,
                None => return self.exhausted(),
            }
        }
        self.track.examine(deadline_us);
        Skip::Exhausted
    }

    /// Returns `true` if the active pulses, added in phase, could exceed the minimum threshold.
    fn may_pass(&mut self, t_us: f64) -> bool {
        let minimum = self.threshold.minimum();
        let gain = self.track.gain_increase(t_us).max(1.0);
        let last = self.track.active().last();
        // The first condition is a cheap upper bound of the second.
        last.is_some_and(|last| last.with_others * gain >= minimum)
            && self.track.bounds().strength * gain >= minimum
    }

    /// Ends the scan without an echo, a result that depends on all arrivals.
    const fn exhausted(&mut self) -> Skip {
        self.track.examine(f64::MAX);
        Skip::Exhausted
    }

    /// Envelope relative to the threshold at a time. Times must not decrease between calls.
    fn relative_level(&mut self, t_us: f64) -> RelativeLevel {
        let (level, threshold) = (self.level(t_us), self.threshold.at(t_us));
        RelativeLevel { relative: level / threshold, threshold }
    }

    /// Time for which the envelope provably stays below the threshold from the state `here`, but at
    /// least the sampling step.
    fn quiet_us(&mut self, t_us: f64, here: &RelativeLevel) -> f64 {
        // The factor 1.1 covers the increase of the gain in that time.
        let grows = 1.1 * self.track.gain_increase(t_us);
        let steepest = self.track.bounds().steepest;
        let threshold = here.threshold;
        let start_us = self.track.next_start_us().unwrap_or(f64::INFINITY);
        let quiet_us =
            ((1.0 - here.relative) * threshold / (grows * steepest)).min(start_us - t_us);
        let is_long = self.track.firing.noise.is_none() && quiet_us.min(LONG_QUIET_US) > STEP_US;
        // The threshold rises with range and falls at a gain step.
        if is_long && self.threshold.at(t_us + quiet_us.min(LONG_QUIET_US)) >= threshold {
            quiet_us.min(LONG_QUIET_US)
        } else {
            STEP_US
        }
    }

    /// Threshold crossing of an isolated arrival after `t_us`, and whether it stays above for the
    /// integration time or is above again after it.
    pub(super) fn isolated_rise(&self, pulse: &ActivePulse, t_us: f64) -> Option<(f64, bool)> {
        let at = |offset_us: f64| pulse.tof_us + offset_us - self.track.firing.receiver.lead_us;
        let level_at =
            |t_us: f64| self.threshold.at(t_us) / (pulse.size * self.track.gain_increase(t_us));
        let mut rise_us = pulse.tof_us;
        // The threshold changes with range and the gain with time.
        for _ in 0..2 {
            rise_us = at(self.track.shape(pulse).rise_us(level_at(rise_us))?);
        }
        if rise_us < t_us {
            return None;
        }
        let done_us = rise_us + self.track.firing.receiver.integration_us - pulse.tof_us
            + self.track.firing.receiver.lead_us;
        Some((rise_us, self.track.shape(pulse).max_from(done_us) >= level_at(rise_us)))
    }

    /// Returns `true` if the only active pulse begins after the last one ended and ends before the
    /// next begins.
    fn is_isolated_now(&self) -> bool {
        let [ActivePulse { lasts_us: [begins_us, ends_us], .. }] = self.track.active() else {
            return false;
        };
        let is_last_over =
            self.track.ended().last().is_none_or(|last| last.lasts_us[1] < *begins_us);
        is_last_over && self.track.next_start_us().is_none_or(|next_us| *ends_us < next_us)
    }

    /// Returns `true` if a gain step begins during an arrival.
    fn gain_steps_during(&self, pulse: &ActivePulse) -> bool {
        let Gain::Steps { steps } = &self.track.firing.receiver.gain else { return false };
        let [begins_us, ends_us] = pulse.lasts_us;
        if self.threshold.holds_all(begins_us, ends_us) {
            return false;
        }
        let mut ends = steps.iter().filter_map(|step| step.until_us);
        ends.any(|until_us| (begins_us..ends_us).contains(&until_us))
    }

    /// Threshold crossing of the envelope between two times, by false position on its logarithm,
    /// which is nearly linear, with the end that stays damped as by Anderson and Bjorck (1973). The
    /// result is converged: it is independent of the two times.
    fn crossing_us(&self, from: (f64, f64), to: (f64, f64)) -> f64 {
        let (mut low, mut high) = ((from.0, from.1.max(1e-9).ln()), (to.0, to.1.max(1e-9).ln()));
        let rises = high.1 >= 0.0;
        let damped = |here: f64, replaced: f64| match 1.0 - here / replaced {
            share if share > 0.0 => share,
            _ => 0.5,
        };
        let mut was_high = None;
        for round in 0..CROSSING_ROUNDS {
            // A gain step causes a jump, for which only bisection converges.
            let share = if round < SECANT_ROUNDS { low.1 / (low.1 - high.1) } else { 0.5 };
            let t_us = low.0 + share * (high.0 - low.0);
            let here = self.relative_level_back(t_us).max(1e-9).ln();
            let is_high = (here >= 0.0) == rises;
            if is_high {
                if was_high == Some(true) {
                    low.1 *= damped(here, high.1);
                }
                high = (t_us, here);
            } else {
                if was_high == Some(false) {
                    high.1 *= damped(here, low.1);
                }
                low = (t_us, here);
            }
            was_high = Some(is_high);
            if here.abs() < CROSSING_LEVEL {
                return t_us;
            }
            if high.0 - low.0 < CROSSING_US {
                break;
            }
        }
        // After a jump.
        high.0
    }

    /// Envelope over threshold at most one step before the last time examined.
    fn relative_level_back(&self, t_us: f64) -> f64 {
        // Pulses that have ended at the later time may still be active.
        self.sum(self.track.recently_active(), t_us) / self.threshold.at(t_us)
    }
}

/// Rise of the envelope, microseconds.
pub(super) struct FoundRise {
    pub(super) rise_us: f64,
    /// Latest time at which nothing was integrated.
    pub(super) begins_us: f64,
    /// Index of the pulse, if it is isolated.
    pub(super) isolated: Option<usize>,
}

/// Envelope relative to the threshold.
#[derive(Clone, Copy)]
struct RelativeLevel {
    /// Ratio of envelope to threshold.
    relative: f64,
    /// Effective threshold at that time.
    threshold: f64,
}

impl RelativeLevel {
    fn is_above(&self) -> bool {
        self.relative >= 1.0
    }
}

/// Continuation of the scan from a time below the threshold.
enum Skip {
    /// No further arrival can be detected in time.
    Exhausted,
    /// An isolated arrival crosses the threshold.
    Isolated { rise_us: f64 },
    /// Time from which the envelope has to be sampled.
    To(f64),
}

//! When the envelope of all arrivals together has been above the threshold for long enough.

use super::{Hearing, Lone, Summand, WINDOW_SLACK_US};
use crate::{
    acoustics::{Detector, Gain, PulseArrival},
    reading::PingStatus,
};

/// Steps at which an envelope is watched, microseconds: a third of the standard deviation of a
/// 7 kHz filter's response, below which nothing rises.
const STEP_US: f64 = 8.0;

/// Longest step while the envelope is above the threshold, microseconds.
const LONG_STEP_US: f64 = 30.0;

/// Longest step over which the envelope is known to stay below the threshold, microseconds: the gain
/// rises no more than once meanwhile.
const LONG_QUIET_US: f64 = 200.0;

impl Hearing<'_> {
    /// The next rise at a threshold not below the last one's, if that was of an arrival with which nothing else sounds and
    /// this one is too, with the arrival: what comes before it does not pass a higher threshold either. `None` if it takes
    /// [`Self::next_rise`] to tell; for detectors that watch the envelope.
    pub(in super::super) fn lone_rise_again(
        &mut self,
        from_us: f64,
    ) -> Option<(f64, PulseArrival)> {
        let Lone { place, factor, from_us: listened_us } = self.lone?;
        if factor > self.threshold_factor || from_us < listened_us {
            return None;
        }
        let (rise_us, lasts) = self.lone_rise(&self.summands[place], from_us)?;
        let is_in_window = rise_us <= self.receiver.window_us() + WINDOW_SLACK_US;
        if !lasts || !is_in_window || self.receiver.status_at(rise_us) != PingStatus::Echo {
            return None;
        }
        self.asked_us = self.asked_us.max(rise_us + self.receiver.integration_us);
        Some((rise_us, self.arrivals[place]))
    }

    /// Whether the last rise was of an arrival with which nothing else sounds.
    pub(in super::super) const fn is_lone(&self) -> bool {
        self.lone.is_some()
    }

    pub(super) fn next_rise_of_sum(&mut self, ready_us: f64) -> Option<f64> {
        self.lone = None;
        let integration_us = self.receiver.integration_us;
        let window_us = self.receiver.window_us() + WINDOW_SLACK_US;
        let heard = |rise_us: f64| Some(rise_us.max(ready_us)).filter(|us| *us <= window_us);
        let (mut t_us, mut here) = (ready_us, self.standing(ready_us));
        // How long the envelope has been above, less how long below since.
        let mut charge_us = 0.0_f64;
        while t_us <= window_us + 2.0 * integration_us && !self.asked_beyond() {
            if !here.is_above() && charge_us == 0.0 && self.watched != Some(self.lasting()) {
                match self.skip(t_us) {
                    Skip::Silence => return None,
                    Skip::Lone { rise_us } => {
                        let is_lone = self.is_plain
                            && self.receiver.detector == Detector::Envelope
                            && self.is_sounding_alone();
                        self.lone = is_lone.then_some(Lone {
                            place: self.over,
                            factor: self.threshold_factor,
                            from_us: ready_us,
                        });
                        return heard(rise_us);
                    }
                    Skip::To(later_us) if later_us > t_us => {
                        (t_us, here) = (later_us, self.standing(later_us));
                        continue;
                    }
                    Skip::To(_) => self.watched = Some(self.lasting()),
                }
            }
            let wanted_us = integration_us - charge_us;
            if here.is_above() && wanted_us <= 0.0 {
                return heard(t_us - charge_us);
            }
            let step_us = if here.is_above() {
                wanted_us.clamp(1.0, LONG_STEP_US)
            } else {
                self.quiet_us(t_us, &here)
            };
            let next_us = t_us + step_us;
            let next = self.standing(next_us);
            let turn_us = if here.is_above() == next.is_above() {
                next_us
            } else {
                self.turn((t_us, here.relative), (next_us, next.relative))
            };
            // Before the turn as it is here, after it as it is next.
            let charged = |charge_us: f64, part_us: f64, above: bool| {
                (charge_us + if above { part_us } else { -part_us }).max(0.0)
            };
            charge_us = charged(charge_us, turn_us - t_us, here.is_above());
            charge_us = charged(charge_us, next_us - turn_us, next.is_above());
            (t_us, here) = (next_us, next);
        }
        None
    }

    /// From a time at which the envelope is below the threshold: the next one at which it may pass.
    fn skip(&mut self, mut t_us: f64) -> Skip {
        if self.noise.is_some() {
            return Skip::To(t_us);
        }
        loop {
            self.advance(t_us);
            if self.asked_beyond() {
                return Skip::Silence;
            }
            let entry_us = self.next_entry_us();
            if self.may_pass(t_us) {
                let live = &self.summands[self.over..self.begun];
                let [summand] = live else { return Skip::To(t_us) };
                if self.gain_steps_during(summand) {
                    return Skip::To(t_us);
                }
                let Some((rise_us, lasts)) = self.lone_rise(summand, t_us) else {
                    // It has passed already, or never does.
                    let end_us = summand.tof_us + self.span_us.1 + 1e-3;
                    match entry_us {
                        Some(entry_us) => t_us = entry_us.min(end_us),
                        None => return self.silence(),
                    }
                    continue;
                };
                let done_us = rise_us + self.receiver.integration_us;
                if entry_us.is_none_or(|entry_us| entry_us > done_us) {
                    if lasts {
                        self.asked_us = self.asked_us.max(done_us);
                        return Skip::Lone { rise_us };
                    }
                    t_us = summand.tof_us + self.span_us.1 + 1e-3;
                    if let Some(entry_us) = entry_us {
                        t_us = t_us.min(entry_us);
                    }
                    continue;
                }
                return Skip::To(t_us.max(rise_us.min(entry_us.unwrap_or(rise_us)) - STEP_US));
            }
            match entry_us {
                Some(entry_us) => t_us = entry_us,
                None => return self.silence(),
            }
        }
    }

    /// Whether what sounds could pass the least threshold there is, if all of it added up.
    fn may_pass(&mut self, t_us: f64) -> bool {
        let least = self.threshold_factor * self.least_threshold;
        let gain = self.rise_of_gain(t_us).max(1.0);
        let last = self.summands[self.over..self.begun].last();
        // The first is a bound of the second, which is told by one number.
        last.is_some_and(|last| last.with_others * gain >= least)
            && self.bounds().strength * gain >= least
    }

    /// Nothing comes any more, which only those know who know all arrivals.
    const fn silence(&mut self) -> Skip {
        self.asked_us = f64::MAX;
        Skip::Silence
    }

    /// How the envelope stands to the threshold at a time; no earlier time can be asked for
    /// afterwards.
    fn standing(&mut self, t_us: f64) -> Standing {
        let (level, threshold) = (self.level(t_us), self.threshold_at(t_us));
        Standing { relative: level / threshold, threshold }
    }

    /// How long the envelope, which stands as `here` now, certainly stays below the threshold, but
    /// at least the step at which it is watched.
    fn quiet_us(&mut self, t_us: f64, here: &Standing) -> f64 {
        // What the gain adds in that time is within the tenth.
        let grows = 1.1 * self.rise_of_gain(t_us);
        let steepest = self.bounds().steepest;
        let threshold = here.threshold;
        let entry_us = self.next_entry_us().unwrap_or(f64::INFINITY);
        let quiet_us =
            ((1.0 - here.relative) * threshold / (grows * steepest)).min(entry_us - t_us);
        let is_long = self.noise.is_none() && quiet_us.min(LONG_QUIET_US) > STEP_US;
        // The threshold drifts up with the range and falls where the gain rises by a step.
        if is_long && self.threshold_at(t_us + quiet_us.min(LONG_QUIET_US)) >= threshold {
            quiet_us.min(LONG_QUIET_US)
        } else {
            STEP_US
        }
    }

    /// When an arrival alone passes the threshold after `t_us`, and whether it is above for the integration time or
    /// longer, or again after it.
    fn lone_rise(&self, summand: &Summand, t_us: f64) -> Option<(f64, bool)> {
        let at = |offset_us: f64| summand.tof_us + offset_us - self.receiver.lead_us;
        let level_at =
            |t_us: f64| self.threshold_at(t_us) / (summand.size * self.rise_of_gain(t_us));
        let mut rise_us = summand.tof_us;
        // The threshold drifts with the range, and the gain with the time.
        for _ in 0..2 {
            rise_us = at(self.shape(summand).rise_us(level_at(rise_us))?);
        }
        if rise_us < t_us {
            return None;
        }
        let done_us =
            rise_us + self.receiver.integration_us - summand.tof_us + self.receiver.lead_us;
        Some((rise_us, self.shape(summand).most_from(done_us) >= level_at(rise_us)))
    }

    /// Whether all of the one arrival that sounds is between the end of the last and the beginning of the next one.
    fn is_sounding_alone(&self) -> bool {
        let (past, live) = self.summands[..self.begun].split_at(self.over);
        let [Summand { lasts_us: [begins_us, ends_us], .. }] = live else { return false };
        let is_last_over = past.last().is_none_or(|last| last.lasts_us[1] < *begins_us);
        is_last_over && *ends_us < self.next_us
    }

    /// Whether the gain rises by a step while an arrival lasts.
    fn gain_steps_during(&self, summand: &Summand) -> bool {
        let Gain::Steps { steps } = &self.receiver.gain else { return false };
        let [begins_us, ends_us] = summand.lasts_us;
        if self.step.get().holds_all(begins_us, ends_us) {
            return false;
        }
        let mut ends = steps.iter().filter_map(|step| step.until_us);
        ends.any(|until_us| (begins_us..ends_us).contains(&until_us))
    }

    /// Where the envelope passes the threshold between two times, by false position on its
    /// logarithm, which is nearly straight.
    fn turn(&self, from: (f64, f64), to: (f64, f64)) -> f64 {
        let (mut low, mut high) = ((from.0, from.1.max(1e-9).ln()), (to.0, to.1.max(1e-9).ln()));
        let rises = high.1 >= 0.0;
        let mut t_us = low.0;
        for round in 0..16 {
            // Where the gain rises by a step there is a jump, which only halving finds.
            let share = if round < 4 { low.1 / (low.1 - high.1) } else { 0.5 };
            t_us = low.0 + share * (high.0 - low.0);
            let here = self.relative_level_back(t_us).max(1e-9).ln();
            if (here >= 0.0) == rises {
                high = (t_us, here);
            } else {
                low = (t_us, here);
            }
            if here.abs() < 1e-4 || high.0 - low.0 < 0.01 {
                break;
            }
        }
        t_us
    }

    /// Envelope over threshold a step or less before the last time asked for.
    fn relative_level_back(&self, t_us: f64) -> f64 {
        // What was over at the later time may not have been.
        self.level_of(self.over.saturating_sub(8), t_us) / self.threshold_at(t_us)
    }
}

/// How the envelope stands to the threshold.
#[derive(Clone, Copy)]
struct Standing {
    /// Envelope over threshold.
    relative: f64,
    /// The threshold in force.
    threshold: f64,
}

impl Standing {
    fn is_above(&self) -> bool {
        self.relative >= 1.0
    }
}

/// Where to go on from a time without echo.
enum Skip {
    /// Nothing more will come.
    Silence,
    /// One arrival, alone, passes the threshold.
    Lone { rise_us: f64 },
    /// Here the envelope has to be watched.
    To(f64),
}

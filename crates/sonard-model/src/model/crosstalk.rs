//! Crosstalk: reception of other firings by a ranger of an array.
//!
//! A sound that left `before` seconds earlier and has run `L` arrives as an echo of length
//! `L - c before` would. The current gain is that of the echo, and compensates its spreading, not
//! the larger spreading of the sound: relative to its own amplitude the sound is weaker by
//! `(L - c before) / L`. Both bursts begin with the same phase, so the carriers also add up by that
//! length.

use super::{
    cost::TooCostly,
    engine::{Arrival, Arrivals},
    paths::{CrosstalkPaths, PathEngine, TransducerPose},
};
use crate::{
    acoustics::{Incident, PulseArrival, Receiver},
    array::InterferingFiring,
};

/// Number of samples of a receive window at which the bound on earlier firings is evaluated.
const WINDOW_SAMPLES: u32 = 256;

/// Maximum number of earlier slots of an array that are included.
const MAX_SLOTS: usize = 64;

/// Number of earlier slots whose strongest sound, with `absorption_np_per_m` of the air off one
/// perfect wall, can still pass a receiver's threshold. Each slot is `slot_m` of path earlier.
pub(super) fn crosstalk_slots(receiver: &Receiver, absorption_np_per_m: f64, slot_m: f64) -> usize {
    let [from_us, until_us] = [receiver.blanking_us, receiver.window_us()];
    let is_detectable = |slots: &usize| {
        (0..=WINDOW_SAMPLES).any(|sample| {
            let share = f64::from(sample) / f64::from(WINDOW_SAMPLES);
            let at_us = from_us + share * (until_us - from_us);
            let apparent_m = at_us * 1e-6 * receiver.sound_speed_m_s;
            let length_m = apparent_m + *slots as f64 * slot_m;
            let amplitude = apparent_m / length_m * (-absorption_np_per_m * length_m).exp();
            amplitude >= receiver.threshold_at(at_us)
        })
    };
    (1..=MAX_SLOTS).take_while(is_detectable).last().unwrap_or(0)
}

/// Other firings whose sound one ranger may receive.
pub(super) struct OtherFirings<'a> {
    /// Engine for sufficiently long paths.
    pub(super) engine: &'a PathEngine,
    /// Pose of the receiving ranger.
    pub(super) receiver: TransducerPose,
    pub(super) sound_speed_m_s: f64,
    /// Length of the receive window there and back, metres.
    pub(super) window_m: f64,
    pub(super) firings: Vec<(InterferingFiring, TransducerPose)>,
}

/// Sound received from another firing.
struct StraySound<'a> {
    firing: InterferingFiring,
    /// Difference between true and apparent path length, metres.
    ahead_m: f64,
    paths: CrosstalkPaths<'a>,
}

impl<'a> OtherFirings<'a> {
    /// Returns `true` if there are no other firings.
    pub(super) fn is_empty(&self) -> bool {
        self.firings.is_empty()
    }

    /// Returns the sound of the other firings that arrives within a length there and back, metres.
    fn within(&self, length_m: f64) -> Result<Vec<StraySound<'a>>, TooCostly> {
        let received = |&(firing, transmitter): &(InterferingFiring, TransducerPose)| {
            let ahead_m = firing.before_us * 1e-6 * self.sound_speed_m_s;
            // Relative to its own amplitude, a sound is strongest at the end of the window.
            let floor = self.engine.floor() * (1.0 + ahead_m / self.window_m);
            let ends = [transmitter, self.receiver];
            let paths = self.engine.aimed(ends, length_m + ahead_m, floor)?;
            Ok(StraySound { firing, ahead_m, paths })
        };
        self.firings.iter().map(received).collect()
    }

    /// Finds the result of a firing. `predict` receives the sound of others up to a length, metres,
    /// and returns its result together with the length up to which it depends on that sound.
    pub(super) fn resolve<T>(
        &self,
        mut needed_m: f64,
        mut predict: impl FnMut(&MixedArrivals<'_>) -> Result<(T, f64), TooCostly>,
    ) -> Result<T, TooCostly> {
        loop {
            let known_m = if needed_m < self.window_m { needed_m } else { f64::INFINITY };
            let strays = self.within(known_m.min(self.window_m))?;
            let (result, then_m) = predict(&MixedArrivals { strays: &strays, known_m })?;
            if then_m <= known_m {
                return Ok(result);
            }
            needed_m = f64::INFINITY;
        }
    }
}

/// Arrivals of a firing combined with the sound of others.
#[derive(Clone, Copy)]
pub(super) struct MixedArrivals<'a> {
    strays: &'a [StraySound<'a>],
    /// Length there and back up to which the others' sound is known, metres.
    pub(super) known_m: f64,
}

/// Origin of a mixed arrival: the firing itself (`None`) or the number of a stray, with the
/// original arrival.
type Origin = (Option<usize>, PulseArrival);

/// Mixed arrivals by apparent echo length, numbered in that order.
pub(super) struct MergedArrivals {
    pub(super) arrivals: Vec<PulseArrival>,
    origins: Vec<Origin>,
}

impl MixedArrivals<'_> {
    /// Merges a firing's own arrivals with the others'.
    pub(super) fn sorted(&self, own: &[PulseArrival]) -> MergedArrivals {
        let mut all: Vec<(f64, Origin)> =
            own.iter().map(|arrival| (arrival.length_m, (None, *arrival))).collect();
        for (number, stray) in self.strays.iter().enumerate() {
            let apparent = stray.paths.arrivals().map(|arrival| {
                let apparent_m = arrival.length_m - stray.ahead_m;
                (apparent_m, (Some(number), arrival))
            });
            all.extend(
                apparent.filter(|(apparent_m, _)| *apparent_m > 0.0 && *apparent_m <= self.known_m),
            );
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let numbered = all.iter().zip(0..).map(|(&(apparent_m, (_, arrival)), index)| {
            let amplitude = arrival.amplitude * (apparent_m / arrival.length_m);
            PulseArrival { length_m: apparent_m, amplitude, index, ..arrival }
        });
        MergedArrivals {
            arrivals: numbered.collect(),
            origins: all.into_iter().map(|(_, origin)| origin).collect(),
        }
    }

    /// Returns the incidence of an arrival; `own` returns it for the firing's own arrivals.
    pub(super) fn incident(
        &self,
        sorted: &MergedArrivals,
        arrival: &PulseArrival,
        own: impl FnOnce(&PulseArrival) -> Incident,
    ) -> Incident {
        let (source, original) = &sorted.origins[arrival.index as usize];
        match source {
            None => own(original),
            Some(number) => {
                let incident = self.strays[*number].paths.incident(original);
                let strength = incident.strength * (arrival.length_m / original.length_m);
                Incident { strength, ..incident }
            }
        }
    }

    /// Returns the full description of an arrival, and the other firing that emitted it, if any.
    pub(super) fn arrival(
        &self,
        sorted: &MergedArrivals,
        arrival: &PulseArrival,
        own: (&dyn Arrivals, f64),
    ) -> (Arrival, Option<InterferingFiring>) {
        let (source, original) = &sorted.origins[arrival.index as usize];
        match source {
            None => (own.0.arrival(own.1, original), None),
            Some(number) => {
                let stray = &self.strays[*number];
                let original_arrival = stray.paths.arrival(original);
                (Arrival { amplitude: arrival.amplitude, ..original_arrival }, Some(stray.firing))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acoustics::{Gain, Sensor};

    /// Of `n` turns back, of `t` of path each, the strongest sound appears at length `h` where
    /// `1 / h - 1 / (h + n t)` is the absorption.
    #[test]
    fn slots_are_limited_by_absorption() {
        let sensor = Sensor {
            gain: Gain::default(),
            threshold: 0.02,
            max_range_m: 3.4,
            ..Sensor::preset("senscomp-6500").expect("a preset")
        };
        let receiver = Receiver::new(&sensor, 340.0);
        for (absorption, slot_m, expected) in [(0.6, 1.0, 3), (0.6, 2.0, 1), (0.3, 1.0, 6)] {
            let most = |turns: f64| {
                let ahead_m: f64 = turns * slot_m;
                let apparent_m = (ahead_m * ahead_m + 4.0 * ahead_m / absorption).sqrt() - ahead_m;
                let apparent_m = (0.5 * apparent_m).clamp(0.82, 6.8);
                apparent_m / (apparent_m + ahead_m) * (-absorption * (apparent_m + ahead_m)).exp()
            };
            let count = (1..).take_while(|turns| most(f64::from(*turns)) >= 0.02).count();
            assert_eq!(count, expected, "{absorption} {slot_m}");
            assert_eq!(crosstalk_slots(&receiver, absorption, slot_m), expected);
        }
        assert_eq!(crosstalk_slots(&receiver, 5.0, 1.0), 0);
        assert_eq!(crosstalk_slots(&receiver, 0.0, 1e-3), MAX_SLOTS);
    }
}

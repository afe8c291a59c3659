//! Crosstalk: what a ranger of an array receives of other firings than its own.
//!
//! A sound that left `before` seconds earlier and has run `L` arrives as an echo of length `L - c before` would.
//! The gain in force is that of the echo, and makes up for its spreading, not for the longer one that the sound has
//! behind it: beside its own amplitude it is weaker by `(L - c before) / L`. Both bursts begin with the same
//! phase, so the carriers add up by that length, too.

use super::{
    cost::TooCostly,
    engine::{Arrival, Arrivals},
    paths::{Aimed, AimedPaths, PathEngine},
};
use crate::{
    acoustics::{Incident, PulseArrival, Receiver},
    array::OtherFiring,
};

/// How often the bound on what can be heard of earlier firings is asked along a listening window.
const WINDOW_SAMPLES: u32 = 256;

/// Most turns of an array back that are listened for.
const MOST_TURNS: usize = 64;

/// The most turns back of which the strongest sound, with `absorption_np_per_m` of the air off one perfect wall, can
/// still pass a receiver's threshold in the window that begins so many times `turn_m` of path later.
pub(super) fn turns_heard(receiver: &Receiver, absorption_np_per_m: f64, turn_m: f64) -> usize {
    let [from_us, until_us] = [receiver.blanking_us, receiver.window_us()];
    let is_heard = |turns: &usize| {
        (0..=WINDOW_SAMPLES).any(|sample| {
            let share = f64::from(sample) / f64::from(WINDOW_SAMPLES);
            let at_us = from_us + share * (until_us - from_us);
            let heard_m = at_us * 1e-6 * receiver.sound_speed_m_s;
            let length_m = heard_m + *turns as f64 * turn_m;
            let amplitude = heard_m / length_m * (-absorption_np_per_m * length_m).exp();
            amplitude >= receiver.threshold_at(at_us)
        })
    };
    (1..=MOST_TURNS).take_while(is_heard).last().unwrap_or(0)
}

/// The other firings whose sound one ranger may receive.
pub(super) struct Others<'a> {
    /// Knows paths long enough.
    pub(super) engine: &'a PathEngine,
    /// The ranger that listens.
    pub(super) receiver: Aimed,
    pub(super) sound_speed_m_s: f64,
    /// The length up to which it listens there and back, metres.
    pub(super) window_m: f64,
    pub(super) firings: Vec<(OtherFiring, Aimed)>,
}

/// What is received of another firing.
struct Strays<'a> {
    firing: OtherFiring,
    /// How much shorter a path seems than it is, metres.
    ahead_m: f64,
    paths: AimedPaths<'a>,
}

impl<'a> Others<'a> {
    /// Whether nobody else fires.
    pub(super) fn is_silent(&self) -> bool {
        self.firings.is_empty()
    }

    /// What is received up to the moment at which an echo of a length there and back arrives, metres.
    fn within(&self, length_m: f64) -> Result<Vec<Strays<'a>>, TooCostly> {
        let heard = |&(firing, transmitter): &(OtherFiring, Aimed)| {
            let ahead_m = firing.before_us * 1e-6 * self.sound_speed_m_s;
            // At its strongest it arrives last.
            let floor = self.engine.floor() * (1.0 + ahead_m / self.window_m);
            let ends = [transmitter, self.receiver];
            let paths = self.engine.aimed(ends, length_m + ahead_m, floor)?;
            Ok(Strays { firing, ahead_m, paths })
        };
        self.firings.iter().map(heard).collect()
    }

    /// Looks for what settles a firing: `listen` is given what is received of others up to a length, metres, and
    /// tells with its result up to which length it depends on it.
    pub(super) fn settle<T>(
        &self,
        mut needed_m: f64,
        mut listen: impl FnMut(&Medley<'_>) -> Result<(T, f64), TooCostly>,
    ) -> Result<T, TooCostly> {
        loop {
            let known_m = if needed_m < self.window_m { needed_m } else { f64::INFINITY };
            let strays = self.within(known_m.min(self.window_m))?;
            let (heard, then_m) = listen(&Medley { strays: &strays, known_m })?;
            if then_m <= known_m {
                return Ok(heard);
            }
            needed_m = f64::INFINITY;
        }
    }
}

/// What a firing brings back together with the sound of others.
#[derive(Clone, Copy)]
pub(super) struct Medley<'a> {
    strays: &'a [Strays<'a>],
    /// Up to which length there and back the others' sound is known, metres.
    pub(super) known_m: f64,
}

/// Where an arrival of a medley comes from: the firing itself or a number among the strays, with the arrival as it is
/// told there.
type Origin = (Option<usize>, PulseArrival);

/// A medley's arrivals by the length that an echo would have, numbered in that order.
pub(super) struct Sorted {
    pub(super) arrivals: Vec<PulseArrival>,
    origins: Vec<Origin>,
}

impl Medley<'_> {
    /// Sorts a firing's own arrivals and the others' together.
    pub(super) fn sorted(&self, own: &[PulseArrival]) -> Sorted {
        let mut all: Vec<(f64, Origin)> =
            own.iter().map(|arrival| (arrival.length_m, (None, *arrival))).collect();
        for (number, stray) in self.strays.iter().enumerate() {
            let seeming = stray.paths.listen().map(|arrival| {
                let seems_m = arrival.length_m - stray.ahead_m;
                (seems_m, (Some(number), arrival))
            });
            all.extend(seeming.filter(|(seems_m, _)| *seems_m > 0.0 && *seems_m <= self.known_m));
        }
        all.sort_by(|one, other| one.0.total_cmp(&other.0));
        let numbered = all.iter().zip(0..).map(|(&(seems_m, (_, arrival)), index)| {
            let amplitude = arrival.amplitude * (seems_m / arrival.length_m);
            PulseArrival { length_m: seems_m, amplitude, index, ..arrival }
        });
        Sorted {
            arrivals: numbered.collect(),
            origins: all.into_iter().map(|(_, origin)| origin).collect(),
        }
    }

    /// The incidence of an arrival; of one of the firing's own what `own` tells.
    pub(super) fn incident(
        &self,
        sorted: &Sorted,
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

    /// The full account of an arrival, and whose sound it is if not the firing's own.
    pub(super) fn arrival(
        &self,
        sorted: &Sorted,
        arrival: &PulseArrival,
        own: (&dyn Arrivals, f64),
    ) -> (Arrival, Option<OtherFiring>) {
        let (source, original) = &sorted.origins[arrival.index as usize];
        match source {
            None => (own.0.arrival(own.1, original), None),
            Some(number) => {
                let stray = &self.strays[*number];
                let told = stray.paths.arrival(original);
                (Arrival { amplitude: arrival.amplitude, ..told }, Some(stray.firing))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acoustics::{Gain, Sensor};

    /// Of `n` turns back, of `t` of path each, most is heard of a sound that seems `h` long where
    /// `1 / h - 1 / (h + n t)` is the absorption.
    #[test]
    fn so_many_turns_are_heard_as_the_air_lets_through() {
        let sensor = Sensor {
            gain: Gain::default(),
            threshold: 0.02,
            max_range_m: 3.4,
            ..Sensor::preset("senscomp-6500").expect("a preset")
        };
        let receiver = Receiver::new(&sensor, 340.0);
        for (absorption, turn_m, expected) in [(0.6, 1.0, 3), (0.6, 2.0, 1), (0.3, 1.0, 6)] {
            let most = |turns: f64| {
                let ahead_m: f64 = turns * turn_m;
                let seems_m = (ahead_m * ahead_m + 4.0 * ahead_m / absorption).sqrt() - ahead_m;
                let seems_m = (0.5 * seems_m).clamp(0.82, 6.8);
                seems_m / (seems_m + ahead_m) * (-absorption * (seems_m + ahead_m)).exp()
            };
            let count = (1..).take_while(|turns| most(f64::from(*turns)) >= 0.02).count();
            assert_eq!(count, expected, "{absorption} {turn_m}");
            assert_eq!(turns_heard(&receiver, absorption, turn_m), expected);
        }
        assert_eq!(turns_heard(&receiver, 5.0, 1.0), 0);
        assert_eq!(turns_heard(&receiver, 0.0, 1e-3), MOST_TURNS);
    }
}

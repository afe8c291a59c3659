//! Temperature changes that air can make. Pure: times are given.

use std::time::Duration;

use thiserror::Error;

/// Change that is accepted at any time, kelvins: a gust through a door, a sensor's noise.
pub const MAX_STEP_K: f64 = 8.0;
/// Slope that is accepted for ever, kelvins a second. A sensor that is carried outdoors follows the
/// air by its time constant, about a minute for a probe in still air.
pub const MAX_SLOPE_K_S: f64 = 0.2;

/// Accepts temperatures that change no faster than those of air.
///
/// A reference follows the accepted temperature at no more than [`MAX_SLOPE_K_S`]; a temperature is
/// accepted within [`MAX_STEP_K`] of it. A level that is rejected is accepted once it has lasted for as
/// long as the reference needs to come near: where it is wrong, that can't be seen from the
/// temperature alone.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plausibility {
    state: Option<State>,
}

#[derive(Debug, Clone, PartialEq)]
struct State {
    reference_c: f64,
    accepted_c: f64,
    accepted_at: Duration,
    rejected: Option<Level>,
}

/// A temperature that is rejected, and since when.
#[derive(Debug, Clone, PartialEq)]
struct Level {
    temperature_c: f64,
    since: Duration,
}

/// The way in which a temperature was accepted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Admission {
    /// At once.
    Usual,
    /// After it had been rejected for some time.
    Persistent {
        /// The temperature accepted before, degrees Celsius.
        from_c: f64,
        /// Since the first rejection.
        waited: Duration,
    },
}

/// A temperature that changed faster than that of air.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{to_c:.1} C {:.1} s after {from_c:.1} C: air does not change so fast", after.as_secs_f64())]
pub struct FastChange {
    /// The last accepted temperature, degrees Celsius.
    pub from_c: f64,
    /// The rejected temperature, degrees Celsius.
    pub to_c: f64,
    /// Since the last accepted temperature.
    pub after: Duration,
}

impl Plausibility {
    /// Accepts or rejects a temperature, degrees Celsius, that was read at a time since any fixed
    /// moment.
    ///
    /// # Errors
    /// If it changed faster than that of air, or is not finite.
    pub fn admit(&mut self, temperature_c: f64, at: Duration) -> Result<Admission, FastChange> {
        let Some(state) = &mut self.state else {
            if !temperature_c.is_finite() {
                return Err(FastChange {
                    from_c: temperature_c,
                    to_c: temperature_c,
                    after: Duration::ZERO,
                });
            }
            self.state = Some(State {
                reference_c: temperature_c,
                accepted_c: temperature_c,
                accepted_at: at,
                rejected: None,
            });
            return Ok(Admission::Usual);
        };
        let same = |level: &&Level| (level.temperature_c - temperature_c).abs() <= MAX_STEP_K;
        let level = state.rejected.as_ref().filter(same).map(|level| level.since);
        // A first deviation may have come about at any time since the last reading, one that follows
        // another deviation only since that.
        let since = match (&state.rejected, level) {
            (None, _) => state.accepted_at,
            (Some(_), since) => since.unwrap_or(at),
        };
        let followed_k = MAX_SLOPE_K_S * at.saturating_sub(since).as_secs_f64();
        let away_k = temperature_c - state.reference_c;
        let reference_c = state.reference_c + away_k.clamp(-followed_k, followed_k);
        if (temperature_c - reference_c).abs() <= MAX_STEP_K {
            let admission = level.map_or(Admission::Usual, |since| Admission::Persistent {
                from_c: state.accepted_c,
                waited: at.saturating_sub(since),
            });
            let usual = (temperature_c - state.reference_c).abs() <= MAX_STEP_K;
            *state =
                State { reference_c, accepted_c: temperature_c, accepted_at: at, rejected: None };
            return Ok(if usual { Admission::Usual } else { admission });
        }
        if level.is_none() {
            state.rejected = Some(Level { temperature_c, since: at });
        }
        let after = at.saturating_sub(state.accepted_at);
        Err(FastChange { from_c: state.accepted_c, to_c: temperature_c, after })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Admits a level every so many seconds until it is accepted; the time that took, seconds.
    fn wait_for(gate: &mut Plausibility, temperature_c: f64, from_s: f64, every_s: f64) -> f64 {
        let mut waited_s = 0.0;
        while gate.admit(temperature_c, Duration::from_secs_f64(from_s + waited_s)).is_err() {
            waited_s += every_s;
            assert!(waited_s < 1e4, "never accepted");
        }
        waited_s
    }

    #[test]
    fn step_of_20_k_is_rejected_until_it_has_lasted_for_a_minute() {
        let mut gate = Plausibility::default();
        let second = Duration::from_secs;
        assert_eq!(gate.admit(21.0, second(0)), Ok(Admission::Usual));
        let error = gate.admit(1.0, second(2)).expect_err("too fast");
        assert_eq!(error.to_string(), "1.0 C 2.0 s after 21.0 C: air does not change so fast");
        assert_eq!(gate.admit(21.1, second(3)), Ok(Admission::Usual), "a single outlier");
        let waited_s = wait_for(&mut gate, 1.0, 4.0, 1.0);
        assert!((55.0..75.0).contains(&waited_s), "{waited_s}");
    }

    #[test]
    fn readings_that_jump_about_are_not_accepted_by_waiting() {
        let mut gate = Plausibility::default();
        gate.admit(20.0, Duration::ZERO).expect("the first");
        for second in 1..2000 {
            let garbage = [-18.0, 45.0][second as usize % 2];
            gate.admit(garbage, Duration::from_secs(second)).expect_err("garbage");
        }
    }

    #[test]
    fn change_over_a_night_without_readings_is_accepted() {
        let mut gate = Plausibility::default();
        gate.admit(25.0, Duration::ZERO).expect("the first");
        assert_eq!(gate.admit(2.0, Duration::from_secs(8 * 3600)), Ok(Admission::Usual));
    }

    #[test]
    fn what_is_not_finite_is_rejected_and_forgotten() {
        let mut gate = Plausibility::default();
        for at in 0..3 {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(gate.admit(value, Duration::from_secs(at)).is_err());
            }
            assert_eq!(gate.admit(20.0, Duration::from_secs(at)), Ok(Admission::Usual));
        }
    }

    proptest! {
        #[test]
        fn slow_changes_are_accepted_at_once(
            start_c in -20.0..50.0_f64,
            steps in prop::collection::vec((0.01..600.0_f64, -1.0..1.0_f64, -2.0..2.0_f64), 1..60),
        ) {
            let mut gate = Plausibility::default();
            let (mut at_s, mut air_c) = (0.0, start_c);
            gate.admit(air_c, Duration::ZERO).expect("the first");
            for (step_s, slope, noise_k) in steps {
                at_s += step_s;
                air_c += slope * MAX_SLOPE_K_S * step_s;
                let admitted = gate.admit(air_c + noise_k, Duration::from_secs_f64(at_s));
                prop_assert_eq!(admitted, Ok(Admission::Usual));
            }
        }

        #[test]
        fn fast_steps_are_rejected_and_persistent_ones_accepted_in_time(
            start_c in -20.0..50.0_f64,
            step_k in prop_oneof![-70.0..-8.5_f64, 8.5..70.0_f64],
            every_s in 0.1..2.0_f64,
        ) {
            let mut gate = Plausibility::default();
            gate.admit(start_c, Duration::ZERO).expect("the first");
            prop_assert!(gate.admit(start_c + step_k, Duration::from_secs(1)).is_err());
            let needed_s = (step_k.abs() - MAX_STEP_K) / MAX_SLOPE_K_S;
            let waited_s = wait_for(&mut gate, start_c + step_k, 1.0 + every_s, every_s) + every_s;
            prop_assert!(waited_s >= needed_s - 1e-6 && waited_s <= needed_s + 2.0 * every_s + 1e-6);
            let again = gate.admit(start_c + step_k, Duration::from_secs_f64(2.0 + waited_s));
            prop_assert_eq!(again, Ok(Admission::Usual));
        }

        #[test]
        fn accepted_temperatures_never_differ_by_more_than_allowed(
            readings in prop::collection::vec((0.0..30.0_f64, -60.0..60.0_f64), 1..80),
        ) {
            let mut gate = Plausibility::default();
            let (mut at_s, mut before) = (0.0, None::<(f64, f64)>);
            for (step_s, temperature_c) in readings {
                at_s += step_s;
                if gate.admit(temperature_c, Duration::from_secs_f64(at_s)).is_err() {
                    continue;
                }
                if let Some((before_s, before_c)) = before {
                    let allowed_k = 2.0 * MAX_STEP_K + MAX_SLOPE_K_S * (at_s - before_s) + 1e-6;
                    prop_assert!((temperature_c - before_c).abs() <= allowed_k);
                }
                before = Some((at_s, temperature_c));
            }
        }
    }
}

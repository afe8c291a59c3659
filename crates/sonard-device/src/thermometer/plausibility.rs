//! Plausibility of temperature changes of air. Pure: times are given.

use std::time::Duration;

use thiserror::Error;

/// Maximum step that is accepted at any time, kelvins: a gust through a door, a sensor's noise.
pub const MAX_STEP_K: f64 = 8.0;
/// Maximum slope that is accepted permanently, kelvins per second. A sensor that is carried
/// outdoors follows the air with its time constant, about a minute for a probe in still air.
pub const MAX_SLOPE_K_S: f64 = 0.2;

/// Filter that accepts temperatures that change no faster than those of air.
///
/// A reference follows the accepted temperature at [`MAX_SLOPE_K_S`] or less; a temperature is
/// accepted within [`MAX_STEP_K`] of the reference. A rejected level is accepted once it has lasted
/// for as long as the reference needs to approach it: the temperature alone can't show that such a
/// level is wrong.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plausibility {
    state: Option<FilterState>,
}

#[derive(Debug, Clone, PartialEq)]
struct FilterState {
    reference_c: f64,
    accepted_c: f64,
    accepted_at: Duration,
    rejected: Option<RejectedLevel>,
}

/// Rejected temperature, and the time of its first rejection.
#[derive(Debug, Clone, PartialEq)]
struct RejectedLevel {
    temperature_c: f64,
    since: Duration,
}

/// Kind of acceptance of a temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Admission {
    /// The temperature was accepted immediately.
    Usual,
    /// The temperature was accepted after a period of rejection.
    Persistent {
        /// Previously accepted temperature, degrees Celsius.
        from_c: f64,
        /// Time since the first rejection.
        waited: Duration,
    },
}

/// Temperature change that is too fast for air.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{to_c:.1} C {:.1} s after {from_c:.1} C: air does not change so fast", after.as_secs_f64())]
pub struct FastChange {
    /// Last accepted temperature, degrees Celsius.
    pub from_c: f64,
    /// Rejected temperature, degrees Celsius.
    pub to_c: f64,
    /// Time since the last accepted temperature.
    pub after: Duration,
}

impl Plausibility {
    /// Accepts or rejects a temperature in degrees Celsius. `at` is the time of the reading since
    /// any fixed moment.
    ///
    /// # Errors
    /// If the temperature changed too fast for air, or is not finite.
    pub fn admit(&mut self, temperature_c: f64, at: Duration) -> Result<Admission, FastChange> {
        let Some(state) = &mut self.state else {
            if !temperature_c.is_finite() {
                return Err(FastChange {
                    from_c: temperature_c,
                    to_c: temperature_c,
                    after: Duration::ZERO,
                });
            }
            self.state = Some(FilterState {
                reference_c: temperature_c,
                accepted_c: temperature_c,
                accepted_at: at,
                rejected: None,
            });
            return Ok(Admission::Usual);
        };
        let same =
            |level: &&RejectedLevel| (level.temperature_c - temperature_c).abs() <= MAX_STEP_K;
        let level = state.rejected.as_ref().filter(same).map(|level| level.since);
        // A first deviation may have developed at any time since the last accepted reading, a
        // second one only since the first.
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
            *state = FilterState {
                reference_c,
                accepted_c: temperature_c,
                accepted_at: at,
                rejected: None,
            };
            return Ok(if usual { Admission::Usual } else { admission });
        }
        if level.is_none() {
            state.rejected = Some(RejectedLevel { temperature_c, since: at });
        }
        let after = at.saturating_sub(state.accepted_at);
        Err(FastChange { from_c: state.accepted_c, to_c: temperature_c, after })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Offers a level every `every_s` seconds until it is accepted. Returns the time taken,
    /// seconds.
    fn wait_for(gate: &mut Plausibility, temperature_c: f64, from_s: f64, every_s: f64) -> f64 {
        let mut waited_s = 0.0;
        while gate.admit(temperature_c, Duration::from_secs_f64(from_s + waited_s)).is_err() {
            waited_s += every_s;
            assert!(waited_s < 1e4, "never accepted");
        }
        waited_s
    }

    #[test]
    fn large_step_must_last_a_minute() {
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
    fn erratic_readings_stay_rejected() {
        let mut gate = Plausibility::default();
        gate.admit(20.0, Duration::ZERO).expect("the first");
        for second in 1..2000 {
            let garbage = [-18.0, 45.0][second as usize % 2];
            gate.admit(garbage, Duration::from_secs(second)).expect_err("garbage");
        }
    }

    #[test]
    fn change_over_a_night_is_accepted() {
        let mut gate = Plausibility::default();
        gate.admit(25.0, Duration::ZERO).expect("the first");
        assert_eq!(gate.admit(2.0, Duration::from_secs(8 * 3600)), Ok(Admission::Usual));
    }

    #[test]
    fn non_finite_is_rejected() {
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
        fn slow_changes_are_accepted(
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
        fn persistent_step_is_accepted(
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
        fn accepted_changes_are_bounded(
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

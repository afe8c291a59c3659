//! The world around the mock: where the motor really is, and what is heard there.
//!
//! Pure: no clock, no I/O; the same seed gives the same readings.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use smallvec::SmallVec;
use sonard_model::{
    acoustics::TofNoise,
    geometry::Pose,
    model::{Prediction, Simulator, TooCostly},
};
use sonard_records::{PingStatus, ScanPlan};

/// The model's readings in each direction of the motor.
#[derive(Debug, Clone)]
pub struct Soundings {
    rows: Vec<Sounding>,
}

/// What is heard in one direction.
#[derive(Debug, Clone, Default, PartialEq)]
struct Sounding {
    echoes_us: SmallVec<[f64; 8]>,
    /// The first one is timed by the end of blanking, not by an echo's arrival.
    first_is_blanking: bool,
}

impl Soundings {
    /// Asks the model for every step of a revolution.
    ///
    /// `mounting_offset_deg`: how far the transducer is turned on the motor's shaft.
    ///
    /// # Errors
    /// When there are more paths than the model can find.
    pub fn of(
        simulator: &Simulator,
        pose: &Pose,
        steps_per_revolution: u16,
        mounting_offset_deg: f64,
    ) -> Result<Self, TooCostly> {
        let mounted = Pose { heading_deg: pose.heading_deg + mounting_offset_deg, ..*pose };
        let turn =
            ScanPlan { step_deg: 360.0 / f64::from(steps_per_revolution), ..ScanPlan::default() };
        let point = simulator.at(mounted.position());
        let ping = |stop| point.ping_rearmed(mounted.direction_rad(turn.azimuth_deg(stop)));
        let predictions = (0..turn.stops()).map(ping).collect::<Result<Vec<_>, _>>()?;
        Ok(Self::from_predictions(&predictions))
    }

    /// One prediction for each step of a revolution, from azimuth 0 on.
    #[must_use]
    pub fn from_predictions(predictions: &[Prediction]) -> Self {
        let rows = predictions
            .iter()
            .map(|prediction| Sounding {
                echoes_us: prediction.echoes_us.clone(),
                first_is_blanking: prediction.status == PingStatus::MinRange,
            })
            .collect();
        Self { rows }
    }

    fn at(&self, step: i32) -> Option<&Sounding> {
        let turn = i32::try_from(self.rows.len()).ok().filter(|&turn| turn > 0)?;
        self.rows.get(step.rem_euclid(turn) as usize)
    }
}

/// Motor and air.
#[derive(Debug)]
pub struct World {
    soundings: Soundings,
    noise: TofNoise,
    missed_step_rate: f64,
    /// Where the motor really is, steps.
    step: i32,
    rng: Pcg64,
}

impl World {
    /// A world; the motor stands at home. `missed_step_rate`: probability for each move that it
    /// falls one step short.
    #[must_use]
    pub fn new(soundings: Soundings, noise: TofNoise, missed_step_rate: f64, seed: u64) -> Self {
        let rng = Pcg64::seed_from_u64(seed);
        Self { soundings, noise, missed_step_rate: missed_step_rate.clamp(0.0, 1.0), step: 0, rng }
    }

    /// Sounds otherwise from now on.
    pub fn set_soundings(&mut self, soundings: Soundings) {
        self.soundings = soundings;
    }

    /// Turns by so many commanded steps.
    pub fn turn(&mut self, steps: i32) {
        let missed = steps != 0 && self.rng.random_bool(self.missed_step_rate);
        self.step += steps - if missed { steps.signum() } else { 0 };
    }

    /// How far the motor really is from the index, steps.
    #[must_use]
    pub const fn steps_from_index(&self) -> i32 {
        self.step
    }

    /// Turns to the index and returns how far that was, steps.
    pub fn seek_index(&mut self) -> i32 {
        std::mem::take(&mut self.step)
    }

    /// Fires and returns the echo times after firing, ticks of `tick_hz`, within the window.
    pub fn fire(&mut self, window_ticks: u32, tick_hz: u32) -> SmallVec<[u32; 8]> {
        let sounding = self.soundings.at(self.step).cloned().unwrap_or_default();
        let ticks_per_us = f64::from(tick_hz) / 1e6;
        let mut heard = SmallVec::new();
        let mut last = 0;
        for (i, echo_us) in sounding.echoes_us.iter().enumerate() {
            let blanking = i == 0 && sounding.first_is_blanking;
            let error_us = if blanking { 0.0 } else { self.noise.sample_us(&mut self.rng) };
            // Noise never swaps two echoes, and none comes before the ranger fired.
            let ticks = (((echo_us + error_us) * ticks_per_us).round() as u32).max(last + 1);
            if ticks <= window_ticks {
                heard.push(ticks);
                last = ticks;
            }
        }
        heard
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smallvec::smallvec;

    fn soundings() -> Soundings {
        let row = |echoes_us: &[f64], first_is_blanking| Sounding {
            echoes_us: echoes_us.into(),
            first_is_blanking,
        };
        Soundings {
            rows: vec![
                row(&[3000.0, 5000.0], false),
                row(&[2380.0, 6000.0], true),
                row(&[], false),
            ],
        }
    }

    #[test]
    fn each_direction_has_its_echoes_and_a_turn_wraps() {
        let mut world = World::new(soundings(), TofNoise::NONE, 0.0, 1);
        let heard: SmallVec<[u32; 8]> = smallvec![6000, 10_000];
        assert_eq!(world.fire(20_000, 2_000_000), heard);
        world.turn(-2);
        assert_eq!(world.fire(20_000, 2_000_000)[..], [4760, 12_000]);
        world.turn(1);
        assert!(world.fire(20_000, 2_000_000).is_empty());
        world.turn(4);
        assert_eq!(world.fire(9_000, 2_000_000)[..], [6000], "the window ends before the second");
    }

    #[test]
    fn the_end_of_blanking_has_no_noise_and_a_seed_repeats() {
        let noise = TofNoise { sigma_us: 5.0, tail_share: 0.1, tail_us: 20.0 };
        let fire = |seed| {
            let mut world = World::new(soundings(), noise, 0.0, seed);
            world.turn(1);
            world.fire(20_000, 2_000_000)
        };
        assert_eq!(fire(3)[0], 4760);
        assert_ne!(fire(3)[1], 12_000);
        assert_eq!(fire(3), fire(3));
        assert_ne!(fire(3), fire(4));
    }

    #[test]
    fn missed_steps_show_at_the_index() {
        let mut world = World::new(soundings(), TofNoise::NONE, 1.0, 1);
        for _ in 0..10 {
            world.turn(3);
        }
        assert_eq!(world.seek_index(), 20, "each move fell one step short");
        assert_eq!(world.seek_index(), 0);
    }
}

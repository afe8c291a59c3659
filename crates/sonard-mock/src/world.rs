//! Simulated environment of the mock: true motor position and echoes.
//!
//! Pure: no clock, no I/O; readings are determined by the seed.

use firmware_protocol::messages::ReadingStatus;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use smallvec::SmallVec;
use sonard_model::{
    acoustics::TofNoise,
    geometry::Pose,
    model::{Prediction, Simulator, TooCostly},
};
use sonard_records::{PingStatus, ScanPlan};

use super::{
    note::Note,
    replay::{Replay, ReplayedReading},
};

/// Predicted echoes for each motor step of a revolution.
#[derive(Debug, Clone)]
pub struct EchoTable {
    rows: Vec<EchoRow>,
}

/// Predicted echoes at one motor step.
#[derive(Debug, Clone, Default, PartialEq)]
struct EchoRow {
    echoes_us: SmallVec<[f64; 8]>,
    /// `true` if the first time is the end of blanking instead of an echo's arrival.
    first_is_blanking: bool,
}

impl EchoTable {
    /// Computes the echoes for every step of a revolution.
    ///
    /// `mounting_offset_deg`: angle of the transducer on the motor's shaft.
    ///
    /// # Errors
    /// If the number of propagation paths exceeds the model's limit.
    pub fn from_model(
        simulator: &Simulator,
        pose: &Pose,
        steps_per_revolution: u16,
        mounting_offset_deg: f64,
    ) -> Result<Self, TooCostly> {
        let mounted = Pose { heading_deg: pose.heading_deg + mounting_offset_deg, ..*pose };
        let revolution =
            ScanPlan { step_deg: 360.0 / f64::from(steps_per_revolution), ..ScanPlan::default() };
        let point = simulator.at(mounted.position());
        let ping = |stop| point.ping_rearmed(mounted.direction_rad(revolution.azimuth_deg(stop)));
        let predictions = (0..revolution.stops()).map(ping).collect::<Result<Vec<_>, _>>()?;
        Ok(Self::from_predictions(&predictions))
    }

    /// Converts predictions for each step of a revolution, from azimuth 0 on.
    #[must_use]
    pub fn from_predictions(predictions: &[Prediction]) -> Self {
        let rows = predictions
            .iter()
            .map(|prediction| EchoRow {
                echoes_us: prediction.echoes_us.clone(),
                first_is_blanking: prediction.status == PingStatus::MinRange,
            })
            .collect();
        Self { rows }
    }

    fn at(&self, step: i32) -> Option<&EchoRow> {
        let steps = i32::try_from(self.rows.len()).ok().filter(|&steps| steps > 0)?;
        self.rows.get(step.rem_euclid(steps) as usize)
    }
}

/// Source of a world's echoes.
#[derive(Debug)]
enum EchoSource {
    Model(EchoTable),
    Log(Replay),
}

/// Outcome of a firing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Firing {
    /// Status that the board reports.
    pub status: ReadingStatus,
    /// Echo times after firing, ticks.
    pub echo_ticks: SmallVec<[u32; 8]>,
}

/// Simulated motor and echoes.
#[derive(Debug)]
pub struct World {
    echoes: EchoSource,
    noise: TofNoise,
    missed_step_rate: f64,
    /// True position of the motor, steps.
    step: i32,
    rng: Pcg64,
}

impl World {
    /// Creates a world with the motor at home. `missed_step_rate`: probability per move that it
    /// ends one step short.
    #[must_use]
    pub fn new(soundings: EchoTable, noise: TofNoise, missed_step_rate: f64, seed: u64) -> Self {
        let rng = Pcg64::seed_from_u64(seed);
        Self {
            echoes: EchoSource::Model(soundings),
            noise,
            missed_step_rate: missed_step_rate.clamp(0.0, 1.0),
            step: 0,
            rng,
        }
    }

    /// Creates a world with the readings of a log and the motor at home.
    #[must_use]
    pub fn from_replay(replay: Replay) -> Self {
        Self {
            echoes: EchoSource::Log(replay),
            noise: TofNoise::NONE,
            missed_step_rate: 0.0,
            step: 0,
            rng: Pcg64::seed_from_u64(0),
        }
    }

    /// Replaces the echoes, for instance after a move of the robot.
    pub fn set_echo_table(&mut self, soundings: EchoTable) {
        self.echoes = EchoSource::Model(soundings);
    }

    /// Turns the motor by a commanded number of steps.
    pub fn turn(&mut self, steps: i32) {
        let missed = steps != 0 && self.rng.random_bool(self.missed_step_rate);
        self.step += steps - if missed { steps.signum() } else { 0 };
    }

    /// True distance of the motor from the index, steps.
    #[must_use]
    pub const fn steps_from_index(&self) -> i32 {
        self.step
    }

    /// Turns the motor to the index. Returns the true distance, steps.
    pub fn seek_index(&mut self) -> i32 {
        if let EchoSource::Log(replay) = &mut self.echoes {
            replay.home();
        }
        std::mem::take(&mut self.step)
    }

    /// Takes the note of a replayed scan that has begun.
    pub(super) fn take_begun_scan(&mut self) -> Option<Note> {
        let EchoSource::Log(replay) = &mut self.echoes else { return None };
        replay.take_begun().map(|scan| Note::Replayed(scan, replay.scans()))
    }

    /// Fires and returns the echoes within the window, in ticks of `tick_hz`.
    pub fn fire(&mut self, window_ticks: u32, tick_hz: u32) -> Firing {
        match &mut self.echoes {
            EchoSource::Model(_) => {
                let echo_ticks = self.simulate(window_ticks, tick_hz);
                Firing { status: ReadingStatus::Echo, echo_ticks }
            }
            EchoSource::Log(replay) => {
                let ReplayedReading { status, echo_ticks } = replay.fire(self.step);
                let within = echo_ticks.into_iter().filter(|&ticks| ticks <= window_ticks);
                Firing { status, echo_ticks: within.collect() }
            }
        }
    }

    fn simulate(&mut self, window_ticks: u32, tick_hz: u32) -> SmallVec<[u32; 8]> {
        let EchoSource::Model(soundings) = &self.echoes else { return SmallVec::new() };
        let row = soundings.at(self.step).cloned().unwrap_or_default();
        let ticks_per_us = f64::from(tick_hz) / 1e6;
        let mut echoes = SmallVec::new();
        let mut last = 0;
        for (i, echo_us) in row.echoes_us.iter().enumerate() {
            let blanking = i == 0 && row.first_is_blanking;
            let error_us = if blanking { 0.0 } else { self.noise.sample_us(&mut self.rng) };
            // Noise neither swaps two echoes nor moves one before the firing.
            let ticks = (((echo_us + error_us) * ticks_per_us).round() as u32).max(last + 1);
            if ticks <= window_ticks {
                echoes.push(ticks);
                last = ticks;
            }
        }
        echoes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smallvec::smallvec;

    fn soundings() -> EchoTable {
        let row = |echoes_us: &[f64], first_is_blanking| EchoRow {
            echoes_us: echoes_us.into(),
            first_is_blanking,
        };
        EchoTable {
            rows: vec![
                row(&[3000.0, 5000.0], false),
                row(&[2380.0, 6000.0], true),
                row(&[], false),
            ],
        }
    }

    #[test]
    fn echoes_depend_on_direction() {
        let mut world = World::new(soundings(), TofNoise::NONE, 0.0, 1);
        let echoes: SmallVec<[u32; 8]> = smallvec![6000, 10_000];
        assert_eq!(world.fire(20_000, 2_000_000).echo_ticks, echoes);
        world.turn(-2);
        assert_eq!(world.fire(20_000, 2_000_000).echo_ticks[..], [4760, 12_000]);
        world.turn(1);
        assert!(world.fire(20_000, 2_000_000).echo_ticks.is_empty());
        world.turn(4);
        assert_eq!(
            world.fire(9_000, 2_000_000).echo_ticks[..],
            [6000],
            "the window ends before the second"
        );
    }

    #[test]
    fn noise_spares_the_blanking() {
        let noise = TofNoise { sigma_us: 5.0, tail_share: 0.1, tail_us: 20.0 };
        let fire = |seed| {
            let mut world = World::new(soundings(), noise, 0.0, seed);
            world.turn(1);
            world.fire(20_000, 2_000_000).echo_ticks
        };
        assert_eq!(fire(3)[0], 4760);
        assert_ne!(fire(3)[1], 12_000);
        assert_eq!(fire(3), fire(3));
        assert_ne!(fire(3), fire(4));
    }

    #[test]
    fn missed_steps_appear_at_the_index() {
        let mut world = World::new(soundings(), TofNoise::NONE, 1.0, 1);
        for _ in 0..10 {
            world.turn(3);
        }
        assert_eq!(world.seek_index(), 20, "each move fell one step short");
        assert_eq!(world.seek_index(), 0);
    }
}

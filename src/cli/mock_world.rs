//! Options of the mock's world, shared by `mock` and `scan --mock`.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use rand::{RngExt as _, rand_core::UnwrapErr, rngs::SysRng};

use super::{
    Failure,
    numbers::{not_negative, probability},
    scene_file,
};
use crate::{
    acoustics::{Air, Sensor, TofNoise},
    geometry::Pose,
    mock::{BoardSettings, EchoTable, FAULT_HELP, FaultPlan, MockBoard, Pace, Replay, World},
    model::{Options, Simulator},
    scene::Scene,
};

/// Names of the options below, for verbs that work without a mock.
pub(super) const OPTIONS: [&str; 10] = [
    "truth",
    "truth_pose",
    "truth_temperature_c",
    "realtime",
    "seed",
    "faults",
    "noise_mm",
    "missed_steps",
    "mounting_offset_deg",
    "steps_per_revolution",
];

/// Options of the mock's world.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Mock")]
pub(super) struct MockWorldArgs {
    /// True scene of the mock, if different from --scene
    #[arg(long, value_name = "SCENE")]
    truth: Option<PathBuf>,
    /// True pose of the mock, X,Y,DEG or the name of a pose in its scene; without it, the mock is
    /// where the scan assumes it, and follows a changed pose
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    truth_pose: Option<String>,
    /// Air temperature of the mock's world, degrees Celsius, if different
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    truth_temperature_c: Option<f64>,
    /// Pace the mock by the wall clock instead of as fast as possible
    #[arg(long)]
    realtime: bool,
    /// Random seed; for noise, missed steps and faults
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Faults to inject
    #[arg(long, value_name = "SPEC", long_help = FAULT_HELP)]
    faults: Option<FaultPlan>,
    /// Standard deviation of the range noise, millimetres (the far tail is longer)
    #[arg(long, value_name = "MM", default_value_t = 0.5, value_parser = not_negative)]
    noise_mm: f64,
    /// Probability of a lost step in each move
    #[arg(long, value_name = "P", default_value_t = 0.0, value_parser = probability)]
    missed_steps: f64,
    /// Mounting offset of the transducer on the motor's shaft, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    mounting_offset_deg: f64,
    /// Motor steps per revolution, including microsteps and gears
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u16).range(4..=12800))]
    steps_per_revolution: u16,
}

/// Model assumed by the host; the true world differs only by explicit options.
pub(super) struct AssumedModel<'a> {
    pub(super) scene: &'a Arc<Scene>,
    pub(super) pose: &'a Pose,
    pub(super) sensor: &'a Sensor,
    pub(super) air: &'a Air,
    pub(super) options: &'a Options,
}

impl MockWorldArgs {
    /// Creates the board, powered up in its world, paced according to the options.
    pub(super) fn board(&self, assumed: &AssumedModel<'_>) -> Result<MockBoard, Failure> {
        let pace = if self.realtime { Pace::RealTime } else { Pace::Virtual };
        self.board_at(pace, assumed)
    }

    /// Creates the board that replays a log, paced and disturbed according to the options.
    pub(super) fn replaying_board(&self, replay: Replay) -> MockBoard {
        let pace = if self.realtime { Pace::RealTime } else { Pace::Virtual };
        let steps_per_revolution = replay.steps_per_revolution();
        let settings =
            BoardSettings { is_replay: true, ..self.settings(pace, steps_per_revolution) };
        MockBoard::new(settings, World::from_replay(replay))
    }

    /// Creates the board with the given pace.
    pub(super) fn board_at(
        &self,
        pace: Pace,
        assumed: &AssumedModel<'_>,
    ) -> Result<MockBoard, Failure> {
        let sound_speed_m_s = self.truth_air(assumed.air)?.sound_speed_m_s();
        let soundings = self.soundings(assumed)?;
        let steps = self.steps_per_revolution;
        let noise = TofNoise::from_range_sigma_mm(self.noise_mm, sound_speed_m_s);
        let world = World::new(soundings, noise, self.missed_steps, self.seed);
        Ok(MockBoard::new(self.settings(pace, steps), world))
    }

    fn settings(&self, pace: Pace, steps_per_revolution: u16) -> BoardSettings {
        BoardSettings {
            // Consecutive mocks are different boots, so the boot number must not come from the
            // seed.
            boot: UnwrapErr(SysRng).random_range(1..=u16::MAX),
            clock: 0,
            steps_per_revolution,
            faults: self.faults.unwrap_or_default(),
            seed: self.seed,
            pace,
            is_replay: false,
        }
    }

    /// Computes the echoes in the true world, at the true pose or else the assumed one.
    pub(super) fn soundings(&self, assumed: &AssumedModel<'_>) -> Result<EchoTable, Failure> {
        let scene = match &self.truth {
            Some(name) => Arc::new(scene_file::load(name)?),
            None => Arc::clone(assumed.scene),
        };
        let pose = match &self.truth_pose {
            Some(pose) => scene_file::pose(&scene, pose)?,
            None => *assumed.pose,
        };
        let air = self.truth_air(assumed.air)?;
        // The mock covers whatever window it receives, so the model must reach as far.
        let options = Options { max_range_m: None, ..*assumed.options };
        let simulator = Simulator::new(
            Arc::new(scene.with_robot_at(&pose)),
            assumed.sensor.clone(),
            air,
            options,
        )
        .map_err(|error| Failure::input(error, "see `sonard mock --help`"))?;
        let steps = self.steps_per_revolution;
        EchoTable::from_model(&simulator, &pose, steps, self.mounting_offset_deg)
            .map_err(|error| Failure::input(error, "give a simpler scene"))
    }

    /// Returns `true` if the true scene is given.
    pub(super) const fn has_truth(&self) -> bool {
        self.truth.is_some()
    }

    /// Motor steps per revolution.
    pub(super) const fn steps_per_revolution(&self) -> u16 {
        self.steps_per_revolution
    }

    /// Returns the options of `sonard-emulator` for this world, as far as it supports them.
    pub(super) fn emulator(&self, scene: &Path) -> Result<Vec<String>, Failure> {
        let scene = self.truth.as_deref().unwrap_or(scene);
        let scene = scene.to_str().ok_or_else(|| {
            let help = "rename it: the emulator accepts UTF-8 paths only";
            Failure::input(format!("the path {} is not UTF-8", scene.display()), help)
        })?;
        let unsupported = |option: &str, instead: &str| {
            Err(Failure::input(format!("the emulator does not support {option}"), instead))
        };
        if self.truth_pose.is_some() {
            return unsupported("--truth-pose", "use --mock");
        }
        if self.faults.is_some() {
            return unsupported(
                "--faults",
                "use --mock; `sonard-emulator --dips` simulates brown-outs",
            );
        }
        if self.missed_steps > 0.0 {
            return unsupported(
                "--missed-steps",
                "its motor loses steps if --speed or --acceleration are too high",
            );
        }
        let mut options = vec![
            format!("--scene={scene}"),
            format!("--seed={}", self.seed),
            format!("--noise-mm={}", self.noise_mm),
            format!("--mounting-offset-deg={}", self.mounting_offset_deg),
            format!("--steps-per-revolution={}", self.steps_per_revolution),
        ];
        if let Some(temperature_c) = self.truth_temperature_c {
            options.push(format!("--truth-temperature-c={temperature_c}"));
        }
        Ok(options)
    }

    fn truth_air(&self, assumed: &Air) -> Result<Air, Failure> {
        let Some(temperature_c) = self.truth_temperature_c else { return Ok(*assumed) };
        Air::new(temperature_c, assumed.humidity_percent(), assumed.pressure_kpa())
            .map_err(|error| Failure::input(error, "give --truth-temperature-c in degrees Celsius"))
    }
}

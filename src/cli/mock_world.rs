//! The mock's world as options: shared by `mock` and `scan --mock`.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use rand::RngExt as _;

use super::{
    Failure,
    numbers::{not_negative, probability},
    scene_file,
};
use crate::{
    acoustics::{Air, Sensor, TofNoise},
    geometry::Pose,
    mock::{BoardSettings, FAULT_HELP, FaultPlan, MockBoard, Pace, Soundings, World},
    model::{Options, Simulator},
    scene::Scene,
};

/// Names of the options below, for verbs that can do without a mock.
pub(super) const OPTIONS: [&str; 9] = [
    "truth",
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
    /// Air temperature of the mock's world, degrees Celsius, if different
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    truth_temperature_c: Option<f64>,
    /// Pace the mock by the wall clock instead of as fast as possible
    #[arg(long)]
    realtime: bool,
    /// Random seed; noise, missed steps and faults
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Faults to inject
    #[arg(long, value_name = "SPEC", long_help = FAULT_HELP)]
    faults: Option<FaultPlan>,
    /// Standard deviation of the range noise, millimetres (the far tail is longer)
    #[arg(long, value_name = "MM", default_value_t = 0.5, value_parser = not_negative)]
    noise_mm: f64,
    /// Probability for each move that the motor falls a step short
    #[arg(long, value_name = "P", default_value_t = 0.0, value_parser = probability)]
    missed_steps: f64,
    /// How far the transducer is turned on the motor's shaft, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    mounting_offset_deg: f64,
    /// Motor steps a revolution, including microsteps and gears
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u16).range(4..=12800))]
    steps_per_revolution: u16,
}

/// What the host believes, from which the truth differs only where it is told to.
pub(super) struct AssumedModel<'a> {
    pub(super) scene: &'a Arc<Scene>,
    pub(super) pose: &'a Pose,
    pub(super) sensor: &'a Sensor,
    pub(super) air: &'a Air,
    pub(super) options: &'a Options,
}

impl MockWorldArgs {
    /// The board, powered up in its world.
    pub(super) fn board(&self, assumed: &AssumedModel<'_>) -> Result<MockBoard, Failure> {
        let pace = if self.realtime { Pace::RealTime } else { Pace::Virtual };
        self.board_at(pace, assumed)
    }

    /// The same at a given pace.
    pub(super) fn board_at(
        &self,
        pace: Pace,
        assumed: &AssumedModel<'_>,
    ) -> Result<MockBoard, Failure> {
        let sound_speed_m_s = self.truth_air(assumed.air)?.sound_speed_m_s();
        let soundings = self.soundings(assumed)?;
        let steps = self.steps_per_revolution;
        let noise = TofNoise::of_range_mm(self.noise_mm, sound_speed_m_s);
        let world = World::new(soundings, noise, self.missed_steps, self.seed);
        // Two mocks in a row are two boots: a nonce from the seed would repeat.
        let boot = rand::rng().random_range(1..=u16::MAX);
        let settings = BoardSettings {
            boot,
            clock: 0,
            steps_per_revolution: steps,
            faults: self.faults.unwrap_or_default(),
            seed: self.seed,
            pace,
        };
        Ok(MockBoard::new(settings, world))
    }

    /// What is heard at the pose believed in.
    pub(super) fn soundings(&self, assumed: &AssumedModel<'_>) -> Result<Soundings, Failure> {
        let scene = match &self.truth {
            Some(name) => Arc::new(scene_file::load(name)?),
            None => Arc::clone(assumed.scene),
        };
        let air = self.truth_air(assumed.air)?;
        // The mock hears to the end of whatever window it is told; the model must reach as far.
        let options = Options { max_range_m: None, ..*assumed.options };
        let simulator = Simulator::new(
            Arc::new(scene.with_robot_at(assumed.pose)),
            assumed.sensor.clone(),
            air,
            options,
        )
        .map_err(|error| Failure::input(error, "see `sonard mock --help`"))?;
        let steps = self.steps_per_revolution;
        Soundings::of(&simulator, assumed.pose, steps, self.mounting_offset_deg)
            .map_err(|error| Failure::input(error, "give a simpler scene"))
    }

    /// Motor steps a revolution.
    pub(super) const fn steps_per_revolution(&self) -> u16 {
        self.steps_per_revolution
    }

    /// The same world for `sonard-emulator`, as far as it has one.
    pub(super) fn emulator(&self, scene: &Path) -> Result<Vec<String>, Failure> {
        let scene = self.truth.as_deref().unwrap_or(scene);
        let scene = scene.to_str().ok_or_else(|| {
            let help = "rename it: the emulator takes its options as text";
            Failure::input(format!("the path {} is not UTF-8", scene.display()), help)
        })?;
        let refuse = |option: &str, instead: &str| {
            Err(Failure::input(format!("the emulator has no {option}"), instead))
        };
        if self.faults.is_some() {
            return refuse(
                "--faults",
                "they are the mock's; a supply that sags is `sonard-emulator --dips`",
            );
        }
        if self.missed_steps > 0.0 {
            return refuse(
                "--missed-steps",
                "its motor misses steps when --speed or --acceleration ask too much of it",
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

    fn truth_air(&self, believed: &Air) -> Result<Air, Failure> {
        let Some(temperature_c) = self.truth_temperature_c else { return Ok(*believed) };
        Air::new(temperature_c, believed.humidity_percent(), believed.pressure_kpa())
            .map_err(|error| Failure::input(error, "give --truth-temperature-c in degrees Celsius"))
    }
}

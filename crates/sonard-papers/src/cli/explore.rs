//! Command `sonard-papers explore` and its output files.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
    sync::Arc,
};

use indicatif::ProgressBar;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use serde::Serialize;

use sonard_interpret::interpret::lines::{MapError, map_error};
use sonard_model::{
    geometry::Pose,
    model::{Options, Simulator},
    scene::Scene,
};
use sonard_papers::{
    explore::{
        Exploration, ExploreSettings, RobotSettings, Sensing, SimulatedRobot, SonarLayout, Stop,
        explore_observed,
    },
    pictures::draw_exploration,
};
use sonard_plot::{PlotError, animate};

use super::{
    Failure, Outcome,
    answer::print_result,
    input::{AcousticArgs, PlaceArgs},
    output::{Overwrite, line_record, make_folder},
    progress,
};

/// Options of `sonard-papers explore`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    place: PlaceArgs,
    /// Sensors that the robot maps with
    #[arg(long, value_enum, default_value_t = SensingName::JustInTime)]
    sensing: SensingName,
    #[command(flatten)]
    robot: RobotArgs,
    /// Random seed; noise of ranges, laser and odometry
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Output folder for the map, the laser scans, the stops and pictures
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// JSON instead of text; one object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    acoustics: AcousticArgs,
}

/// Robot and exploration strategy.
#[derive(Debug, Clone, Copy, clap::Args)]
#[command(next_help_heading = "Robot")]
pub(crate) struct RobotArgs {
    /// Arrangement of the sonars
    #[arg(long, value_enum, default_value_t = RangerName::Ring)]
    ranger: RangerName,
    /// Standard deviation of each drive's distance and turn, relative to them
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    odometry_noise: f64,
    /// Distance from the followed object, metres
    #[arg(long, value_name = "M", default_value_t = ExploreSettings::default().standoff_m)]
    standoff: f64,
    /// Discard sonar readings beyond this "logical" distance, metres
    #[arg(long, value_name = "M", default_value_t = ExploreSettings::default().map.logical_m)]
    logical: f64,
    /// Maximum range of the sonars, metres
    #[arg(long, value_name = "M", default_value_t = 8.0)]
    pub(crate) sonar_range: f64,
    /// Maximum number of stops
    #[arg(long, value_name = "N", default_value_t = ExploreSettings::default().max_stops)]
    max_stops: usize,
}

/// [`Sensing`] as a command-line value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum SensingName {
    /// Sonar only
    Sonar,
    /// Laser only: a full turn at each stop
    Laser,
    /// Sonar, and one laser shot at each line end
    JustInTime,
}

/// [`SonarLayout`] as a command-line value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum RangerName {
    /// Twelve sonars, rotated in place for 180 readings
    Ring,
    /// Single ranger on a stepper, 400 readings
    Stepper,
}

pub(crate) const ABOUT: &str = "\
Explore a scene with a simulated robot and map it with lines.

After G. Dudek, P. Freedman and I. Rekleitis, \"Just-in-time sensing\" (ICRA 1996): the robot follows the \
nearest object at about a metre and continues with the next in the order of discovery. Sonar, simulated by the \
model, detects walls; where it is ambiguous, at corners and ends of walls, a laser with a field of view of 25 \
degrees is aimed at the end of the line and confirms it. The robot uses its measurements only, and obstacles stop \
it.";

const HELP: &str = "\
Examples:
  sonard-papers explore --scene two-surface-room --pose middle --out explored
  sonard-papers explore --scene mcgill-lab --pose fig4 --sensing sonar --json
  sonard-papers explore --scene my-room.json --pose 1,1,0 --odometry-noise 0.005

--out receives lines.jsonl (as `sonard lines --json`), laser.jsonl (one shot or turn per line, for `sonard \
lines --laser`), stops.jsonl, exploration.svg and .png, stage-1.png to stage-4.png and exploration.apng, \
an animation that browsers play.

Map errors, in metres, with each distance limited to 0.5: the line error is the mean of the distances \
of the map's lines from walls and of walls from the map's lines (both averaged along their length); the \
endpoint error is the mean of the distances of line ends from wall ends and of wall ends from line ends; \
the map error is the mean of the two.
Exit codes: 0 done, 1 stopped before everything was explored, 2 wrong usage or input, 3 write \
error.";

pub(crate) fn run(args: &Args) -> Outcome {
    let (scene, pose) = args.place.load()?;
    if let Some(folder) = &args.out {
        check_all(folder, args.overwrite)?;
    }
    let sensing = args.sensing.sensing();
    let (robot, settings) = args.robot.settings()?;
    let options = Options { max_range_m: Some(args.robot.sonar_range), ..Options::default() };
    let simulator =
        Simulator::new(Arc::new(scene), args.acoustics.sensor()?, args.acoustics.air()?, options)
            .map_err(|error| Failure::input(error, "see `sonard-papers explore --help`"))?;
    let bar = progress::spinner("stops");
    let made = explored((&simulator, pose), sensing, robot, &settings, args.seed, &bar);
    bar.finish_and_clear();
    let made = made?;
    let scene = simulator.scene();
    let summary = Summary::from_exploration(scene, sensing, &made);
    if let Some(folder) = &args.out {
        write_all((folder, args.overwrite), &made, sensing, scene)?;
    }
    print_result(args.json, [&summary], |out| summary.print(out))?;
    if made.finished {
        return Ok(());
    }
    Err(Failure::Found(format!(
        "the exploration is incomplete after {} stops: see --max-stops",
        made.stops.len()
    )))
}

/// Explores from a pose with progress in `bar`. The result is reproducible for a seed.
pub(crate) fn explored(
    (simulator, pose): (&Simulator, Pose),
    sensing: Sensing,
    robot: RobotSettings,
    settings: &ExploreSettings,
    seed: u64,
    bar: &ProgressBar,
) -> Result<Exploration, Failure> {
    let free_m = simulator.scene().clearance_m(pose.position());
    if free_m <= robot.radius_m {
        return Err(Failure::input(
            format!("the robot's body of {} m radius does not fit at the pose", robot.radius_m),
            format!("the nearest obstacle is at {free_m:.3} m: give a pose farther from it"),
        ));
    }
    let rng = Pcg64::seed_from_u64(seed);
    let mut robot = SimulatedRobot::new(simulator, pose, robot, rng);
    let made = explore_observed(&mut robot, sensing, settings, |so_far| {
        bar.set_position(so_far.stops.len() as u64);
        bar.set_message(format!("{:.0} m driven", so_far.travel_m));
    });
    match robot.error() {
        Some(error) => Err(Failure::input(error, "see `sonard-papers explore --help`")),
        None => Ok(made),
    }
}

impl SensingName {
    pub(crate) const fn sensing(self) -> Sensing {
        match self {
            Self::Sonar => Sensing::Sonar,
            Self::Laser => Sensing::Laser,
            Self::JustInTime => Sensing::JustInTime,
        }
    }
}

impl RangerName {
    pub(crate) const fn layout(self) -> SonarLayout {
        match self {
            Self::Ring => SonarLayout::Ring,
            Self::Stepper => SonarLayout::Stepper,
        }
    }
}

impl RobotArgs {
    /// Validated settings of robot and exploration.
    pub(crate) fn settings(&self) -> Result<(RobotSettings, ExploreSettings), Failure> {
        let checks = [
            ("odometry-noise", self.odometry_noise, 0.0, 1.0),
            ("standoff", self.standoff, 0.4, 3.0),
            ("logical", self.logical, 0.5, 20.0),
        ];
        for (option, value, min, max) in checks {
            if !(min..=max).contains(&value) {
                let help = format!("give a number from {min} to {max}");
                return Err(Failure::input(format!("--{option} is {value}"), help));
            }
        }
        let robot = RobotSettings {
            ranger: self.ranger.layout(),
            odometry_noise: self.odometry_noise,
            ..RobotSettings::default()
        };
        let mut settings = ExploreSettings {
            standoff_m: self.standoff,
            max_stops: self.max_stops.max(1),
            ..ExploreSettings::default()
        };
        settings.map.logical_m = self.logical;
        Ok((robot, settings))
    }
}

/// Printed result of an exploration.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    pub(crate) scene: String,
    pub(crate) sensing: Sensing,
    pub(crate) finished: bool,
    pub(crate) stops: usize,
    pub(crate) laser_shots: u32,
    pub(crate) sonar_readings: usize,
    pub(crate) travel_m: f64,
    pub(crate) collisions: u32,
    pub(crate) lines: usize,
    #[serde(flatten)]
    pub(crate) error: MapError,
}

impl Summary {
    pub(crate) fn from_exploration(scene: &Scene, sensing: Sensing, made: &Exploration) -> Self {
        Self {
            scene: scene.name.clone(),
            sensing,
            finished: made.finished,
            stops: made.stops.len(),
            laser_shots: made.laser_shots,
            sonar_readings: made.sonar_readings,
            travel_m: made.travel_m,
            collisions: made.collisions,
            lines: made.lines().len(),
            error: map_error(made.lines(), scene),
        }
    }

    fn print(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(
            out,
            "{}: {} stops, {:.1} m, {} laser shots, {} sonar readings, {} collisions",
            self.sensing.name(),
            self.stops,
            self.travel_m,
            self.laser_shots,
            self.sonar_readings,
            self.collisions
        )?;
        writeln!(
            out,
            "{} lines; line error {:.1} mm, endpoint error {:.1} mm, map error {:.1} mm",
            self.lines,
            1e3 * self.error.line_error_m,
            1e3 * self.error.endpoint_error_m,
            1e3 * self.error.map_error_m
        )
    }
}

/// Number of pictures of intermediate maps.
const STAGES: usize = 4;
/// Maximum number of frames in the animation; longer explorations skip stops.
const MAX_FRAMES: usize = 120;
const FRAME_MS: u16 = 150;
const FRAME_PX: u32 = 700;

/// Output files of an exploration except its stages.
const FILES: [&str; 6] = [
    "lines.jsonl",
    "laser.jsonl",
    "stops.jsonl",
    "exploration.svg",
    "exploration.png",
    "exploration.apng",
];

/// Checks all output files of an exploration in a folder.
fn check_all(folder: &Path, overwrite: Overwrite) -> Outcome {
    FILES.iter().try_for_each(|name| overwrite.check(&folder.join(name)))
}

/// Writes map, stops and pictures into a folder.
pub(crate) fn write_all(
    (folder, overwrite): (&Path, Overwrite),
    made: &Exploration,
    sensing: Sensing,
    scene: &Scene,
) -> Outcome {
    make_folder(folder)?;
    let save = |name: &str, bytes: &[u8]| overwrite.save(&folder.join(name), bytes);
    let reject = |error: PlotError| Failure::input(error, "this scene can't be drawn");
    save("lines.jsonl", &json_lines(made.lines().iter().map(line_record)))?;
    let laser = made.stops.iter().flat_map(|stop| &stop.laser).map(serde_json::to_value);
    save("laser.jsonl", &json_lines(laser.filter_map(Result::ok)))?;
    save("stops.jsonl", &json_lines(made.stops.iter().map(stop_record)))?;
    let count = made.stops.len();
    let draw = |stops: usize| draw_exploration(made, stops, sensing, Some(scene));
    save("exploration.svg", draw(count).to_svg().as_bytes())?;
    save("exploration.png", &draw(count).to_png(1000).map_err(reject)?)?;
    for stage in 1..=STAGES {
        let png = draw((count * stage).div_ceil(STAGES)).to_png(1000).map_err(reject)?;
        save(&format!("stage-{stage}.png"), &png)?;
    }
    let every = count.div_ceil(MAX_FRAMES);
    let frame_stops: Vec<usize> =
        (1..=count).filter(|stop| (count - stop).is_multiple_of(every)).collect();
    let bar = progress::bar(frame_stops.len() as u64, "frames");
    let frames = frame_stops.iter().map(|stops| draw(*stops)).inspect(|_| bar.inc(1));
    let animation = animate(frames, FRAME_PX, FRAME_MS).map_err(reject)?;
    bar.finish_and_clear();
    save("exploration.apng", &animation)
}

fn json_lines(records: impl Iterator<Item = serde_json::Value>) -> Vec<u8> {
    records.flat_map(|record| format!("{record}\n").into_bytes()).collect()
}

fn stop_record(stop: &Stop) -> serde_json::Value {
    serde_json::json!({
        "pose": stop.pose, "task": stop.task, "target_m": stop.target.map(|at| at.to_array()),
        "laser_shots": stop.laser.len(), "lines": stop.lines.len(),
    })
}

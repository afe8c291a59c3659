//! `sonard simulate`.

mod array;

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::Arc,
};

use indicatif::ProgressBar;
use jiff::Timestamp;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use uuid::Uuid;

use super::{
    Failure, Outcome,
    array::load_course,
    options::{AirArgs, EngineArgs, SensorArgs},
    place::AzimuthArgs,
    progress, scene_file,
};
use crate::{
    acoustics::ReceiverNoise,
    geometry::Pose,
    model::{Prediction, Simulator, Station},
    scan::{Ping, Record, ScanEnd, ScanPlan, ScanStart, Session},
    scene::Scene,
};

use array::ArrayArgs;

/// Options of `sonard simulate`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file, or the name of a shipped scene (`sonard scene list`)
    #[arg(long, value_name = "SCENE")]
    scene: String,
    /// Where the ranger stands: X,Y,DEG (metres, degrees) or the name of a pose in the scene
    #[arg(
        long,
        value_name = "POSE",
        allow_hyphen_values = true,
        required_unless_present = "poses"
    )]
    pose: Option<String>,
    /// Poses one after the other, a scan at each: a file with one a line, as {"x_m": 1.0,
    /// "y_m": 2.0, "heading_deg": 90.0}
    #[arg(long, value_name = "FILE", conflicts_with = "pose")]
    poses: Option<PathBuf>,
    #[command(flatten)]
    array: ArrayArgs,
    #[command(flatten)]
    azimuths: AzimuthArgs,
    /// Write the records to this file instead of standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    air: AirArgs,
}

/// What disturbs the readings.
#[derive(Debug, Clone, Copy, clap::Args)]
#[command(next_help_heading = "Noise")]
struct NoiseArgs {
    /// Noise at the receiver's input, root mean square, as the amplitude of an echo from 1 m
    #[arg(long, value_name = "A", default_value_t = 0.0)]
    noise_floor: f64,
    /// Standard deviation of the time of flight beside what the noise does to it, microseconds
    #[arg(long, value_name = "US", default_value_t = 0.0)]
    jitter_us: f64,
    /// Seed of the noise: the same one gives the same readings
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

impl NoiseArgs {
    /// The noise asked for, if any.
    fn noise(&self) -> Result<Option<ReceiverNoise>, Failure> {
        for (option, value, most) in
            [("noise-floor", self.noise_floor, 1.0), ("jitter-us", self.jitter_us, 1e4)]
        {
            if !(0.0..=most).contains(&value) {
                let help = format!("give a number from 0 to {most}");
                return Err(Failure::input(format!("--{option} is {value}"), help));
            }
        }
        let noise = ReceiverNoise { floor: self.noise_floor, jitter_us: self.jitter_us };
        Ok(Some(noise).filter(|noise| *noise != ReceiverNoise::NONE))
    }
}

pub(super) const ABOUT: &str = "\
Predict a scan with the model alone.

Writes the records of a log, one JSON object a line, with provenance `simulated`: each reading \
carries the path its sound took, its amplitude and its margin over the threshold. A silence \
carries the candidate that came closest, with a negative margin.

With --array, several rangers at fixed bearings on a robot fire in turn, each from its own place. \
Their readings say which ranger (`ranger`) and, where the robot turned or moved within a scan, \
where it stood (`pose`). Crosstalk, one ranger's sound in another's ear, is left out.";

const EXAMPLES: &str = "\
Examples:
  sonard simulate --scene simple-room --pose fig9 --out fig9.jsonl
  sonard simulate --scene simple-room --pose fig9 --from-deg 270 --to-deg 270.9 | tail -n 2
  sonard simulate --scene corridor --pose 1,0.4,0 --engine cone --max-range 4 | sonard plot -
  sonard simulate --scene my-room.json --pose 1.2,0.8,90 --temperature-c 5 --lossless
  sonard simulate --scene two-surface-room --pose 1.2,1,30 --array pioneer-8 | sonard plot - -o a.svg
  sonard simulate --scene mcgill-lab --poses way.jsonl --out course.jsonl
  sonard simulate --scene corridor --poses way.jsonl --array ring-12 --rounds 15 > ring.jsonl

Exit codes: 0 done, 2 wrong usage or input, 3 a disk that gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    if let Some(name) = &args.array.array {
        return array::run(args, name);
    }
    let scene = scene_file::load(&args.scene)?;
    let poses = poses(args, &scene)?;
    for (number, pose) in (1..).zip(&poses) {
        scene.check_pose(pose).map_err(|error| refuse_pose(args, number, &error, error.help()))?;
    }
    let plan = args.azimuths.plan(1)?;
    // A robot's body stands among the reflectors, so that each pose has its own.
    let shared = match scene.robot {
        Some(_) => None,
        None => Some(simulator(args, &scene, &poses[0])?),
    };
    let noise = args.noise.noise()?;
    let (what, mut out) = open(args.out.as_deref())?;
    let mut rng = Pcg64::seed_from_u64(args.noise.seed);
    let mut ping = |station: &Station, direction_rad| match &noise {
        Some(noise) => station.ping_in_noise(direction_rad, noise, &mut rng),
        None => station.ping(direction_rad),
    };
    let bar = progress::bar(u64::from(plan.stops()) * poses.len() as u64, "beams");
    for (number, pose) in poses.iter().enumerate() {
        let own = match shared {
            Some(_) => None,
            None => Some(simulator(args, &scene, pose)?),
        };
        let Some(simulator) = shared.as_ref().or(own.as_ref()) else { break };
        let session = (number == 0 || own.is_some()).then_some(simulator);
        let written = session.map_or(Ok(()), |simulator| write_session(&mut out, simulator));
        if let Err(error) =
            written.and_then(|()| write(&mut out, simulator, pose, &plan, &mut ping, &bar))
        {
            bar.finish_and_clear();
            return Failure::from_write(&what, &error);
        }
    }
    bar.finish_and_clear();
    out.flush().or_else(|error| Failure::from_write(&what, &error))
}

/// The pose asked for, or those of a file.
fn poses(args: &Args, scene: &Scene) -> Result<Vec<Pose>, Failure> {
    if let Some(file) = &args.poses {
        return Ok(load_course(file)?.poses().to_vec());
    }
    let pose = scene.pose(args.pose.as_deref().unwrap_or_default());
    Ok(vec![pose.map_err(|error| Failure::input(&error, error.help()))?])
}

/// Names the pose by its number in the file, if it is from one.
fn refuse_pose(
    args: &Args,
    number: usize,
    error: &dyn std::fmt::Display,
    help: impl std::fmt::Display,
) -> Failure {
    let which = args.poses.as_ref().map(|file| format!("{}: pose {number}: ", file.display()));
    Failure::input(format!("{}{error}", which.unwrap_or_default()), help)
}

/// Where the records go, and its name.
fn open(path: Option<&Path>) -> Result<(String, Box<dyn Write>), Failure> {
    let Some(path) = path else {
        return Ok(("to standard output".into(), Box::new(BufWriter::new(io::stdout().lock()))));
    };
    let file = File::create(path).map_err(|error| {
        Failure::input(
            format!("cannot write {}: {error}", path.display()),
            "give a file in a folder that exists and that you may write to",
        )
    })?;
    Ok((path.display().to_string(), Box::new(BufWriter::new(file))))
}

fn simulator(args: &Args, scene: &Scene, pose: &Pose) -> Result<Simulator, Failure> {
    let (sensor, air) = (args.sensor.sensor()?, args.air.air()?);
    let options = args.engine.options()?;
    Simulator::new(Arc::new(scene.with_robot_at(pose)), sensor, air, options)
        .map_err(|error| Failure::input(error, "see `sonard simulate --help`"))
}

fn write_session(out: &mut dyn Write, simulator: &Simulator) -> io::Result<()> {
    put(out, &Record::Session(Box::new(Session::simulated(simulator, Timestamp::now()))))
}

fn write(
    out: &mut dyn Write,
    simulator: &Simulator,
    pose: &Pose,
    plan: &ScanPlan,
    predict: &mut dyn FnMut(&Station, f64) -> Prediction,
    bar: &ProgressBar,
) -> io::Result<()> {
    let scan = Uuid::new_v4();
    let start = ScanStart {
        scan,
        time: Timestamp::now(),
        pose: *pose,
        plan: *plan,
        air: None,
        provenance: None,
        request: None,
    };
    put(out, &Record::ScanStart(start))?;
    let station = simulator.station(pose.position());
    for index in 0..plan.stops() {
        let azimuth_deg = plan.azimuth_deg(index);
        let prediction = predict(&station, pose.direction_rad(azimuth_deg));
        let ping = Ping::simulated(simulator, scan, index, azimuth_deg, &prediction);
        put(out, &Record::Ping(Box::new(ping)))?;
        bar.inc(1);
    }
    let end = ScanEnd::simulated(simulator, scan, plan.stops(), Timestamp::now());
    put(out, &Record::ScanEnd(end))
}

/// Writes a record as one line.
fn put(out: &mut dyn Write, record: &Record) -> io::Result<()> {
    serde_json::to_writer(&mut *out, record)?;
    out.write_all(b"\n")
}

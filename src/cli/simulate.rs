//! `sonard simulate`.

mod array;
mod summary;

use std::{
    fs,
    io::{self, IsTerminal as _},
    path::PathBuf,
    sync::Arc,
};

use indicatif::ProgressBar;
use jiff::Timestamp;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use uuid::Uuid;

use super::{
    Failure, Outcome,
    options::{AirArgs, SensorArgs, engine_options},
    output::{OutPath, Overwrite, closed, records_to},
    place::AzimuthArgs,
    progress, scene_file,
};
use crate::{
    acoustics::ReceiverNoise,
    geometry::Pose,
    import::poses::{PoseLine, parse_pose_lines},
    model::{ModelError, ObservationPoint, OptionKeys, Prediction, Simulator, TooCostly},
    scan::{Ping, Record, ScanEnd, ScanPlan, ScanStart, Session},
    scene::Scene,
    store::{RecordWriter, StoreError},
};

use array::ArrayArgs;
use summary::Summaries;

/// Options of `sonard simulate`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file, or the name of a shipped scene (`sonard scene list`); used for predictions
    #[arg(long, value_name = "SCENE")]
    scene: PathBuf,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene
    #[arg(
        long,
        value_name = "POSE",
        allow_hyphen_values = true,
        required_unless_present = "poses"
    )]
    pose: Option<String>,
    /// Poses, one scan at each: a CSV file with columns x_m,y_m,heading_deg, or a JSON lines file
    /// of {"x_m": 1.0, "y_m": 2.0, "heading_deg": 90.0}
    #[arg(long, value_name = "FILE", conflicts_with = "pose")]
    poses: Option<PathBuf>,
    #[command(flatten)]
    array: ArrayArgs,
    #[command(flatten)]
    azimuths: AzimuthArgs,
    /// File to write; the records go to it instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// JSON instead of text; the records of a log, also on a terminal
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    noise: NoiseArgs,
    #[command(flatten)]
    engine: OptionKeys,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    air: AirArgs,
}

#[derive(Debug, Clone, Copy, clap::Args)]
#[command(next_help_heading = "Noise")]
struct NoiseArgs {
    /// Receiver noise, root mean square, relative to the amplitude of an echo from 1 m
    #[arg(long, value_name = "A", default_value_t = 0.0)]
    noise_floor: f64,
    /// Additional timing jitter, standard deviation of the time of flight, microseconds
    #[arg(long, value_name = "US", default_value_t = 0.0)]
    jitter_us: f64,
    /// Random seed; the same seed gives the same readings
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

impl NoiseArgs {
    /// Returns the configured noise; `None` without any.
    fn noise(&self) -> Result<Option<ReceiverNoise>, Failure> {
        for (option, value, max) in
            [("noise-floor", self.noise_floor, 1.0), ("jitter-us", self.jitter_us, 1e4)]
        {
            if !(0.0..=max).contains(&value) {
                let help = format!("give a number from 0 to {max}");
                return Err(Failure::input(format!("--{option} is {value}"), help));
            }
        }
        let noise = ReceiverNoise { floor: self.noise_floor, jitter_us: self.jitter_us };
        Ok(Some(noise).filter(|noise| *noise != ReceiverNoise::NONE))
    }
}

pub(super) const ABOUT: &str = "\
Predict a scan with the model alone.

Writes the records of a log, one JSON object per line, with provenance `simulated`; on a terminal, \
a summary of each scan unless --json is given. Each reading \
has its propagation path, amplitude and level above threshold. A reading without an echo has the \
strongest arrival relative to the threshold, with a negative level.

With --array, several rangers at fixed bearings on a robot fire in turn, each from its own \
position. Their readings contain the ranger (`ranger`) and, if the robot rotated or moved within a \
scan, its pose (`pose`). azimuth_deg counts counter-clockwise from the heading; the directions of \
`sonard paths` are in world coordinates. If rangers fire simultaneously, or before the sound of an \
earlier ping has decayed, their readings include crosstalk, with its source (`crosstalk`).";

const EXAMPLES: &str = "\
Examples:
  sonard simulate --scene simple-room --pose fig9 -o fig9.jsonl
  sonard simulate --scene simple-room --pose fig9 --from-deg 270 --to-deg 270.9 | tail -n 2
  sonard simulate --scene corridor --pose 1,0.4,0 --engine cone --max-range 4 | sonard plot -
  sonard simulate --scene my-room.json --pose 1.2,0.8,90 --temperature-c 5 --lossless
  sonard simulate --scene two-surface-room --pose 1.2,1,30 --array pioneer-8 | sonard plot - -o a.svg
  sonard simulate --scene mcgill-lab --poses trajectory.csv -o trajectory.jsonl
  sonard simulate --scene corridor --poses trajectory.jsonl --array ring-12 --rounds 15 > ring.jsonl

Exit codes: 0 done, 1 poses of the file were skipped because they are not free or their line is invalid, \
2 wrong usage or input, 3 write error.";

pub(super) fn run(args: &Args) -> Outcome {
    if let Some(name) = &args.array.array {
        return array::run(args, name);
    }
    let scene = scene_file::load(&args.scene)?;
    let SimulatedPoses { poses, skipped } = simulated_poses(args, &scene, |pose| {
        scene.check_pose(pose).map_err(|error| (error.to_string(), error.help()))
    })?;
    let plan = args.azimuths.plan(1)?;
    // A robot's body is one of the reflectors, so each pose needs its own scene.
    let shared = match scene.robot {
        Some(_) => None,
        None => Some(simulator(args, &scene, &poses[0])?),
    };
    let noise = args.noise.noise()?;
    let mut out = records_for(args)?;
    let mut rng = Pcg64::seed_from_u64(args.noise.seed);
    let mut ping = |point: &ObservationPoint, direction_rad| match &noise {
        Some(noise) => point.ping_in_noise(direction_rad, noise, &mut rng),
        None => point.ping(direction_rad),
    };
    let bar = progress::bar(u64::from(plan.stops()) * poses.len() as u64, "beams");
    let mut written: Result<(), SimulationFailure> = Ok(());
    for (number, pose) in poses.iter().enumerate() {
        let own = match shared {
            Some(_) => None,
            None => Some(simulator(args, &scene, pose)?),
        };
        let Some(simulator) = shared.as_ref().or(own.as_ref()) else { break };
        let session = (number == 0 || own.is_some()).then_some(simulator);
        written = session
            .map_or(Ok(()), |simulator| write_session(&mut *out, simulator))
            .map_err(SimulationFailure::from)
            .and_then(|()| write(&mut *out, simulator, pose, &plan, &mut ping, &bar));
        if written.is_err() {
            break;
        }
    }
    bar.finish_and_clear();
    match written {
        Ok(()) => closed(out.finish())?,
        Err(SimulationFailure::Model(error)) => {
            return Err(Failure::input(error, "see `sonard simulate --help`"));
        }
        Err(SimulationFailure::Write(error)) => closed(Err(error))?,
    }
    skipped
}

/// Returns the output of the records: a file, standard output, or a summary on a terminal.
fn records_for(args: &Args) -> Result<Box<dyn RecordWriter>, Failure> {
    if args.output.is_none() && !args.json && io::stdout().is_terminal() {
        return Ok(Box::new(Summaries::default()));
    }
    records_to(args.output.as_deref(), args.overwrite)
}

/// Reason for an early end.
enum SimulationFailure {
    Model(ModelError),
    Write(StoreError),
}

impl From<StoreError> for SimulationFailure {
    fn from(error: StoreError) -> Self {
        Self::Write(error)
    }
}

impl From<TooCostly> for SimulationFailure {
    fn from(error: TooCostly) -> Self {
        Self::Model(error.into())
    }
}

/// Poses at which scans are simulated.
struct SimulatedPoses {
    poses: Vec<Pose>,
    /// Outcome of the verb: a failure if poses of the file were skipped.
    skipped: Outcome,
}

/// Maximum number of reported invalid lines; further ones are counted.
const MAX_LISTED_LINES: usize = 20;

/// Returns the given pose, or the valid ones of a file; reports the others.
fn simulated_poses(
    args: &Args,
    scene: &Scene,
    check: impl Fn(&Pose) -> Result<(), (String, String)>,
) -> Result<SimulatedPoses, Failure> {
    let Some(file) = &args.poses else {
        let pose = scene.pose(args.pose.as_deref().unwrap_or_default());
        let pose = pose.map_err(|error| Failure::input(&error, error.help()))?;
        check(&pose).map_err(|(message, help)| Failure::input(message, help))?;
        return Ok(SimulatedPoses { poses: vec![pose], skipped: Ok(()) });
    };
    let name = file.display();
    let text = fs::read_to_string(file).map_err(|error| {
        let help = "give a CSV or JSON lines file of poses";
        Failure::input(format!("cannot read the poses {name}: {error}"), help)
    })?;
    let lines = parse_pose_lines(&text, scene, Some(0.0)).map_err(|fault| {
        let line = fault.line.map_or_else(String::new, |line| format!("{line}:"));
        Failure::input(format!("{name}:{line} {fault}"), &fault.help)
    })?;
    let (all, mut poses, mut invalid) = (lines.len(), Vec::new(), Vec::new());
    for PoseLine { line, pose } in lines {
        let checked = pose
            .map_err(|fault| (fault.message, fault.help))
            .and_then(|pose| check(&pose.pose).map(|()| pose.pose));
        match checked {
            Ok(pose) => poses.push(pose),
            Err((message, help)) => invalid.push((format!("{name}:{line}: {message}"), help)),
        }
    }
    if poses.is_empty() {
        let (message, help) = invalid.into_iter().next().unwrap_or_default();
        return Err(Failure::input(format!("{message} (and no other pose is valid)"), help));
    }
    for (message, help) in invalid.iter().take(MAX_LISTED_LINES) {
        notice!("{message}: skipped; {help}");
    }
    let skipped = match invalid.len() {
        0 => Ok(()),
        count => {
            Err(Failure::Found(Some(format!("{count} of {all} poses of {name} were skipped"))))
        }
    };
    Ok(SimulatedPoses { poses, skipped })
}

fn simulator(args: &Args, scene: &Scene, pose: &Pose) -> Result<Simulator, Failure> {
    let (sensor, air) = (args.sensor.sensor()?, args.air.air()?);
    let options = engine_options(&args.engine)?;
    Simulator::new(Arc::new(scene.with_robot_at(pose)), sensor, air, options)
        .map_err(|error| Failure::input(error, "see `sonard simulate --help`"))
}

fn write_session(out: &mut dyn RecordWriter, simulator: &Simulator) -> Result<(), StoreError> {
    out.write(&Record::Session(Box::new(Session::simulated(simulator, Timestamp::now()))))
}

fn write(
    out: &mut dyn RecordWriter,
    simulator: &Simulator,
    pose: &Pose,
    plan: &ScanPlan,
    predict: &mut dyn FnMut(&ObservationPoint, f64) -> Result<Prediction, TooCostly>,
    bar: &ProgressBar,
) -> Result<(), SimulationFailure> {
    let scan = Uuid::new_v4();
    let start = ScanStart::new(scan, Timestamp::now(), *pose, *plan);
    out.write(&Record::ScanStart(start))?;
    let point = simulator.at(pose.position());
    for index in 0..plan.stops() {
        let azimuth_deg = plan.azimuth_deg(index);
        let prediction = predict(&point, pose.direction_rad(azimuth_deg))?;
        let ping = Ping::simulated(simulator, scan, index, azimuth_deg, &prediction);
        out.write(&Record::Ping(Box::new(ping)))?;
        bar.inc(1);
    }
    let end = ScanEnd::simulated(simulator, scan, plan.stops(), Timestamp::now());
    Ok(out.write(&Record::ScanEnd(end))?)
}

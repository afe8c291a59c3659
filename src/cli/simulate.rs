//! `sonard simulate`.

mod array;

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use jiff::Timestamp;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use uuid::Uuid;

use super::{
    Failure, Outcome,
    options::{AirArgs, EngineArgs, SensorArgs},
    place::AzimuthArgs,
    scene_file,
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
  sonard simulate --scene corridor --poses way.jsonl --array ring-12 --rounds 15 > ring.jsonl

Exit codes: 0 done, 2 wrong usage or input, 3 a disk that gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    if let Some(name) = &args.array.array {
        return array::run(args, name);
    }
    let scene = scene_file::load(&args.scene)?;
    let pose = scene_file::pose(&scene, args.pose.as_deref().unwrap_or_default())?;
    let plan = args.azimuths.plan(1)?;
    let simulator = simulator(args, &scene, &pose)?;
    let noise = args.noise.noise()?;
    let (what, mut out) = open(args.out.as_deref())?;
    let mut rng = Pcg64::seed_from_u64(args.noise.seed);
    let mut ping = |station: &Station, direction_rad| match &noise {
        Some(noise) => station.ping_in_noise(direction_rad, noise, &mut rng),
        None => station.ping(direction_rad),
    };
    write(&mut out, &simulator, &pose, &plan, &mut ping)
        .or_else(|error| Failure::from_write(&what, &error))
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

/// The simulator for this pose: a robot's body stands among the reflectors.
fn simulator(args: &Args, scene: &Scene, pose: &Pose) -> Result<Simulator, Failure> {
    let (sensor, air) = (args.sensor.sensor()?, args.air.air()?);
    let options = args.engine.options()?;
    Simulator::new(Arc::new(scene.with_robot_at(pose)), sensor, air, options)
        .map_err(|error| Failure::input(error, "see `sonard simulate --help`"))
}

fn write(
    out: &mut dyn Write,
    simulator: &Simulator,
    pose: &Pose,
    plan: &ScanPlan,
    predict: &mut dyn FnMut(&Station, f64) -> Prediction,
) -> io::Result<()> {
    let scan = Uuid::new_v4();
    let mut put = |record: &Record| {
        serde_json::to_writer(&mut *out, record)?;
        out.write_all(b"\n")
    };
    put(&Record::Session(Box::new(Session::simulated(simulator, Timestamp::now()))))?;
    put(&Record::ScanStart(ScanStart {
        scan,
        time: Timestamp::now(),
        pose: *pose,
        plan: *plan,
        air: None,
        provenance: None,
        request: None,
    }))?;
    let progress = progress(plan.stops().into());
    let station = simulator.station(pose.position());
    for index in 0..plan.stops() {
        let azimuth_deg = plan.azimuth_deg(index);
        let prediction = predict(&station, pose.direction_rad(azimuth_deg));
        let ping = Ping::simulated(simulator, scan, index, azimuth_deg, &prediction);
        put(&Record::Ping(Box::new(ping)))?;
        progress.inc(1);
    }
    progress.finish_and_clear();
    let end = ScanEnd::simulated(simulator, scan, plan.stops(), Timestamp::now());
    put(&Record::ScanEnd(end))?;
    out.flush()
}

/// A bar on the terminal, drawn from the first second on.
fn progress(beams: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} beams, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    // Draw calls come a few times a second; the first second is left without any.
    let bar =
        ProgressBar::with_draw_target(Some(beams), ProgressDrawTarget::hidden()).with_style(style);
    let shown = bar.clone();
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(1));
        if !shown.is_finished() {
            shown.set_draw_target(ProgressDrawTarget::stderr());
        }
    });
    bar
}

//! Fixed workloads whose instructions `cargo xtask instructions` counts.
//!
//! `instructions --list` prints their names; `instructions NAME` runs one and prints a digest of its
//! result, so that nothing is optimized away. Counters collect within [`measured_workload`] only.

use std::{hint::black_box, process::ExitCode, sync::Arc};

use firmware_protocol::{
    frame::{Frame, FrameDecoder, Received},
    messages::Reply,
};
use jiff::Timestamp;
use sonard_benches::{HEADER, reading};
use sonard_interpret::interpret::{Extents, InterpretSettings, Sweep, interpret};
use sonard_inverse::{
    ErrorModel, FiringOutcome, FitSweep, Hypotheses, Parameter, SweepFiring, World,
};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::{Options, Simulator},
    reading::PingStatus,
    scene::{Scene, shipped},
};
use sonard_records::{ScanPlan, ScanView, decode_line, encode_line};
use uuid::Uuid;

type Failure = Box<dyn std::error::Error>;
/// Name of a workload and its function, which returns a digest.
type Workload = (&'static str, fn() -> Result<f64, Failure>);

const WORKLOADS: [Workload; 6] = [
    ("scan-simple-room", || predict_scan("simple-room", "fig9", 4.0)),
    ("scan-mcgill-lab", || predict_scan("mcgill-lab", "fig4", 5.0)),
    ("hypothesis-simple-room", evaluate_hypothesis),
    ("interpretation", interpret_scan),
    ("records", convert_records),
    ("frames", decode_frames),
];

/// Error model of fits of simulated readings.
const ERRORS: ErrorModel = ErrorModel {
    sigma_m: 1e-3,
    tail_weight: 0.1,
    tail_ratio: 2.0,
    sigma_db: 0.5,
    sigma_db_per_reflection: 0.0,
    outlier_share: 0.002,
    outlier_arc_share: 0.002,
    outlier_arc_beams: 8.0,
    outlier_no_echo_share: 0.3,
    outlier_max_range_m: 4.0,
};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.as_slice() {
        [list] if list == "--list" => {
            WORKLOADS.iter().for_each(|(name, _)| println!("{name}"));
            ExitCode::SUCCESS
        }
        [wanted] => match WORKLOADS.iter().find(|(name, _)| name == wanted) {
            Some((_, run)) => match run() {
                Ok(digest) => {
                    println!("{digest}");
                    ExitCode::SUCCESS
                }
                Err(failure) => fail(&failure.to_string()),
            },
            None => fail(&format!("{wanted}: no workload; --list prints them")),
        },
        _ => fail("usage: instructions --list | NAME"),
    }
}

fn fail(reason: &str) -> ExitCode {
    eprintln!("instructions: {reason}");
    ExitCode::FAILURE
}

/// Runs a workload. Counters find this function by its name.
#[inline(never)]
fn measured_workload<T>(work: impl FnOnce() -> T) -> T {
    black_box(work())
}

fn shipped_scene(name: &str) -> Result<Arc<Scene>, Failure> {
    let text = shipped::text(name).ok_or_else(|| format!("{name} is not shipped"))?;
    Ok(Arc::new(Scene::from_json(text)?))
}

fn simulator(scene: &str, max_range_m: f64) -> Result<Simulator, Failure> {
    let options = Options { max_range_m: Some(max_range_m), ..Options::default() };
    let sensor = Sensor::preset("senscomp-6500")?;
    Ok(Simulator::new(shipped_scene(scene)?, sensor, Air::default(), options)?)
}

/// Simulated scan of 400 beams from a pose of the scene.
fn simulate(simulator: &Simulator, pose: &Pose) -> Result<ScanView, Failure> {
    let plan = ScanPlan::default();
    Ok(ScanView::simulated(simulator, Uuid::nil(), pose, &plan, Timestamp::UNIX_EPOCH)?)
}

/// Path search and 400 firings, mean range in metres.
fn predict_scan(scene: &str, pose: &str, max_range_m: f64) -> Result<f64, Failure> {
    let simulator = simulator(scene, max_range_m)?;
    let pose = simulator.scene().poses[pose];
    let plan = ScanPlan::default();
    // Bounds of the beam pattern are computed once per ranger, by its first firing.
    simulator.at(pose.position()).ping(0.0)?;
    let predictions = measured_workload(|| simulator.predict(&pose, &plan))?;
    let ranges: Vec<f64> = predictions.iter().filter_map(|of| of.range_m).collect();
    Ok(ranges.iter().sum::<f64>() / ranges.len() as f64)
}

/// Log-likelihood of 400 readings with its derivatives by the pose, nats.
fn evaluate_hypothesis() -> Result<f64, Failure> {
    let simulator = simulator("simple-room", 4.0)?;
    let pose = simulator.scene().poses["fig9"];
    let scene = Arc::clone(simulator.scene());
    let sensor = Sensor::preset("senscomp-6500")?;
    let mut world = World::new(scene, sensor, Air::default(), Options::default());
    world.options.max_range_m = Some(4.0);
    let point = simulator.at(pose.position());
    let firing = |at: u32| -> Result<SweepFiring, Failure> {
        let azimuth_deg = 0.9 * f64::from(at);
        let predicted = point.ping(pose.direction_rad(azimuth_deg))?;
        let outcome = match (predicted.status, predicted.range_m) {
            (PingStatus::Echo, Some(range_m)) => {
                FiringOutcome::Echo { tof_us: 2e6 * range_m / simulator.sound_speed_m_s() }
            }
            (PingStatus::MinRange, _) => FiringOutcome::BelowMinRange,
            _ => FiringOutcome::NoEcho,
        };
        Ok(SweepFiring { azimuth_deg, outcome })
    };
    let beams = (0..400).map(firing).collect::<Result<_, _>>()?;
    let sweep = FitSweep { scan: Uuid::nil(), pose, beams };
    let parameters = vec![Parameter::X(0), Parameter::Y(0), Parameter::Heading(0)];
    let hypotheses = Hypotheses::new(world, parameters)?;
    let beside = Pose { x_m: pose.x_m + 0.02, ..pose };
    Ok(measured_workload(|| hypotheses.log_likelihood(&sweep, &beside, &ERRORS))?.value)
}

/// Interpretation of a scan; the number of its features.
fn interpret_scan() -> Result<f64, Failure> {
    let simulator = simulator("two-surface-room", 5.0)?;
    let scan = simulate(&simulator, &Pose { x_m: 0.5, y_m: 0.9, heading_deg: 0.0 })?;
    let sensor = Sensor::preset("senscomp-6500")?;
    let extents = Extents::new(&sensor, &Air::default(), false)?;
    let sweeps = [(Uuid::nil(), Sweep::from_scan(&scan)?)];
    let settings = InterpretSettings::default();
    let found = measured_workload(|| interpret(&sweeps, &extents, &settings));
    Ok(found.len() as f64)
}

/// Lines of a log written and read again; their bytes.
fn convert_records() -> Result<f64, Failure> {
    let log = include_str!("../../../tests/fixtures/small.jsonl");
    let lines: Vec<&str> = log.lines().collect();
    measured_workload(|| {
        let mut written = Vec::new();
        for line in lines.iter().cycle().take(400) {
            encode_line(&decode_line(line.as_bytes())?, &mut written)?;
        }
        Ok(written.len() as f64)
    })
}

/// Frames of 1,000 readings, encoded and decoded; the number of readings.
fn decode_frames() -> Result<f64, Failure> {
    measured_workload(|| {
        let (mut decoder, mut readings) = (FrameDecoder::new(), 0);
        for index in 0..1000_u16 {
            let frame =
                Frame::encode(HEADER, &Reply::Reading(reading(index))).map_err(|_| "too long")?;
            for &byte in frame.iter() {
                if let Received::Frame(raw) = decoder.push(byte) {
                    readings += u32::from(matches!(Reply::decode(raw.body), Ok(Reply::Reading(_))));
                }
            }
        }
        Ok(f64::from(readings))
    })
}

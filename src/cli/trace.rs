//! `sonard trace`.

use std::{io::Write as _, sync::Arc};

use serde::Serialize;

use super::{
    Failure, Outcome,
    options::{AirArgs, SensorArgs, engine_options},
    paths::{MAX_ROWS, describe_rest},
    picture::{PictureArgs, Target},
    place::PlaceArgs,
    table::{align_right, fit, plain},
};
use crate::{
    acoustics::{EchoTrace, EnvelopePeak},
    geometry::Pose,
    model::{ObservationPoint, OptionKeys, Simulator, TooCostly},
    plot::{TraceView, draw_trace},
    scan::{PathRecord, PingStatus, text::format_count},
};

/// Options of `sonard trace`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    #[command(flatten)]
    place: PlaceArgs,
    /// Azimuth, degrees counter-clockwise from the heading; direction of the beam
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    azimuth_deg: f64,
    /// Maximum range of the trace, metres [default: after the last arrival near the threshold]
    #[arg(long, value_name = "M")]
    until: Option<f64>,
    /// Spacing of the samples, microseconds
    #[arg(long, value_name = "US", default_value_t = 5.0)]
    step_us: f64,
    /// Print all findings; without it, the table ends after 50 rows
    #[arg(long)]
    all: bool,
    /// JSON instead of text; one object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    picture: PictureArgs,
    #[command(flatten)]
    engine: OptionKeys,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    air: AirArgs,
}

pub(super) const ABOUT: &str = "\
Show the echo trace of one ping, as on an oscilloscope.

The trace is the envelope of the sum of all echoes over time, with the gain, the current \
threshold, the blanking and the rising edges of ECHO; each peak has its path. Without -o and \
--json, a table of the peaks is printed. Times are those of a calibrated ranger: the echo of a \
head-on, perfectly reflecting wall rises at the length of its path divided by the speed of \
sound.";

const HELP: &str = "\
Examples:
  sonard trace --scene echo-traces --pose d -o trace.png
  sonard trace --scene simple-room --pose fig9 --azimuth-deg 270
  sonard trace --scene simple-room --pose fig9 --azimuth-deg 270 --short-blanking --until 1 -o t.svg
  sonard trace --scene corridor --pose beside-wall --azimuth-deg 90 --json | jq .detection

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

/// Trace as `--json` prints it.
#[derive(Debug, Serialize)]
struct TraceJson<'a> {
    scene: &'a str,
    pose: Pose,
    azimuth_deg: f64,
    sensor: &'a str,
    sound_speed_m_s: f64,
    blanking_us: f64,
    t_us: Vec<f64>,
    envelope: Vec<f64>,
    threshold: Vec<f64>,
    gain_db: Vec<f64>,
    transmission: &'a [(f64, f64)],
    peaks: Vec<PeakJson>,
    detection: DetectionJson,
}

#[derive(Debug, Serialize)]
struct PeakJson {
    tof_us: f64,
    peak_us: f64,
    peak: f64,
    path: PathRecord,
}

#[derive(Debug, Serialize)]
struct DetectionJson {
    status: PingStatus,
    range_m: Option<f64>,
    tof_us: Vec<f64>,
    /// ECHO rises again after the last of these times.
    has_more_echoes: bool,
    amplitude: Option<f64>,
    margin_db: Option<f64>,
    path: Option<PathRecord>,
}

pub(super) fn run(args: &Args) -> Outcome {
    let within = |option: &str, value: f64, from: f64, to: f64, unit: &str| {
        let help = format!("give a number from {from} to {to} {unit}");
        let refuse = || Failure::input(format!("{option} is {value}"), help);
        if (from..=to).contains(&value) { Ok(()) } else { Err(refuse()) }
    };
    within("--step-us", args.step_us, 1.0, 1000.0, "microseconds")?;
    within("--until", args.until.unwrap_or(1.0), 0.05, 100.0, "metres")?;
    within("--azimuth-deg", args.azimuth_deg, -360.0, 360.0, "degrees")?;
    let targets = args.picture.targets()?;
    let (scene, pose) = args.place.load()?;
    let (sensor, air) = (args.sensor.sensor()?, args.air.air()?);
    let scene = Arc::new(scene.with_robot_at(&pose));
    let simulator = Simulator::new(scene, sensor, air, engine_options(&args.engine)?)
        .map_err(|error| Failure::input(error, "see `sonard trace --help`"))?;
    let ping = PingTrace::new(args, &simulator, pose)
        .map_err(|error| Failure::input(error, "see `sonard trace --help`"))?;
    if args.json {
        let printed = serde_json::to_writer(std::io::stdout().lock(), &ping.object())
            .map_err(std::io::Error::from)
            .and_then(|()| writeln!(std::io::stdout()));
        printed.or_else(|error| Failure::from_write("to standard output", &error))?;
    } else if targets.is_empty() {
        let table = ping.table(args.all);
        let omitted = ping.describe_omitted().map(|note| format!("\n{note}")).unwrap_or_default();
        writeln!(std::io::stdout(), "{table}\n{}{omitted}", ping.describe_detection())
            .or_else(|error| Failure::from_write("to standard output", &error))?;
    }
    ping.draw(&targets, args.picture.width)
}

/// Trace of one ping, with the paths of its peaks.
struct PingTrace<'a> {
    simulator: &'a Simulator,
    pose: Pose,
    pose_text: &'a str,
    azimuth_deg: f64,
    trace: EchoTrace,
    paths: Vec<PathRecord>,
    path: Option<PathRecord>,
}

impl<'a> PingTrace<'a> {
    fn new(args: &'a Args, simulator: &'a Simulator, pose: Pose) -> Result<Self, TooCostly> {
        let direction_rad = pose.direction_rad(args.azimuth_deg);
        let point = simulator.at(pose.position());
        let whole = || {
            let longest_m = simulator.receiver().max_range_m;
            let trace = point.trace(direction_rad, longest_m, args.step_us)?;
            Ok(default_range_m(simulator, &trace))
        };
        let until_m = args.until.map_or_else(whole, Ok)?;
        let trace = point.trace(direction_rad, until_m, args.step_us)?;
        let record = |sound| {
            let arrival = ObservationPoint::arrival(&point, direction_rad, sound)?;
            Ok(PathRecord::from_path(simulator.scene(), &arrival.path, arrival.length_m))
        };
        let paths =
            trace.peaks.iter().map(|peak| record(&peak.arrival)).collect::<Result<_, _>>()?;
        let path = trace.detection.arrival.as_ref().map(record).transpose()?;
        Ok(Self {
            simulator,
            pose,
            pose_text: &args.place.pose,
            azimuth_deg: args.azimuth_deg,
            trace,
            paths,
            path,
        })
    }

    fn peaks(&self) -> impl Iterator<Item = (&EnvelopePeak, &PathRecord)> {
        self.trace.peaks.iter().zip(&self.paths)
    }

    fn object(&self) -> TraceJson<'_> {
        let points = &self.trace.points;
        let detection = &self.trace.detection;
        TraceJson {
            scene: &self.simulator.scene().name,
            pose: self.pose,
            azimuth_deg: self.azimuth_deg,
            sensor: &self.simulator.sensor().name,
            sound_speed_m_s: self.simulator.sound_speed_m_s(),
            blanking_us: self.simulator.receiver().blanking_us,
            t_us: points.iter().map(|point| point.t_us).collect(),
            envelope: points.iter().map(|point| point.envelope).collect(),
            threshold: points.iter().map(|point| point.threshold).collect(),
            gain_db: points.iter().map(|point| point.gain_db).collect(),
            transmission: &self.trace.transmission,
            peaks: self
                .peaks()
                .map(|(peak, path)| PeakJson {
                    tof_us: peak.tof_us,
                    peak_us: peak.peak.1,
                    peak: peak.peak.0,
                    path: path.clone(),
                })
                .collect(),
            detection: DetectionJson {
                status: detection.status,
                range_m: detection.range_m,
                tof_us: detection.echoes_us.to_vec(),
                has_more_echoes: detection.has_more_echoes,
                amplitude: detection.amplitude,
                margin_db: detection.margin_db,
                path: self.path.clone(),
            },
        }
    }

    fn table(&self, all: bool) -> String {
        let mut table = plain(["time us", "range m", "peak", "peak dB", "path"]);
        align_right(&mut table, 0..4);
        let shown = if all { self.paths.len() } else { self.paths.len().min(MAX_ROWS) };
        for (peak, path) in self.peaks().take(shown) {
            table.add_row([
                format!("{:.1}", peak.tof_us),
                format!("{:.4}", path.length_m / 2.0),
                format!("{:.4}", peak.peak.0),
                format!("{:.1}", 20.0 * peak.peak.0.log10()),
                path.describe(),
            ]);
        }
        let (count, rest) = (self.paths.len(), describe_rest(self.paths.len() - shown));
        format!("{}\n{}{rest}", fit(table), format_count(count, "peak"))
    }

    /// Note on crossings of the threshold that a detection omits.
    fn describe_omitted(&self) -> Option<String> {
        let detection = &self.trace.detection;
        let count = detection.echoes_us.len();
        detection.has_more_echoes.then(|| {
            format!("the signal crosses the threshold more than {count} times; the first {count} are shown")
        })
    }

    /// Describes the receiver's output.
    fn describe_detection(&self) -> String {
        let detection = &self.trace.detection;
        let path = self.path.as_ref().map(PathRecord::describe);
        let by = path.map(|path| format!(" via {path}")).unwrap_or_default();
        let margin_db = detection.margin_db.unwrap_or(f64::NEG_INFINITY);
        match (detection.status, detection.range_m) {
            (PingStatus::MinRange, Some(range_m)) => format!(
                "minimum range, {range_m:.4} m: sound{by} is arriving at the end of the blanking, \
                 {margin_db:.1} dB above the threshold"
            ),
            (_, Some(range_m)) => {
                format!("echo at {range_m:.4} m{by}, {margin_db:.1} dB above the threshold")
            }
            _ if self.path.is_some() => {
                format!(
                    "no echo; the strongest arrival{by} is {:.1} dB below the threshold",
                    -margin_db
                )
            }
            _ => "no echo, and no arrival near the threshold".to_owned(),
        }
    }

    fn draw(&self, targets: &[Target], width_px: u32) -> Outcome {
        if targets.is_empty() {
            return Ok(());
        }
        let receiver = self.simulator.receiver();
        let view = TraceView {
            title: format!(
                "{}, pose {}, azimuth {}\u{b0}: {}",
                self.simulator.scene().name,
                self.pose_text,
                self.azimuth_deg,
                self.describe_detection()
            ),
            lines: [format!(
                "{} \u{b7} {:.2} m/s \u{b7} blanking {:.0} us",
                self.simulator.sensor().name,
                self.simulator.sound_speed_m_s(),
                receiver.blanking_us
            )]
            .into_iter()
            .chain(self.describe_omitted())
            .collect(),
            trace: &self.trace,
            names: self.paths.iter().map(PathRecord::describe).collect(),
            blanking_us: receiver.blanking_us,
            rearm_us: receiver.rearm_us,
            sound_speed_m_s: receiver.sound_speed_m_s,
        };
        let picture = draw_trace(&view);
        targets.iter().try_for_each(|target| target.write(&picture, width_px))
    }
}

/// Range of the default trace: 0.5 m beyond the last peak within 10 dB of the threshold, and beyond
/// the blanking.
fn default_range_m(simulator: &Simulator, trace: &EchoTrace) -> f64 {
    let receiver = simulator.receiver();
    let near = |peak: &&EnvelopePeak| peak.peak.0 > 0.3 * receiver.threshold_at(peak.tof_us);
    let last = trace.peaks.iter().rev().find(near);
    let last_m = last.map_or(1.0, |peak| peak.arrival.length_m / 2.0);
    (last_m.max(receiver.min_range_m()) + 0.5).min(receiver.max_range_m)
}

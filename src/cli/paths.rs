//! `sonard paths`.

use std::{
    io::{self, Write},
    sync::Arc,
};

use serde::Serialize;

use super::{
    Failure, Outcome,
    options::{AirArgs, SensorArgs},
    place::PlaceArgs,
    table::{align_right, fit, plain},
};
use crate::{
    geometry::{Pose, wrap_360},
    model::{
        EdgeLawKind, Options, PathOptions, Simulator,
        paths::{EchoPath, Paths},
    },
    scan::{
        InteractionRecord, PathKind, PathRecord,
        text::{format_count, group_digits},
    },
};

/// Options of `sonard paths`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    #[command(flatten)]
    place: PlaceArgs,
    /// Azimuth, degrees counter-clockwise from the heading; lists the paths between transmitter and
    /// receiver at their positions for that azimuth. By default both are on the rotation axis
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    azimuth_deg: Option<f64>,
    /// Maximum range, metres, instead of the sensor's
    #[arg(long, value_name = "M")]
    max_range: Option<f64>,
    /// Maximum number of mirror reflections on a path; unlimited by default
    #[arg(long, value_name = "N")]
    max_order: Option<u32>,
    /// Minimum amplitude of listed paths; a head-on, perfect wall gives 1. By default 0.001, and 0.01
    /// for paths with more than one cylinder, or a cylinder and an edge, that are longer than the
    /// blanking covers
    #[arg(long, value_name = "A")]
    min_amplitude: Option<f64>,
    /// Edge diffraction model, instead of the sensor's or utd
    #[arg(long, value_enum, value_name = "LAW")]
    edge_law: Option<EdgeLawKind>,
    /// Find paths diffracted at two edges, too
    #[arg(long)]
    double_diffraction: bool,
    /// Disable the absorption of the air
    #[arg(long)]
    lossless: bool,
    /// Print all findings; without it, the table ends after 50 rows
    #[arg(long)]
    all: bool,
    /// JSON instead of text; one object per path
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    air: AirArgs,
}

pub(super) const ABOUT: &str = "\
List the propagation paths of echoes at a position, shortest first.

Paths have any number of mirror reflections, and one diffraction (two with --double-diffraction) \
with any reflections before and after. The amplitude includes reflectances, edges, curvature and \
absorption but no beam pattern: it is that of a ranger pointed along both departure and arrival. A \
path that can be traversed in both directions is listed twice, with departure and arrival \
exchanged. Departure and arrival are directions in the world, degrees counter-clockwise from +x; \
azimuth_deg of `sonard simulate` counts from the heading.";

const EXAMPLES: &str = "\
Examples:
  sonard paths --scene simple-room --pose fig9 --max-range 1
  sonard paths --scene mcgill-lab --pose 1,1,0 --max-order 2 --json | jq -c '.interactions[].point'
  sonard paths --scene my-room.json --pose 1.2,0.8,90 --lossless --min-amplitude 0.05
  sonard paths --scene simple-room --pose fig9 --sensor hc-sr04 --azimuth-deg 45   # separate transducers

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

/// Path as `--json` prints it.
#[derive(Debug, Serialize)]
struct PathLine {
    length_m: f64,
    kind: PathKind,
    order: u32,
    interactions: Vec<InteractionRecord>,
    departure_deg: f64,
    arrival_deg: f64,
    amplitude: f64,
    phase_deg: f64,
    #[serde(skip)]
    description: String,
}

pub(super) fn run(args: &Args) -> Outcome {
    if let Some(amplitude) = args.min_amplitude.filter(|it| !(1e-6..=1.0).contains(it)) {
        return Err(Failure::input(
            format!("--min-amplitude is {amplitude}"),
            "give a number from 0.000001 to 1",
        ));
    }
    let (scene, pose) = args.place.load()?;
    let options = Options {
        max_range_m: args.max_range,
        ..PathOptions {
            max_order: args.max_order,
            edge_law: args.edge_law,
            double_diffraction: args.double_diffraction,
            lossless: args.lossless,
            ..PathOptions::default()
        }
        .into()
    };
    let scene = Arc::new(scene.with_robot_at(&pose));
    let simulator = Simulator::new(scene, args.sensor.sensor()?, args.air.air()?, options)
        .map_err(|error| Failure::input(error, "see `sonard paths --help`"))?;
    let settings = simulator.path_settings().listing(args.min_amplitude);
    let paths = Paths::new(simulator.scene(), settings);
    let [transmitter, receiver] = match args.azimuth_deg {
        None => [pose.position(); 2],
        Some(azimuth_deg) => {
            let axis = Pose { heading_deg: pose.heading_deg + azimuth_deg, ..pose };
            simulator.sensor().mounting.viewpoint(&axis).transducer_positions()
        }
    };
    let printed = paths.visit_between(transmitter, receiver, |paths| {
        let count = paths.len();
        let lines = paths.map(|path| path_line(&simulator, &path));
        if args.json { write_json(lines) } else { write_table(lines, count, args.all) }
    });
    let written = printed.map_err(|error| Failure::input(error, "see `sonard paths --help`"))?;
    written.or_else(|error| Failure::from_write("to standard output", &error))
}

fn path_line(simulator: &Simulator, path: &EchoPath) -> PathLine {
    let record = PathRecord::from_path(simulator.scene(), &path.path, path.length_m);
    PathLine {
        description: record.describe(),
        length_m: path.length_m,
        kind: record.kind,
        order: record.order,
        interactions: record.interactions,
        departure_deg: degrees(path.departure_rad),
        arrival_deg: degrees(path.arrival_rad),
        amplitude: path.amplitude,
        phase_deg: path.phase_rad.to_degrees(),
    }
}

/// Degrees from 0 to 360, without negative zero.
fn degrees(angle_rad: f64) -> f64 {
    wrap_360(angle_rad.to_degrees()) + 0.0
}

fn write_json(lines: impl Iterator<Item = PathLine>) -> io::Result<()> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    for path_line in lines {
        serde_json::to_writer(&mut out, &path_line)?;
        out.write_all(b"\n")?;
    }
    out.flush()
}

fn write_table(lines: impl Iterator<Item = PathLine>, count: usize, all: bool) -> io::Result<()> {
    let mut table = plain(["length m", "range m", "departure", "arrival", "amplitude", "path"]);
    align_right(&mut table, 0..5);
    let shown = if all { count } else { count.min(MAX_ROWS) };
    for path_line in lines.take(shown) {
        table.add_row([
            format!("{:.4}", path_line.length_m),
            format!("{:.4}", path_line.length_m / 2.0),
            format!("{:.1}°", path_line.departure_deg),
            format!("{:.1}°", path_line.arrival_deg),
            format!("{:.4}", path_line.amplitude),
            path_line.description,
        ]);
    }
    let mut out = io::BufWriter::new(io::stdout().lock());
    writeln!(out, "{}", fit(table))?;
    writeln!(out, "{}{}", format_count(count, "path"), describe_rest(count - shown))?;
    out.flush()
}

/// Maximum number of rows of a table without `--all`.
pub(super) const MAX_ROWS: usize = 50;

/// Remark on the rows that a table omits; empty if there are none.
pub(super) fn describe_rest(omitted: usize) -> String {
    match omitted {
        0 => String::new(),
        more => format!(", {} more; --all prints them", group_digits(more as u64)),
    }
}

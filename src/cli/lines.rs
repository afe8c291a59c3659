//! `sonard lines`.

mod laser;

use std::{
    io::{self, Write},
    path::PathBuf,
};

use super::{
    Failure, Outcome,
    answer::print_result,
    findings::{FindingsArgs, ScanOrigin},
    logs::{DrawnScans, first_log},
    picture::scene_for,
    sweeps::for_each_sweep,
};
use crate::{
    interpret::lines::{LineMap, LineMapSettings, MapLine},
    plot::draw_lines,
    scan::{ScanView, text::format_count},
};

/// Options of `sonard lines`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs whose scans have poses, or folders of logs; - for standard input
    #[arg(required_unless_present = "laser", value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Laser scans of the same place, used after the sonar's; one JSON object per line, - for
    /// standard input
    #[arg(long, value_name = "FILE")]
    laser: Vec<PathBuf>,
    /// Maximum ("logical") range of sonar readings used, metres
    #[arg(long, value_name = "M", default_value_t = LineMapSettings::default().logical_m)]
    logical: f64,
    /// JSON instead of text; one object per line segment
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    files: FindingsArgs,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); only its walls are drawn,
    /// instead of those of the scene in the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
}

pub(super) const ABOUT: &str = "\
Make a map of line segments from the scans of logs.

After G. Dudek, P. Freedman and I. Rekleitis (ICRA 1996): implausible readings are discarded (too \
long, or contradicted by nearer observations), the rest are grouped by the sphere-of-influence \
graph, segments are fitted to each group by split and merge, and segments of one wall are \
merged.";

const HELP: &str = "\
Examples:
  sonard lines run/*.jsonl -o lines.png
  sonard lines scan.jsonl --logical 2 --json
  sonard lines run/*.jsonl -o lines.geojson -o lines.mcap
  sonard lines run/*.jsonl --laser laser.jsonl -o lines.png

A line of a laser's file is a scan from one position, counter-clockwise, null for no return: \
{\"pose\":{\"x_m\":1,\"y_m\":0.5,\"heading_deg\":90},\"returns\":[{\"azimuth_deg\":-12.5,\"range_m\":1.21}, \
...]}
Lines seen by the laser only are `laser`, those merged with sonar lines are `complex`; ends \
that it saw are terminal.

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    if !(args.logical.is_finite() && args.logical > 0.0) {
        return Err(Failure::input(
            format!("--logical is {}", args.logical),
            "give a length in metres, greater than 0",
        ));
    }
    let targets = args.files.targets()?;
    let LineMapInput { scans, origin, map, discarded } = read_logs(args)?;
    print_result(args.json, map.lines().iter().map(record), |out| print(out, &map, discarded))?;
    targets.write(&origin.place(None, map.lines(), &[]), || {
        let scene = scene_for(&first_log(&args.logs), &scans, args.scene.as_deref())?;
        Ok(draw_lines(&scans, scene.as_ref(), map.lines()))
    })
}

/// Line map of the logs, with the scans for a picture.
struct LineMapInput {
    scans: Vec<ScanView>,
    origin: ScanOrigin,
    map: LineMap,
    /// Number of discarded readings.
    discarded: usize,
}

fn read_logs(args: &Args) -> Result<LineMapInput, Failure> {
    let settings = LineMapSettings { logical_m: args.logical, ..LineMapSettings::default() };
    let (mut scans, mut origin, mut map) =
        (DrawnScans::default(), ScanOrigin::default(), LineMap::new(settings));
    let (mut count, mut discarded) = (0_usize, 0);
    for_each_sweep(&args.logs, |scan, sweep| {
        discarded += map.add_sonar(&sweep);
        count += 1;
        origin.add(&scan);
        // A picture shows all readings; otherwise they need not be kept in memory.
        if !args.files.output.is_empty() {
            scans.add(scan);
        }
    })?;
    for file in &args.laser {
        for scan in laser::load(file)? {
            map.add_laser(&scan);
        }
    }
    if count == 0 && args.laser.is_empty() {
        return Err(Failure::input(
            "no scan with a pose to map",
            "give logs written by `sonard scan` or `sonard simulate`",
        ));
    }
    Ok(LineMapInput { scans: scans.finish(), origin, map, discarded })
}

pub(super) fn record(line: &MapLine) -> serde_json::Value {
    let [a, b] = line.ends;
    serde_json::json!({
        "kind": line.kind, "from_m": a.to_array(), "to_m": b.to_array(),
        "length_m": line.length_m(), "confidence": line.confidence, "terminal": line.terminal,
    })
}

fn print(out: &mut impl Write, map: &LineMap, discarded: usize) -> io::Result<()> {
    for line in map.lines() {
        let [a, b] = line.ends;
        writeln!(
            out,
            "({:.3}, {:.3}) to ({:.3}, {:.3}) m: {:.3} m, confidence {:.2}",
            a.x,
            a.y,
            b.x,
            b.y,
            line.length_m(),
            line.confidence
        )?;
    }
    writeln!(
        out,
        "{}; {} discarded",
        format_count(map.lines().len(), "line"),
        format_count(discarded, "reading")
    )
}

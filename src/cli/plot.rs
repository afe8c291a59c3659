//! `sonard plot`.

mod path;

use std::path::{Path, PathBuf};

use super::{
    Failure, Outcome,
    logs::{DrawnScans, for_each_scan},
    picture::{PictureArgs, scene_for, targets},
};
use crate::{
    plot::{draw_confidence, draw_polar, draw_residuals, draw_scans, draw_side_by_side},
    scan::ScanView,
};

/// Options of `sonard plot`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// The log; - for standard input
    log: PathBuf,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); only its walls are drawn,
    /// instead of those of the scene in the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// Kind of picture
    #[arg(long, value_enum, default_value_t = Kind::Scan)]
    kind: Kind,
    /// Draw only this scan: its number in the log, from 1, or the beginning of its id; several are
    /// overlaid (repeatable)
    #[arg(long, value_name = "N|ID")]
    scan: Vec<String>,
    /// Draw the propagation path of one beam: its index in the plan
    #[arg(long, value_name = "INDEX", conflicts_with = "azimuth_deg")]
    beam: Option<u32>,
    /// Azimuth, degrees counter-clockwise from the heading; draws the propagation path of the
    /// nearest beam
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    azimuth_deg: Option<f64>,
    #[command(flatten)]
    picture: PictureArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// Floor plan with walls, readings and predictions, and plots of range and residual
    Scan,
    /// Range against azimuth around the ranger
    Polar,
    /// Measured minus predicted range
    Residuals,
    /// The first three scans side by side, with the number of beams that differ: for scans of one
    /// place by different engines
    SideBySide,
    /// Floor plan with each reading in the colour of its confidence, from `sonard log annotate`
    Confidence,
}

pub(super) const ABOUT: &str = "\
Draw the scans of a log as SVG or PNG.

Filled marks are readings; shape and colour show their cause: a direct echo, multiple reflections, \
an edge, sound arriving at the end of the blanking (minimum range), or disagreement with the \
model. Rings and thin rays are predictions. Ticks on the border are beams without an echo, arrows \
are readings outside the view. In a browser, pointing at a mark of an SVG shows its values. Scans \
of one log are overlaid. With --beam or --azimuth-deg the propagation path of one beam is drawn \
instead, interaction by interaction.";

const HELP: &str = "\
Examples:
  sonard plot scan.jsonl -o scan.svg -o scan.png
  sonard plot scan.jsonl --kind residuals --scan 2 -o residuals.png --width 2000
  sonard simulate --scene simple-room --pose fig9 | sonard plot - -o fig9.svg
  sonard plot scan.jsonl --azimuth-deg 270 -o path.png
  for e in paths fan cone; do sonard simulate --scene corridor --pose beside-wall --engine $e; done \
      | sonard plot - --kind side-by-side -o engines.png

Exit codes: 0 drawn, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    let targets = targets(&args.picture)?;
    let log = &args.log;
    let views =
        if args.scan.is_empty() { read_all(args)? } else { read_requested(log, &args.scan)? };
    let scene = scene_for(log, &views, args.scene.as_deref())?;
    let beam = args.beam.map(path::Beam::Index).or(args.azimuth_deg.map(path::Beam::Azimuth));
    let picture = match (beam, args.kind) {
        (Some(beam), _) => path::draw(&views, scene.as_ref(), beam)?,
        (None, Kind::Scan) => draw_scans(&views, scene.as_ref()),
        (None, Kind::Polar) => draw_polar(&views, scene.as_ref()),
        (None, Kind::SideBySide) => draw_side_by_side(&views, scene.as_ref()),
        (None, Kind::Confidence) => {
            check_confidences(log, &views)?;
            draw_confidence(&views, scene.as_ref())
        }
        (None, Kind::Residuals) => draw_residuals(&views, scene.as_ref()),
    };
    targets.iter().try_for_each(|target| target.write(&picture, args.picture.width))
}

/// Checks that there is a confidence to draw.
fn check_confidences(log: &Path, views: &[ScanView]) -> Outcome {
    if views.iter().flat_map(|view| &view.pings).any(|ping| ping.confidence.is_some()) {
        return Ok(());
    }
    let log = log.display();
    Err(Failure::input(
        format!("{log}: no reading has a confidence"),
        format!(
            "`sonard log annotate {log} -o annotated.jsonl` adds confidences; then plot annotated.jsonl"
        ),
    ))
}

/// Reads the scans that are drawn.
fn read_all(args: &Args) -> Result<Vec<ScanView>, Failure> {
    let one = args.beam.is_some() || args.azimuth_deg.is_some();
    let max_scans = match args.kind {
        _ if one => 1,
        Kind::SideBySide => MAX_SIDE_BY_SIDE,
        _ => usize::MAX,
    };
    let (mut drawn, mut count) = (DrawnScans::default(), 0);
    for_each_scan(&args.log, |scan| {
        count += 1;
        if count <= max_scans {
            drawn.add(scan);
        }
        Ok(())
    })?;
    let scans = drawn.finish();
    if scans.is_empty() { Err(no_scan(&args.log)) } else { Ok(scans) }
}

/// Maximum number of scans side by side.
const MAX_SIDE_BY_SIDE: usize = 3;

fn no_scan(log: &Path) -> Failure {
    Failure::input(
        format!("{}: no scan in this log", log.display()),
        "give a log written by `sonard scan` or `sonard simulate`; `sonard log show` lists the \
         contents of one",
    )
}

/// Reads the requested scans: each by its number from 1, or by the unique id with that beginning.
fn read_requested(log: &Path, requested: &[String]) -> Result<Vec<ScanView>, Failure> {
    let mut found: Vec<Matches> = requested.iter().map(|_| Matches::default()).collect();
    let (mut count, mut first) = (0, None);
    for_each_scan(log, |scan| {
        count += 1;
        let id = scan.scan.to_string();
        for (requested, found) in requested.iter().zip(&mut found) {
            if requested.parse() == Ok(count) {
                found.by_number = Some(scan.clone());
            } else if !requested.is_empty() && id.starts_with(&requested.to_lowercase()) {
                found.with_id += 1;
                found.by_id.get_or_insert_with(|| scan.clone());
            }
        }
        first.get_or_insert(id);
        Ok(())
    })?;
    let Some(first) = first else { return Err(no_scan(log)) };
    requested
        .iter()
        .zip(found)
        .map(|(requested, found)| found.select(requested, count, &first))
        .collect()
}

/// Matches of a requested scan.
#[derive(Default)]
struct Matches {
    by_number: Option<ScanView>,
    by_id: Option<ScanView>,
    with_id: usize,
}

impl Matches {
    fn select(self, requested: &str, count: usize, first: &str) -> Result<ScanView, Failure> {
        match (self.by_number, self.by_id, self.with_id) {
            (Some(scan), ..) | (None, Some(scan), 1) => Ok(scan),
            (None, Some(_), _) => Err(Failure::input(
                format!("--scan {requested}: ambiguous, several ids have this beginning"),
                "give a longer part of the id, or the scan's number",
            )),
            (None, None, _) => Err(Failure::input(
                format!("--scan {requested}: no such scan"),
                format!(
                    "give a number from 1 to {count}, or the beginning of an id; the first is {first}"
                ),
            )),
        }
    }
}

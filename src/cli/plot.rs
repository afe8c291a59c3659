//! `sonard plot`.

mod path;

use std::path::{Path, PathBuf};

use super::{
    Failure, Outcome,
    logs::{Drawn, for_each_scan},
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
    /// Scene file, or the name of a shipped scene (`sonard scene list`); only draws its walls, in
    /// place of those of the scene in the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// What to draw
    #[arg(long, value_enum, default_value_t = Kind::Scan)]
    kind: Kind,
    /// Draw only this scan: its number in the log, from 1, or the beginning of its id. Several
    /// are drawn over each other
    #[arg(long, value_name = "N|ID")]
    scan: Vec<String>,
    /// Draw the propagation path of one beam: its index in the plan
    #[arg(long, value_name = "INDEX", conflicts_with = "azimuth_deg")]
    beam: Option<u32>,
    /// Azimuth, degrees counter-clockwise from the heading; draws the propagation path of the beam nearest to it
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    azimuth_deg: Option<f64>,
    #[command(flatten)]
    picture: PictureArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// Floor plan with walls, readings and predictions; range and residual beside it
    Scan,
    /// Range against azimuth around the ranger
    Polar,
    /// Measured minus predicted range
    Residuals,
    /// The first three scans beside each other, and how many beams differ: for scans of one place by
    /// different engines
    SideBySide,
    /// Floor plan with each reading in the colour of its confidence, from `sonard log annotate`
    Confidence,
}

pub(super) const ABOUT: &str = "\
Draw the scans of a log as SVG or PNG.

Filled marks are readings; shape and colour show their cause: a direct echo, multiple reflections, an edge, \
sound already arriving when the blanking ended (minimum range), or nothing the model knows. Rings and thin rays \
are predictions. Ticks on the border are beams without an echo, arrows are readings beyond the view. In a \
browser, pointing at a mark of an SVG shows its numbers. Scans of one log are drawn over each other. With --beam \
or --azimuth-deg the propagation path of one beam is drawn instead, interaction by interaction.";

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
    let views = if args.scan.is_empty() { all(args)? } else { chosen(log, &args.scan)? };
    let scene = scene_for(log, &views, args.scene.as_deref())?;
    let beam = args.beam.map(path::Beam::Index).or(args.azimuth_deg.map(path::Beam::Azimuth));
    let picture = match (beam, args.kind) {
        (Some(beam), _) => path::draw(&views, scene.as_ref(), beam)?,
        (None, Kind::Scan) => draw_scans(&views, scene.as_ref()),
        (None, Kind::Polar) => draw_polar(&views, scene.as_ref()),
        (None, Kind::SideBySide) => draw_side_by_side(&views, scene.as_ref()),
        (None, Kind::Confidence) => draw_confidence(&views, scene.as_ref()),
        (None, Kind::Residuals) => draw_residuals(&views, scene.as_ref()),
    };
    targets.iter().try_for_each(|target| target.write(&picture, args.picture.width))
}

/// The scans of the log, as far as they are drawn.
fn all(args: &Args) -> Result<Vec<ScanView>, Failure> {
    let one = args.beam.is_some() || args.azimuth_deg.is_some();
    let most = match args.kind {
        _ if one => 1,
        Kind::SideBySide => SIDE_BY_SIDE,
        _ => usize::MAX,
    };
    let (mut drawn, mut count) = (Drawn::default(), 0);
    for_each_scan(&args.log, |scan| {
        count += 1;
        if count <= most {
            drawn.add(scan);
        }
        Ok(())
    })?;
    let scans = drawn.finish();
    if scans.is_empty() { Err(no_scan(&args.log)) } else { Ok(scans) }
}

/// Scans that fit next to each other.
const SIDE_BY_SIDE: usize = 3;

fn no_scan(log: &Path) -> Failure {
    Failure::input(
        format!("{}: there is no scan in this log", log.display()),
        "give a log written by `sonard scan` or `sonard simulate`; `sonard log show` tells what is \
         in one",
    )
}

/// The scans asked for: each by its number from 1, or by the only id that begins so.
fn chosen(log: &Path, wanted: &[String]) -> Result<Vec<ScanView>, Failure> {
    let mut found: Vec<Found> = wanted.iter().map(|_| Found::default()).collect();
    let (mut count, mut first) = (0, None);
    for_each_scan(log, |scan| {
        count += 1;
        let id = scan.scan.to_string();
        for (wanted, found) in wanted.iter().zip(&mut found) {
            if wanted.parse() == Ok(count) {
                found.by_number = Some(scan.clone());
            } else if !wanted.is_empty() && id.starts_with(&wanted.to_lowercase()) {
                found.with_id += 1;
                found.by_id.get_or_insert_with(|| scan.clone());
            }
        }
        first.get_or_insert(id);
        Ok(())
    })?;
    let Some(first) = first else { return Err(no_scan(log)) };
    wanted.iter().zip(found).map(|(wanted, found)| found.one(wanted, count, &first)).collect()
}

/// What was found for a choice.
#[derive(Default)]
struct Found {
    by_number: Option<ScanView>,
    by_id: Option<ScanView>,
    with_id: usize,
}

impl Found {
    fn one(self, wanted: &str, count: usize, first: &str) -> Result<ScanView, Failure> {
        match (self.by_number, self.by_id, self.with_id) {
            (Some(scan), ..) | (None, Some(scan), 1) => Ok(scan),
            (None, Some(_), _) => Err(Failure::input(
                format!("--scan {wanted}: several scans have ids that begin so"),
                "give more of the id, or the scan's number",
            )),
            (None, None, _) => Err(Failure::input(
                format!("--scan {wanted}: the log has no such scan"),
                format!(
                    "give a number from 1 to {count}, or the beginning of an id; the first is {first}"
                ),
            )),
        }
    }
}

//! `sonard plot`.

use std::path::{Path, PathBuf};

use super::{
    Failure, Outcome,
    picture::{scene_for, targets, warn_of_damage, write},
};
use crate::{
    plot::{MAX_WIDTH_PX, draw_polar, draw_residuals, draw_scans},
    scan::ScanView,
    store::load,
};

/// Options of `sonard plot`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// The log; - for standard input
    log: PathBuf,
    /// Scene file or name of a shipped scene; without it, the shipped scene that the log names
    #[arg(long, value_name = "FILE|NAME")]
    scene: Option<String>,
    /// What to draw
    #[arg(long, value_enum, default_value_t = Kind::Scan)]
    kind: Kind,
    /// Draw only this scan: its number in the log, from 1, or the beginning of its id. Several
    /// are drawn over each other
    #[arg(long, value_name = "N|ID")]
    scan: Vec<String>,
    /// Picture to write, .svg or .png; several are possible. Without it, SVG to standard output
    #[arg(short = 'o', long = "out", value_name = "FILE")]
    out: Vec<PathBuf>,
    /// Width of a PNG, pixels
    #[arg(long, value_name = "PX", default_value_t = 1000,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_WIDTH_PX)))]
    width: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// Floor plan with walls, readings and predictions; range and residual beside it
    Scan,
    /// Range against azimuth around the ranger
    Polar,
    /// Measured minus predicted range
    Residuals,
}

pub(super) const ABOUT: &str = "\
Draw the scans of a log as SVG or PNG.

Filled marks are readings; shape and colour say what made them: a direct echo, multiple \
reflections, an edge, sound that was there when the receiver opened (minimum range), or nothing \
the model knows. Rings and thin rays are the model's. Ticks on the border are silent beams, \
arrows readings that lie beyond the view. In a browser, pointing at a mark of an SVG tells its \
numbers. Scans of one log are drawn over each other.";

const HELP: &str = "\
Examples:
  sonard plot scan.jsonl -o scan.svg -o scan.png
  sonard plot scan.jsonl --kind residuals --scan 2 -o residuals.png --width 2000
  sonard simulate --scene simple-room --pose fig9 | sonard plot - -o fig9.svg
Exit codes: 0 drawn, 2 wrong usage or input, 3 a picture can't be written.";

pub(super) fn run(args: Args) -> Outcome {
    let targets = targets(&args.out)?;
    let (log, wanted) = (args.log, args.scan);
    let loaded = load(&log).map_err(|error| Failure::input(&error, error.help()))?;
    warn_of_damage(&log, &loaded);
    let views = choose(ScanView::from_records(loaded.records), &log, &wanted)?;
    let scene = scene_for(&views, args.scene.as_deref())?;
    let picture = match args.kind {
        Kind::Scan => draw_scans(&views, scene.as_ref()),
        Kind::Polar => draw_polar(&views, scene.as_ref()),
        Kind::Residuals => draw_residuals(&views, scene.as_ref()),
    };
    targets.iter().try_for_each(|target| write(&picture, target, args.width))
}

/// The scans asked for; all without a choice.
fn choose(views: Vec<ScanView>, log: &Path, wanted: &[String]) -> Result<Vec<ScanView>, Failure> {
    if views.is_empty() {
        return Err(Failure::input(
            format!("{}: there is no scan in this log", log.display()),
            "give a log written by `sonard scan` or `sonard simulate`; `sonard log show` tells \
             what is in one",
        ));
    }
    if wanted.is_empty() {
        return Ok(views);
    }
    wanted.iter().map(|one| find(&views, one).cloned()).collect()
}

/// The scan of this number, or the only one whose id begins so.
fn find<'a>(views: &'a [ScanView], wanted: &str) -> Result<&'a ScanView, Failure> {
    let by_number = wanted.parse::<usize>().ok().and_then(|n| views.get(n.checked_sub(1)?));
    if let Some(view) = by_number {
        return Ok(view);
    }
    let lower = wanted.to_lowercase();
    let mut by_id =
        views.iter().filter(|view| !lower.is_empty() && view.scan.to_string().starts_with(&lower));
    match (by_id.next(), by_id.next()) {
        (Some(view), None) => Ok(view),
        (Some(_), Some(_)) => Err(Failure::input(
            format!("--scan {wanted}: several scans have ids that begin so"),
            "give more of the id, or the scan's number",
        )),
        (None, _) => Err(Failure::input(
            format!("--scan {wanted}: the log has no such scan"),
            format!(
                "give a number from 1 to {}, or the beginning of an id; the first is {}",
                views.len(),
                views.first().map(|view| view.scan.to_string()).unwrap_or_default()
            ),
        )),
    }
}

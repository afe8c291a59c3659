//! `sonard compare`.

mod predict;
mod table;

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{Failure, Outcome, scene_file};
use crate::{
    compare::{Comparison, compare},
    scan::{Provenance, ScanView},
    store::load,
};

pub(super) use table::{RULED, path_text};

/// Options of `sonard compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs to compare; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Scene file or name of a shipped scene: predict again in it, with the log's sensor, air and
    /// model, instead of taking the predictions in the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<String>,
    /// How many of the beams that fit worst to list
    #[arg(long, default_value_t = 5)]
    worst: usize,
    /// One JSON object a log
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Ranges agree when they differ by at most 1 % of the measured range or 10 mm, whichever is more. \
Verdicts: direct (agree, one reflection), multiple (agree, two or more), edge (agree, bent at an \
edge), min_range (closer than can be measured, on both sides or with ranges that agree), silent (on \
both sides), unexplained (all else). They add up to the beams compared; beams whose reading was \
lost, whose step is in doubt or that have no prediction are counted under not_compared.

Exit codes: 0 it ran, whatever the result, 2 a log can't be opened or \
holds no record, or the scene is wrong.";

pub(super) fn run(args: &Args) -> Outcome {
    let scene = args.scene.as_deref().map(scene_file::load).transpose()?;
    for log in &args.logs {
        let mut scans = scans_of(log)?;
        if let Some(scene) = &scene {
            predict::predict(log, &mut scans, scene)?;
        }
        let (comparison, judged) = compare(&scans);
        let mut out = io::stdout().lock();
        let printed = if args.json {
            print_json(&mut out, log, &comparison)
        } else {
            writeln!(out, "{}", log.display())
                .and_then(|()| table::print(&mut out, &comparison, &judged, args.worst))
        };
        if let Err(error) = printed {
            return Failure::from_write("standard output", &error);
        }
        hint(log, &scans, &comparison);
    }
    Ok(())
}

/// Reads a log's scans; says on standard error what could not be read.
fn scans_of(log: &Path) -> Result<Vec<ScanView>, Failure> {
    let loaded = load(log)?;
    for error in &loaded.damaged {
        anstream::eprintln!("{}: {error}: skipped", log.display());
    }
    if loaded.records.is_empty() {
        return Err(Failure::input(
            format!("{} holds no record", log.display()),
            "give a log as `sonard scan` writes it: one JSON object a line",
        ));
    }
    Ok(ScanView::from_records(loaded.records))
}

fn print_json(out: &mut impl Write, log: &Path, comparison: &Comparison) -> io::Result<()> {
    #[derive(Serialize)]
    struct OfLog<'a> {
        log: &'a Path,
        #[serde(flatten)]
        comparison: &'a Comparison,
    }
    serde_json::to_writer(&mut *out, &OfLog { log, comparison })?;
    writeln!(out)
}

/// Says why nothing could be compared.
fn hint(log: &Path, scans: &[ScanView], comparison: &Comparison) {
    if comparison.beams > 0 {
        return;
    }
    let log = log.display();
    let simulated = |scan: &ScanView| {
        scan.session.as_ref().is_some_and(|s| s.provenance == Provenance::Simulated)
    };
    if comparison.not_compared.total() == 0 {
        anstream::eprintln!("{log}: there is no reading in it");
    } else if comparison.not_compared.no_prediction == 0 {
        anstream::eprintln!("{log}: no reading came through");
    } else if scans.iter().all(simulated) {
        anstream::eprintln!(
            "{log}: simulated readings have no prediction beside them; --scene makes one"
        );
    } else {
        anstream::eprintln!("{log}: there are no predictions in it; --scene makes them");
    }
}

//! `sonard compare`.

mod table;

use std::{
    borrow::Cow,
    io::{self, Write},
    path::{Path, PathBuf},
    sync::Arc,
};

use serde::Serialize;

use super::{
    Failure, Outcome,
    logs::{for_each_scan, logs_in},
    predictor::Predictor,
    scene_file,
    what_if::WhatIfArgs,
};
use crate::{
    compare::{Comparer, Comparison},
    scan::{Provenance, ScanView},
};
use table::Worst;

pub(super) use table::{RULED, path_text};

/// Options of `sonard compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs to compare, or folders of them; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); predicts in it again, with
    /// the log's sensor, air and model, instead of taking the predictions in the log. Without it,
    /// measured scans that have no prediction beside them get one in the scene of the log, if the
    /// log holds it
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    what_if: WhatIfArgs,
    /// How many of the beams that fit worst to list
    #[arg(long, value_name = "N", default_value_t = 5)]
    worst: usize,
    /// JSON instead of text; one object a log, and after several logs one for all of them
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Ranges agree when they differ by at most 1 % of the measured range or 10 mm, whichever is more. \
Verdicts: direct (agree, one reflection), multiple (agree, two or more), edge (agree, diffracted at an \
edge), min_range (closer than can be measured, in both or with ranges that agree), silent (no echo in \
both), unexplained (all else). They add up to the beams compared; beams whose reading was \
lost, whose step is in doubt or that have no prediction are counted under not_compared.

Changes that would explain the readings better are found to first order from the predictions in the log: another pose (of all \
scans), heading, speed of sound, constant offset of all ranges, threshold, or a wall elsewhere (positive away from \
the ranger), each by itself, with its gain in log-likelihood. Only changes with a gain of 10 and more are shown; \
several with the same gain explain the same readings and can't be told apart.

Exit codes: 0 it ran, whatever the result, 2 a log can't be opened or \
holds no record, or the scene is wrong.";

pub(super) fn run(args: &Args) -> Outcome {
    let scene = args.scene.as_deref().map(scene_file::load).transpose()?.map(Arc::new);
    let mut all = Comparer::default();
    let what_if = args.what_if.load()?;
    let several = logs_in(&args.logs)?;
    for log in &several {
        let predictor = Predictor::new(log, scene.as_ref(), &what_if);
        compare_log(args, log, predictor, (several.len() > 1).then_some(&mut all))?;
    }
    let (logs, all) = (several.len(), all.finish());
    if logs < 2 {
        return Ok(());
    }
    let mut out = io::stdout().lock();
    let printed = if args.json {
        print_json(&mut out, &Of::All { logs, comparison: &all })
    } else {
        writeln!(out, "all {logs} logs").and_then(|()| table::print(&mut out, &all, &Worst::new(0)))
    };
    printed.or_else(|error| Failure::from_write("standard output", &error))
}

/// Compares one log, and takes its scans into the comparison of all.
fn compare_log(
    args: &Args,
    log: &Path,
    mut predictor: Predictor<'_>,
    mut all: Option<&mut Comparer>,
) -> Outcome {
    let (mut comparer, mut worst) = (Comparer::default(), Worst::new(args.worst));
    let mut all_simulated = true;
    for_each_scan(log, |mut scan| {
        predictor.predict(&mut scan)?;
        worst.add(&comparer.add(&scan));
        if let Some(all) = &mut all {
            all.add(&scan);
        }
        all_simulated &= is_simulated(&scan);
        Ok(())
    })?;
    let comparison = comparer.finish();
    let mut out = io::stdout().lock();
    let printed = if args.json {
        let log = log.to_string_lossy();
        print_json(&mut out, &Of::Log { log, comparison: &comparison })
    } else {
        writeln!(out, "{}", log.display())
            .and_then(|()| table::print(&mut out, &comparison, &worst))
    };
    printed.or_else(|error| Failure::from_write("standard output", &error))?;
    hint(log, all_simulated, &comparison);
    Ok(())
}

fn is_simulated(scan: &ScanView) -> bool {
    scan.session.as_ref().is_some_and(|session| session.provenance == Provenance::Simulated)
}

/// A line of `--json`.
#[derive(Serialize)]
#[serde(untagged)]
enum Of<'a> {
    Log {
        log: Cow<'a, str>,
        #[serde(flatten)]
        comparison: &'a Comparison,
    },
    All {
        /// How many.
        logs: usize,
        #[serde(flatten)]
        comparison: &'a Comparison,
    },
}

fn print_json(out: &mut impl Write, line: &Of<'_>) -> io::Result<()> {
    serde_json::to_writer(&mut *out, line)?;
    writeln!(out)
}

/// Says why nothing could be compared.
fn hint(log: &Path, all_simulated: bool, comparison: &Comparison) {
    if comparison.beams > 0 {
        return;
    }
    let log = log.display();
    if comparison.not_compared.total() == 0 {
        notice!("{log}: there is no reading in it");
    } else if comparison.not_compared.no_prediction == 0 {
        notice!("{log}: no reading came through");
    } else if all_simulated {
        notice!("{log}: simulated readings have no prediction beside them; --scene makes one");
    } else {
        notice!("{log}: there are no predictions in it; --scene makes them");
    }
}

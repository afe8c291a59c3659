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
use table::WorstBeams;

pub(super) use table::describe_path;

/// Options of `sonard compare`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs to compare, or folders of them; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); used for predictions, with
    /// the log's sensor, air and model, instead of the predictions in the log. Without it, measured
    /// scans without predictions are predicted in the log's scene, if the log contains one
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    what_if: WhatIfArgs,
    /// Number of worst-fitting beams to list
    #[arg(long, value_name = "N", default_value_t = 5)]
    worst: usize,
    /// JSON instead of text; one object per log, and after several logs one for all of them
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Ranges agree when they differ by at most 1 % of the measured range or 10 mm, whichever is more. \
Verdicts: direct (agree, one reflection), multiple (agree, two or more), edge (agree, diffracted \
at an edge), min range (below the minimum range, in both or with ranges that agree), no echo (in \
both), unexplained (disagrees with the model). They add up to the beams compared. Beams whose \
reading was lost, whose motor step is uncertain or that have no prediction are counted under \
not_compared.

Changes that would explain the readings better are estimated to first order from the predictions \
in the log: another pose (of all scans), heading, speed of sound, constant offset of all ranges, \
threshold, or a displaced wall (positive away from the ranger). Each is estimated separately, with \
its gain in log-likelihood. Only changes with a gain of at least 10 are shown; several with the \
same gain explain the same readings and can't be distinguished.

Exit codes: 0 done, whatever the result, 2 a log can't be opened or contains no record, or the \
scene is invalid.";

pub(super) fn run(args: &Args) -> Outcome {
    let scene = args.scene.as_deref().map(scene_file::load).transpose()?.map(Arc::new);
    let mut all = Comparer::default();
    let what_if = args.what_if.load(scene.as_deref())?;
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
        print_json(&mut out, &ComparisonLine::All { logs, comparison: &all })
    } else {
        writeln!(out, "all {logs} logs")
            .and_then(|()| table::print(&mut out, &all, &WorstBeams::new(0)))
    };
    printed.or_else(|error| Failure::from_write("standard output", &error))
}

/// Compares one log, and adds its scans to the comparison of all logs.
fn compare_log(
    args: &Args,
    log: &Path,
    mut predictor: Predictor<'_>,
    mut all: Option<&mut Comparer>,
) -> Outcome {
    let (mut comparer, mut worst) = (Comparer::default(), WorstBeams::new(args.worst));
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
        print_json(&mut out, &ComparisonLine::Log { log, comparison: &comparison })
    } else {
        writeln!(out, "{}", log.display())
            .and_then(|()| table::print(&mut out, &comparison, &worst))
    };
    printed.or_else(|error| Failure::from_write("standard output", &error))?;
    explain_empty(log, all_simulated, &comparison);
    Ok(())
}

fn is_simulated(scan: &ScanView) -> bool {
    scan.session.as_ref().is_some_and(|session| session.provenance == Provenance::Simulated)
}

#[derive(Serialize)]
#[serde(untagged)]
enum ComparisonLine<'a> {
    Log {
        log: Cow<'a, str>,
        #[serde(flatten)]
        comparison: &'a Comparison,
    },
    All {
        logs: usize,
        #[serde(flatten)]
        comparison: &'a Comparison,
    },
}

fn print_json(out: &mut impl Write, line: &ComparisonLine<'_>) -> io::Result<()> {
    serde_json::to_writer(&mut *out, line)?;
    writeln!(out)
}

/// Explains why no beams were compared.
fn explain_empty(log: &Path, all_simulated: bool, comparison: &Comparison) {
    if comparison.beams > 0 {
        return;
    }
    let log = log.display();
    if comparison.not_compared.total() == 0 {
        notice!("{log}: it contains no readings");
    } else if comparison.not_compared.no_prediction == 0 {
        notice!("{log}: all readings were lost");
    } else if all_simulated {
        notice!("{log}: simulated readings have no predictions; --scene adds them");
    } else {
        notice!("{log}: it contains no predictions; --scene adds them");
    }
}

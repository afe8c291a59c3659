//! `sonard log verify`.

use std::{
    fs::File,
    io::{self, Write},
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{Failure, Outcome};
use crate::scan::text::{format_count, group_digits};
use crate::store::{
    FindingKind, LogFinding, LogTotals, Severity, StoreError, check_log, is_locked,
    open_for_reading,
};

/// Maximum number of printed findings per log without --all.
const MAX_SHOWN: u64 = 40;
/// Maximum number of damaged lines among them.
const MAX_SHOWN_DAMAGED: u64 = 5;

/// Options of `sonard log verify`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli) struct Args {
    /// Logs to check; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Count warnings as problems: exit code 1 also for a scan without an end, or time going
    /// backwards
    #[arg(long)]
    strict: bool,
    /// Print all findings; without it, 40 per log
    #[arg(long)]
    all: bool,
    /// JSON instead of text; one object per finding, and one with the totals for each log
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Problems: an incomplete last line, damaged lines, readings outside a scan or before any session, a \
repeated beam, counts that disagree with scan_end, a scan followed by another without an end or an \
event with the reason, contradictory status, range and residual, an azimuth that differs from the \
plan.
Warnings: the last scan has no end (it may be running), time goes backwards.

Exit codes: 0 clean, 1 not clean, 2 a file can't be opened.";

pub(super) fn run(args: &Args) -> Outcome {
    let mut clean = true;
    for log in &args.logs {
        let totals = verify(log, args)?;
        clean &= totals.problems == 0 && !(args.strict && totals.warnings > 0);
    }
    if clean { Ok(()) } else { Err(Failure::Found(None)) }
}

fn verify(log: &Path, args: &Args) -> Result<LogTotals, Failure> {
    let reader = open_for_reading(log)?;
    let mut out = io::stdout().lock();
    let mut printed = Ok(());
    let (mut shown, mut damaged, mut hidden, mut torn) = (0, 0, 0, false);
    let totals = check_log(reader, |finding| {
        torn |= matches!(finding.kind, FindingKind::TornTail | FindingKind::NoNewline);
        damaged += u64::from(finding.kind == FindingKind::Damaged);
        let enough = shown == MAX_SHOWN
            || (finding.kind == FindingKind::Damaged && damaged > MAX_SHOWN_DAMAGED);
        if !args.all && !args.json && enough {
            hidden += 1;
        } else if printed.is_ok() {
            shown += 1;
            printed = print_finding(&mut out, log, &finding, args.json);
        }
    })
    .map_err(|source| StoreError::Read { path: log.into(), source })?;
    let printed = printed.and_then(|()| match args.json {
        true => print_totals_json(&mut out, log, totals),
        false => print_totals(&mut out, log, totals, hidden, torn),
    });
    match printed {
        Ok(()) => Ok(totals),
        Err(error) => Failure::from_write("standard output", &error).map(|()| totals),
    }
}

fn print_finding(
    out: &mut impl Write,
    log: &Path,
    finding: &LogFinding,
    json: bool,
) -> io::Result<()> {
    if json {
        #[derive(Serialize)]
        struct FindingLine<'a> {
            log: &'a Path,
            #[serde(flatten)]
            finding: &'a LogFinding,
        }
        serde_json::to_writer(&mut *out, &FindingLine { log, finding })?;
        return writeln!(out);
    }
    let severity = match finding.severity {
        Severity::Problem => "problem",
        Severity::Warning => "warning",
    };
    writeln!(out, "{}:{}: {severity}: {}", log.display(), finding.line, finding.detail)
}

fn print_totals_json(out: &mut impl Write, log: &Path, totals: LogTotals) -> io::Result<()> {
    #[derive(Serialize)]
    struct TotalsLine<'a> {
        log: &'a Path,
        clean: bool,
        #[serde(flatten)]
        totals: LogTotals,
    }
    serde_json::to_writer(&mut *out, &TotalsLine { log, clean: totals.problems == 0, totals })?;
    writeln!(out)
}

fn print_totals(
    out: &mut impl Write,
    log: &Path,
    totals: LogTotals,
    hidden: u64,
    torn: bool,
) -> io::Result<()> {
    let log = log.display();
    if hidden > 0 {
        writeln!(out, "{log}: {} more; use --all to list them", group_digits(hidden))?;
    }
    let LogTotals { lines, sessions, scans, pings, events, problems, warnings } = totals;
    let verdict = match (problems, warnings) {
        (0, 0) => "clean".into(),
        (0, warnings) => format!("clean, {}", format_count(warnings, "warning")),
        (problems, 0) => format!("not clean: {}", format_count(problems, "problem")),
        (problems, warnings) => format!(
            "not clean: {}, {}",
            format_count(problems, "problem"),
            format_count(warnings, "warning")
        ),
    };
    let contents = [(sessions, "session"), (scans, "scan"), (pings, "reading"), (events, "event")]
        .map(|(count, noun)| format_count(count, noun))
        .join(", ");
    writeln!(out, "{log}: {verdict} ({}: {contents})", format_count(lines, "line"))?;
    let written_now = torn && File::open(log.to_string()).is_ok_and(|file| is_locked(&file));
    match (torn, written_now) {
        (true, true) => {
            writeln!(out, "{log}: file in use; check again when it is complete")
        }
        (true, false) => {
            writeln!(out, "{log}: `sonard log repair {log}` removes the incomplete last line")
        }
        _ => Ok(()),
    }
}

//! `sonard log show`.

mod follow;
mod readings;
mod summary;
mod text;

use std::{
    io::{self, Write},
    path::PathBuf,
};

use super::super::progress;
use super::{Failure, Outcome};
use crate::store::{StoreError, open_for_reading, read_log};
use readings::Readings;
use summary::Summary;

/// Options of `sonard log show`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli) struct Args {
    /// The log; - for standard input
    log: PathBuf,
    /// List every reading
    #[arg(long)]
    readings: bool,
    /// Follow a growing log; its current contents are printed first, line by line
    #[arg(long, conflicts_with = "json")]
    follow: bool,
    /// JSON instead of text; one object per session, scan, event and damaged line
    #[arg(long, conflicts_with = "readings")]
    json: bool,
}

const HELP: &str = "\
Columns: echo, min (at minimum range), none (no echo), lost (by the link) and uncertain (motor \
steps may be lost) count readings; |res| is the median distance between measured and predicted \
range; time/limit is the scan's duration and its physical minimum.
Lines that are not records are \
listed at the end; `sonard log verify` checks the rest.

Exit codes: 0 shown, 2 the file can't be \
opened.";

pub(super) fn run(args: &Args) -> Outcome {
    if args.follow {
        return follow(args);
    }
    let summary = read(args)?;
    let mut out = io::stdout().lock();
    let printed = if args.json {
        summary.items.iter().try_for_each(|item| {
            serde_json::to_writer(&mut out, item)?;
            writeln!(out)
        })
    } else if args.readings {
        let readings = Readings::open(&args.log)?;
        text::print(&mut out, &summary, Some(readings))
    } else {
        text::print(&mut out, &summary, None)
    };
    printed.or_else(|error| Failure::from_write("standard output", &error))
}

/// Reads the log once; readings are listed in a second pass.
fn read(args: &Args) -> Result<Summary, Failure> {
    if args.readings && args.log.as_os_str() == "-" {
        return Err(Failure::input(
            "--readings does not work with standard input, which can be read only once",
            "give the log's file name, or use --follow",
        ));
    }
    let mut summary = Summary::default();
    for line in read_log(progress::reading(&args.log, open_for_reading(&args.log)?)) {
        let line = line.map_err(|source| StoreError::Read { path: args.log.clone(), source })?;
        match line.record {
            Ok(record) => summary.add(record),
            Err(error) => summary.damaged(&error.reject_other_format(&args.log)?),
        }
    }
    Ok(summary.finish())
}

fn follow(args: &Args) -> Outcome {
    let reader = if args.log.as_os_str() == "-" {
        open_for_reading(&args.log)?
    } else {
        follow::open(&args.log)?
    };
    let mut out = io::stdout().lock();
    for line in read_log(reader) {
        let line = line.map_err(|source| StoreError::Read { path: args.log.clone(), source })?;
        let printed = text::print_line(&mut out, &line, args.readings).and_then(|()| out.flush());
        if let Err(error) = printed {
            return Failure::from_write("standard output", &error);
        }
    }
    Ok(())
}

//! `sonard log show`.

mod follow;
mod summary;
mod text;

use std::{
    io::{self, Write},
    path::PathBuf,
};

use super::{Failure, Outcome};
use crate::store::{StoreError, load, open_for_reading, read_log};
use summary::Summary;

/// Options of `sonard log show`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli) struct Args {
    /// The log; - for standard input
    log: PathBuf,
    /// List every reading too
    #[arg(long)]
    pings: bool,
    /// Print what is in the log line by line, and go on as records are added
    #[arg(long, conflicts_with = "json")]
    follow: bool,
    /// One JSON object for each session, scan, event and damaged line
    #[arg(long, conflicts_with = "pings")]
    json: bool,
}

const HELP: &str = "\
Columns: echo, min (at minimum range), none (no echo), lost (the link) and doubt (the motor may \
have lost steps) count readings; |res| is the median distance between measured and predicted \
range; time/limit is the scan's duration over what the acoustics allow.
Lines that are no records are listed at the end; `sonard log verify` checks the rest.
Exit codes: 0 shown, 2 the file can't be opened.";

pub(super) fn run(args: &Args) -> Outcome {
    if args.follow {
        return follow(args);
    }
    let loaded = load(&args.log)?;
    let summary = Summary::of(&loaded);
    let mut out = io::stdout().lock();
    let printed = if args.json {
        summary.items.iter().try_for_each(|item| {
            serde_json::to_writer(&mut out, item)?;
            writeln!(out)
        })
    } else {
        text::print(&mut out, &summary, args.pings.then_some(&loaded))
    };
    printed.or_else(|error| Failure::from_write("standard output", &error))
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
        let printed = text::print_line(&mut out, &line, args.pings).and_then(|()| out.flush());
        if let Err(error) = printed {
            return Failure::from_write("standard output", &error);
        }
    }
    Ok(())
}

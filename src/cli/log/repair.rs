//! `sonard log repair`.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use super::{Failure, Outcome};
use crate::scan::text::format_count;
use crate::store::{Repair, repair};

/// Options of `sonard log repair`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli) struct Args {
    /// The log
    log: PathBuf,
}

const HELP: &str = "\
All complete records are kept byte for byte, in order. An incomplete last line and lines that are \
not records are removed; a complete JSON object with a type is kept even if this version can't \
read it. The original log is kept as LOG.orig (or LOG.orig-2, ...). The repaired file replaces the \
log atomically; a log without faults is not modified.

Exit codes: 0 all complete records were kept (at most an incomplete last line was removed), 1 \
other lines were removed (listed), 2 the file can't be opened, 3 file in use, or disk error.";

pub(super) fn run(args: &Args) -> Outcome {
    if args.log == Path::new("-") {
        return Err(Failure::input("standard input can't be repaired", "give the log's file name"));
    }
    let done = repair(&args.log)?;
    if let Err(error) = print(&mut io::stdout().lock(), &args.log, &done) {
        Failure::from_write("standard output", &error)?;
    }
    if done.removed.is_empty() { Ok(()) } else { Err(Failure::Found(None)) }
}

fn print(out: &mut impl Write, log: &Path, done: &Repair) -> io::Result<()> {
    let name = log.display();
    for left in &done.removed {
        writeln!(
            out,
            "{name}:{}: removed {} at byte {}: {}",
            left.line,
            format_count(left.length, "byte"),
            left.offset,
            left.fault
        )?;
    }
    if let Some(torn) = &done.torn {
        let (line, length, offset) = (torn.line, format_count(torn.length, "byte"), torn.offset);
        writeln!(out, "{name}:{line}: incomplete last line removed, {length} at byte {offset}")?;
    }
    if done.newline_added {
        writeln!(out, "{name}: the last record was complete; newline added")?;
    }
    for error in &done.kept_unread {
        let (line, fault) = (error.line, &error.fault);
        writeln!(out, "{name}:{line}: kept, unreadable by this version: {fault}")?;
    }
    let kept = format_count(done.kept + done.kept_unread.len() as u64, "record");
    match &done.original {
        Some(original) => {
            writeln!(out, "{name}: {kept} kept; the original is {}", original.display())
        }
        None => writeln!(out, "{name}: {kept}, nothing to repair"),
    }
}

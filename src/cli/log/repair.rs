//! `sonard log repair`.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use super::{Failure, Outcome};
use crate::store::{Repair, repair};

/// Options of `sonard log repair`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(in crate::cli) struct Args {
    /// The log
    log: PathBuf,
}

const HELP: &str = "\
Every whole record is kept byte for byte, in order; a torn last line and lines that are no records \
are left out; a whole JSON object with a type is kept even if this version can't read it. The log as it was stays beside it as LOG.orig (or LOG.orig-2, ...). The repaired \
file takes the log's place in one step; a log that needs nothing is not touched.

Exit codes: 0 every whole record is kept (at most a torn last line was left out), 1 something else \
had to be left out (listed), 2 the file can't be opened, 3 somebody is writing it, or the disk failed.";

pub(super) fn run(args: &Args) -> Outcome {
    if args.log == Path::new("-") {
        return Err(Failure::input("standard input can't be repaired", "name the log's file"));
    }
    let done = repair(&args.log)?;
    if let Err(error) = print(&mut io::stdout().lock(), &args.log, &done) {
        Failure::from_write("standard output", &error)?;
    }
    if done.left_out.is_empty() { Ok(()) } else { Err(Failure::Found(None)) }
}

fn print(out: &mut impl Write, log: &Path, done: &Repair) -> io::Result<()> {
    let name = log.display();
    for left in &done.left_out {
        writeln!(
            out,
            "{name}:{}: left out {} byte(s) at byte {}: {}",
            left.line, left.length, left.offset, left.fault
        )?;
    }
    if let Some(torn) = &done.torn {
        let (line, length, offset) = (torn.line, torn.length, torn.offset);
        writeln!(out, "{name}:{line}: torn last line left out, {length} byte(s) at byte {offset}")?;
    }
    if done.newline_added {
        writeln!(out, "{name}: the last record was whole; its newline is added")?;
    }
    for error in &done.kept_unread {
        let (line, fault) = (error.line, &error.fault);
        writeln!(out, "{name}:{line}: kept, though this version can't read it: {fault}")?;
    }
    let kept = done.kept + done.kept_unread.len() as u64;
    match &done.original {
        Some(original) => {
            writeln!(out, "{name}: {kept} record(s) kept; the original is {}", original.display())
        }
        None => writeln!(out, "{name}: {kept} record(s), nothing to repair"),
    }
}

//! `sonard report`.

mod entries;
mod system;

use std::{
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use flate2::{Compression, write::GzEncoder};
use jiff::Timestamp;

use super::{
    Failure, Outcome,
    daemon::DaemonArgs,
    output::{OutPath, Overwrite, Product},
    prompt,
    table::{align_right, fit, plain},
};
use crate::scan::text::format_count;
use entries::Entry;

/// Options of `sonard report`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs whose last lines are included, in addition to the daemon's current one
    #[arg(value_name = "LOG")]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    daemon: DaemonArgs,
    /// Configuration file [default: /etc/sonard/sonard.toml, if it exists]
    #[arg(long, value_name = "FILE", env = "SONARD_CONFIG")]
    config: Option<PathBuf>,
    /// Serial port of the ranger: a path, a name in /dev/serial/by-id, or a USB serial number;
    /// checked as by `sonard doctor --no-motion`
    #[arg(long, value_name = "PATH|ID")]
    port: Option<String>,
    /// Number of lines of each log, from its end
    #[arg(long, value_name = "N", default_value_t = 200)]
    lines: usize,
    /// File to write; a gzipped tar archive [default: sonard-report-TIME.tar.gz]
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print the contents of the archive, and write nothing
    #[arg(long, conflicts_with_all = ["output", "yes"])]
    list: bool,
    /// Continue without a prompt; at a terminal, too
    #[arg(long)]
    yes: bool,
}

pub(super) const ABOUT: &str = "\
Collect what a bug report needs in one archive.

It contains versions, the effective configuration, state and health of the daemon, its last \
messages, the last lines of its log, the serial ports and what the kernel reported of them, and \
with --port the checks of `sonard doctor`, without motion. Tokens, passwords and keys are in files \
that the configuration names; these files are not read. A log contains its scene. The contents are \
listed before anything is written, and at a terminal you confirm it. What can't be collected is \
stated in its place.";

const HELP: &str = "\
Examples:
  sonard report
  sonard report --list
  sonard report --port /dev/ttyACM0 -o report.tar.gz
  sonard report out/fig9/scan.jsonl --lines 1000 --yes

A log of a report can be replayed with `sonard mock --replay`.

Exit codes: 0 written (or listed), 1 not confirmed, 2 wrong usage or input, 3 write error.";

pub(super) fn run(args: &Args) -> Outcome {
    let now = Timestamp::now();
    let default =
        || PathBuf::from(format!("sonard-report-{}.tar.gz", now.strftime("%Y%m%dT%H%M%SZ")));
    let path = args.output.as_deref().map_or_else(default, Path::to_path_buf);
    if !args.list {
        args.overwrite.check(&path, Product::Log)?;
    }
    let entries = entries::collect(args, now)?;
    list(&entries)?;
    if args.list {
        return Ok(());
    }
    if !args.yes && !is_confirmed(&path)? {
        return Err(Failure::Found(Some("nothing was written".to_owned())));
    }
    let archive =
        pack(&entries, now).map_err(|error| Failure::unwritable(&path.display(), &error))?;
    args.overwrite.save(&path, Product::Log, &archive)?;
    print_line!(
        "wrote {} ({}); read it before you send it",
        path.display(),
        format_count(archive.len(), "byte")
    );
    Ok(())
}

fn list(entries: &[Entry]) -> Outcome {
    let mut table = plain(["file", "bytes", "contents"]);
    align_right(&mut table, 1..2);
    for entry in entries {
        table.add_row([entry.name.clone(), entry.bytes.len().to_string(), entry.about.clone()]);
    }
    writeln!(io::stdout(), "{}", fit(table))
        .or_else(|error| Failure::from_write("standard output", &error))
}

/// Prompts for a confirmation at a terminal; elsewhere the command is the confirmation.
fn is_confirmed(path: &Path) -> Result<bool, Failure> {
    if !prompt::is_interactive() {
        return Ok(true);
    }
    let answer = prompt::prompt(&format!("write {}? [Y/n]", path.display()))?;
    // The end of the input is no confirmation.
    Ok(answer.is_some_and(|answer| matches!(answer.to_lowercase().as_str(), "" | "y" | "yes")))
}

fn pack(entries: &[Entry], now: Timestamp) -> io::Result<Vec<u8>> {
    let mut archive = tar::Builder::new(GzEncoder::new(Vec::new(), Compression::default()));
    for entry in entries {
        let mut header = tar::Header::new_gnu();
        header.set_size(entry.bytes.len() as u64);
        header.set_mode(0o644);
        header.set_mtime(now.as_second().max(0).unsigned_abs());
        archive.append_data(&mut header, format!("sonard-report/{}", entry.name), &*entry.bytes)?;
    }
    archive.into_inner()?.finish()
}

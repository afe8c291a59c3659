//! `sonard export`.

use std::{
    ffi::OsStr,
    path::{Path, PathBuf},
};

use super::{
    Failure, Outcome,
    logs::{for_each_scan, logs_in},
    output::{OutPath, Overwrite, Product, Stream},
};
use crate::export::{CsvExport, Export, ExportError};

/// Options of `sonard export`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs, folders of a daemon's logs, folders of collections; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Format to write [default: as the ending of the output says]
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Option<FormatName>,
    /// File to write; the export goes to it instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormatName {
    /// A table: a reading a line, its prediction beside it
    Csv,
}

pub(super) const ABOUT: &str = "\
Write logs for other tools: tables.

All logs go into one output, scan by scan in their order. Of a folder the logs in it are taken, of a \
collection's those in its folder `scans`, in the order of their names.";

const HELP: &str = "\
Examples:
  sonard export out/fig7/scan.jsonl -o readings.csv
  sonard export trial -o trial.csv                    # a collection, or a daemon's folder
  sonard simulate --scene corridor --pose beside-wall | sonard export - --to csv | head -n 3

A column has the name that the field has in the log, with the unit in it; those that begin with sim_ are \
the prediction's. What the log does not say is empty: no range is no number.

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    let format = args.format()?;
    let logs = logs_in(&args.logs)?;
    let mut stream = match args.output.as_deref() {
        Some(path) => args.overwrite.begin(path, format.product())?,
        None => Stream::standard(),
    };
    let to = args.output.as_deref().unwrap_or(Path::new("standard output"));
    let refuse = |error: ExportError| match error {
        ExportError::Write(error) => Failure::from_write(&to.display().to_string(), &error),
        error @ ExportError::Attach { .. } => {
            Err(Failure::input(error, "give logs that nobody writes meanwhile"))
        }
    };
    match write(&logs, format, &mut stream) {
        Ok(told) => {
            stream.finish().or_else(|error| refuse(error.into()))?;
            told.tell();
            Ok(())
        }
        Err(Stop::Input(failure)) => Err(failure),
        Err(Stop::Export(error)) => refuse(error),
    }
}

impl Args {
    fn format(&self) -> Result<FormatName, Failure> {
        let path = self.output.as_deref();
        let ending = path.and_then(Path::extension).map(OsStr::to_ascii_lowercase);
        let by_ending = match ending.as_deref().and_then(OsStr::to_str) {
            Some("csv") => Some(FormatName::Csv),
            _ => None,
        };
        let format = self.to.or(by_ending).ok_or_else(|| {
            let what = path.map_or("no format is named".to_owned(), |path| {
                format!("{}: its ending says no format", path.display())
            });
            Failure::input(what, "say which with --to csv")
        })?;
        Ok(format)
    }
}

impl FormatName {
    const fn product(self) -> Product {
        match self {
            Self::Csv => Product::Table,
        }
    }
}

/// Why it ended before the last scan.
enum Stop {
    Input(Failure),
    Export(ExportError),
}

impl From<ExportError> for Stop {
    fn from(error: ExportError) -> Self {
        Self::Export(error)
    }
}

/// What was written.
#[derive(Debug, Default)]
struct Told {
    logs: usize,
    scans: usize,
    readings: usize,
}

impl Told {
    fn tell(&self) {
        let Self { logs, scans, readings } = self;
        anstream::eprintln!("{logs} logs, {scans} scans, {readings} readings");
    }
}

/// Writes all scans of the logs, and what belongs to the end.
fn write(logs: &[PathBuf], format: FormatName, stream: &mut Stream) -> Result<Told, Stop> {
    let mut export: Box<dyn Export + '_> = match format {
        FormatName::Csv => Box::new(CsvExport::new(stream)?),
    };
    let mut told = Told { logs: logs.len(), ..Told::default() };
    for log in logs {
        let name = name_of(log);
        let mut refused = None;
        let read = for_each_scan(log, |scan| match export.scan(&name, &scan) {
            Ok(None) => {
                told.scans += 1;
                told.readings += scan.pings.len();
                Ok(())
            }
            Ok(Some(why)) => {
                anstream::eprintln!("{}: scan {} is left out: {why}", log.display(), scan.scan);
                Ok(())
            }
            Err(error) => {
                refused = Some(error);
                Err(Failure::Found(None))
            }
        });
        if let Some(error) = refused {
            return Err(error.into());
        }
        read.map_err(Stop::Input)?;
    }
    if told.scans == 0 {
        return Err(Stop::Input(Failure::input(
            "there is no scan to export",
            "give logs as `sonard scan` or `sonard simulate` writes them",
        )));
    }
    export.finish()?;
    Ok(told)
}

/// What a log is called in its export.
fn name_of(log: &Path) -> String {
    log.file_name().unwrap_or(log.as_os_str()).to_string_lossy().into_owned()
}

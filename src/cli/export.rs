//! `sonard export`.

use std::{
    ffi::OsStr,
    fs::File,
    io::{self, IsTerminal as _},
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use super::{
    Failure, Outcome,
    logs::{for_each_scan, logs_in},
    output::{OutPath, Overwrite, Product, Stream},
};
use crate::{
    export::{
        AttachedLog, CsvExport, Export, ExportError, ExportSettings, McapExport, ParquetExport,
        Profile,
    },
    scan::text::format_count,
    store::COLLECTED_SCANS,
};

/// Options of `sonard export`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs, folders of a daemon's logs (or one per robot), of collections; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Format to write [default: from the output's file extension]
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Option<FormatName>,
    /// File to write; the export goes to it instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    recording: RecordingArgs,
}

#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(next_help_heading = "Recordings (mcap)")]
struct RecordingArgs {
    /// Encoding of no echo and of readings at minimum range in a Range
    #[arg(long, value_enum, value_name = "PROFILE")]
    profile: Option<ProfileName>,
    /// Field of view stated in a Range, degrees, full angle [default: the two-way 6 dB width of the
    /// beam]
    #[arg(long, value_name = "DEG", value_parser = parse_angle)]
    field_of_view_deg: Option<f64>,
    /// Frame of the transducer, prefix of the other frames [default: sonar]
    #[arg(long, value_name = "FRAME", value_parser = parse_frame)]
    frame: Option<String>,
    /// Omit the logs themselves from the recording
    #[arg(long)]
    without_log: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormatName {
    /// Recording of ROS 2: Range, LaserScan, PointCloud2, TF and markers, with the log attached
    Mcap,
    /// Table of typed columns: one reading per row, with its prediction
    Parquet,
    /// Table as text
    Csv,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ProfileName {
    /// Infinite ranges, as specified by REP 117
    Rep117,
    /// max_range for no echo and min_range at minimum range, as required by nav2's range layer
    Nav2,
}

pub(super) const ABOUT: &str = "\
Write logs for other tools: recordings of ROS 2 (MCAP), tables (Parquet, CSV).

All logs go into one output, scan by scan in their order. A folder is expanded to its logs in the \
order of their names: a collection to those in `scans`, a folder of robots' folders to those of \
each robot.";

const HELP: &str = "\
Examples:
  sonard export out/fig7/scan.jsonl -o fig7.mcap      # for RViz, Foxglove, rosbag2
  sonard export out/fig7/scan.jsonl -o readings.csv
  sonard export trial -o trial.parquet                # a collection, or a daemon's folder
  sonard simulate --scene corridor --pose beside-wall | sonard export - --to csv | head -n 3

A recording has /sonar/range (for arrays /sonar/RANGER/range), /sonar/scan, /sonar/points, \
/sonar/paths, /tf, /tf_static, and predictions below /sonar/predicted. Stamps are the times of the \
pings. A sonar is not a laser: see docs/export.md before building a map from its scans.

Columns of tables have the names of the fields in the log, with their units; those that begin with \
sim_ are predictions. Cells without a value in the log are empty. Parquet has typed columns, and \
the sessions' records in the file's metadata; it is smaller, and faster for many readings.

Exit codes: 0 done, 2 wrong usage or input, 3 write error.";

pub(super) fn run(args: &Args) -> Outcome {
    let format = args.format()?;
    args.check(format)?;
    let logs = logs_in(&args.logs)?;
    let mut stream = match args.output.as_deref() {
        Some(path) => args.overwrite.begin(path, format.product())?,
        None => Stream::standard(),
    };
    let to = args.output.as_deref().unwrap_or(Path::new("standard output"));
    let failure_from = |error: ExportError| match error {
        ExportError::Write(error) => Failure::from_write(&to.display().to_string(), &error),
        error @ ExportError::Attach { .. } => {
            Err(Failure::input(error, "give logs that are not being written"))
        }
    };
    match write(&logs, format, args, &mut stream) {
        Ok(counts) => {
            stream.finish().or_else(|error| failure_from(error.into()))?;
            counts.print();
            Ok(())
        }
        Err(ExportFailure::Input(failure)) => Err(failure),
        Err(ExportFailure::Export(error)) => failure_from(error),
    }
}

impl Args {
    fn format(&self) -> Result<FormatName, Failure> {
        let path = self.output.as_deref();
        let ending = path.and_then(Path::extension).map(OsStr::to_ascii_lowercase);
        let by_ending = match ending.as_deref().and_then(OsStr::to_str) {
            Some("mcap") => Some(FormatName::Mcap),
            Some("parquet") => Some(FormatName::Parquet),
            Some("csv") => Some(FormatName::Csv),
            _ => None,
        };
        let format = self.to.or(by_ending).ok_or_else(|| {
            let what = path.map_or("no format is given".to_owned(), |path| {
                format!("{}: unknown file extension", path.display())
            });
            Failure::input(what, "choose a format with --to mcap, --to parquet or --to csv")
        })?;
        Ok(format)
    }

    /// Rejects options that the format does not support, before any work.
    fn check(&self, format: FormatName) -> Outcome {
        let is_binary = matches!(format, FormatName::Mcap | FormatName::Parquet);
        if is_binary && self.output.is_none() && io::stdout().is_terminal() {
            return Err(Failure::input(
                "recordings and Parquet tables can't be printed to a terminal",
                "name a file with -o",
            ));
        }
        match format == FormatName::Mcap || self.recording == RecordingArgs::NONE {
            true => Ok(()),
            false => Err(Failure::input(
                "--profile, --field-of-view-deg, --frame and --without-log apply to recordings only",
                "leave them out, or write a recording with --to mcap",
            )),
        }
    }
}

impl RecordingArgs {
    const NONE: Self =
        Self { profile: None, field_of_view_deg: None, frame: None, without_log: false };

    fn settings(&self) -> ExportSettings {
        let by_default = ExportSettings::default();
        ExportSettings {
            profile: match self.profile {
                Some(ProfileName::Nav2) => Profile::Nav2,
                Some(ProfileName::Rep117) | None => Profile::Rep117,
            },
            field_of_view_deg: self.field_of_view_deg,
            frame: self.frame.clone().unwrap_or(by_default.frame),
            ..ExportSettings::default()
        }
    }
}

fn parse_angle(text: &str) -> Result<f64, String> {
    let angle = text.parse().ok().filter(|deg: &f64| *deg > 0.0 && *deg <= 360.0);
    angle.ok_or_else(|| "give degrees, more than 0 and at most 360".to_owned())
}

/// Parses a frame name as tf2 requires it: without a leading slash.
fn parse_frame(text: &str) -> Result<String, String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '/';
    match !text.is_empty() && !text.starts_with('/') && text.chars().all(plain) {
        true => Ok(text.to_owned()),
        false => {
            Err("give letters, digits, underscores and slashes, without a leading slash".to_owned())
        }
    }
}

impl FormatName {
    const fn product(self) -> Product {
        match self {
            Self::Mcap => Product::Recording,
            Self::Parquet => Product::TypedTable,
            Self::Csv => Product::Table,
        }
    }
}

/// Reason for an early end.
enum ExportFailure {
    Input(Failure),
    Export(ExportError),
}

impl From<ExportError> for ExportFailure {
    fn from(error: ExportError) -> Self {
        Self::Export(error)
    }
}

/// Numbers of exported logs, scans and readings.
#[derive(Debug, Default)]
struct ExportCounts {
    logs: usize,
    scans: usize,
    readings: usize,
}

impl ExportCounts {
    fn print(&self) {
        let Self { logs, scans, readings } = *self;
        notice!(
            "{}, {}, {}",
            format_count(logs, "log"),
            format_count(scans, "scan"),
            format_count(readings, "reading")
        );
    }
}

/// Writes all scans of the logs, and finishes the output.
fn write(
    logs: &[PathBuf],
    format: FormatName,
    args: &Args,
    stream: &mut Stream,
) -> Result<ExportCounts, ExportFailure> {
    let mut export: Box<dyn Export + '_> = match format {
        FormatName::Mcap => Box::new(McapExport::new(stream, args.recording.settings())?),
        FormatName::Parquet => Box::new(ParquetExport::new(stream)?),
        FormatName::Csv => Box::new(CsvExport::new(stream)?),
    };
    let mut counts = ExportCounts { logs: logs.len(), ..ExportCounts::default() };
    for log in logs {
        let name = export_name(log, &args.logs);
        let mut rejected = None;
        let read = for_each_scan(log, |scan| match export.scan(&name, &scan) {
            Ok(None) => {
                counts.scans += 1;
                counts.readings += scan.pings.len();
                Ok(())
            }
            Ok(Some(why)) => {
                notice!("{}: scan {} is skipped: {why}", log.display(), scan.scan);
                Ok(())
            }
            Err(error) => {
                rejected = Some(error);
                Err(Failure::Found(None))
            }
        });
        if let Some(error) = rejected {
            return Err(error.into());
        }
        read.map_err(ExportFailure::Input)?;
        if format == FormatName::Mcap && !args.recording.without_log && log.is_file() {
            attach(&mut *export, log, &name)?;
        }
    }
    if counts.scans == 0 {
        return Err(ExportFailure::Input(Failure::input(
            "there are no scans to export",
            "give logs as `sonard scan` or `sonard simulate` writes them",
        )));
    }
    export.finish()?;
    Ok(counts)
}

/// Attaches a log, up to its current end.
fn attach(export: &mut dyn Export, log: &Path, name: &str) -> Result<(), ExportFailure> {
    let opened = File::open(log).and_then(|file| {
        let metadata = file.metadata()?;
        Ok((file, metadata.len(), metadata.modified()?))
    });
    let (mut file, bytes, written) =
        opened.map_err(|source| ExportError::Attach { name: log.display().to_string(), source })?;
    let written = Timestamp::try_from(written).unwrap_or(Timestamp::UNIX_EPOCH);
    Ok(export.attach(&AttachedLog { name, bytes, modified: written }, &mut file)?)
}

/// Name of a log in the export: its file name, preceded by the robot's folder if the log is from a
/// folder of robots' folders, because logs of different robots may share a file name.
fn export_name(log: &Path, given: &[PathBuf]) -> String {
    let name = log.file_name().unwrap_or(log.as_os_str()).to_string_lossy();
    let is_given = |folder: &&Path| given.iter().any(|path| path == folder);
    let robot = log.parent().filter(|robot| robot.parent().as_ref().is_some_and(is_given));
    let robot = robot.and_then(Path::file_name).filter(|robot| *robot != COLLECTED_SCANS);
    robot.map_or_else(|| name.to_string(), |robot| format!("{}/{name}", robot.to_string_lossy()))
}

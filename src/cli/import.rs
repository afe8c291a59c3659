//! `sonard import`.

mod bag;
mod columns;
#[cfg(feature = "sqlite")]
mod database;

use std::{
    fs,
    io::{self, Read as _},
    path::{Path, PathBuf},
    sync::Arc,
};

use columns::ColumnArgs;
use jiff::Timestamp;

use super::{
    Failure, Outcome,
    array::load_array,
    options::{AirArgs, SensorArgs},
    output::{OutPath, Overwrite, closed, records_to},
    picture::Target,
    scene_file,
};
use crate::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    geometry::Pose,
    import::{Assumptions, ImportError, ImportSource, Imported, Mapping},
    plot::draw_scans,
    scan::{ImportRef, Provenance, Record, ScanView, Session, text::format_count},
    scene::{Scene, parse_pose},
    store::{RecordWriter, StoreError},
};

/// Options of `sonard import`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// The file, or the folder of a recording; - for standard input
    file: PathBuf,
    /// File to write; the log goes to it instead of to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    columns: ColumnArgs,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene; used where
    /// the file has none
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); used for predictions, and
    /// stored in the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// Array of rangers, a preset (`sonard array list`) or a file with an array's data; for a table
    /// with one range per ranger in each row, and for a CARMEN or Player log without the positions
    /// of its rangers
    #[arg(long, value_name = "NAME|FILE")]
    array: Option<String>,
    /// Skip the check that numbers are plausible in their declared units
    #[arg(long)]
    no_unit_check: bool,
    /// Examine the file and print all assumptions and omissions, but write no log
    #[arg(long, conflicts_with = "output")]
    dry_run: bool,
    /// Picture of the first scan on its floor plan, .svg or .png by its name
    #[arg(long, value_name = "FILE")]
    picture: Option<OutPath>,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    air: AirArgs,
}

pub(super) const ABOUT: &str = "\
Convert readings from other sources to a log: tables, JSON, messages of ROS as text, logs of CARMEN and Player, recordings of \
ROS 2.

The log is like any other, with provenance `imported`; its session states the source file and the \
meaning of its columns. Without --columns the meaning is taken from the header and printed. Every \
assumption and omission is printed, one per line; try --dry-run --picture first.svg. Ambiguous \
input is rejected with the option that resolves it: numbers that contradict their unit (radians \
for degrees, metres for centimetres), and constants that mean no echo (0, -1, 255, 65535, the \
sensor's maximum range). The same file always gives the same log.

Scans are separated by the field `scan`, or else by the robot's position, or else where the \
rotation reverses, jumps back or completes a revolution. Readings in random order need --unordered.

From a recording (MCAP, or a file or folder of rosbag2 in MCAP or SQLite) all sensor_msgs/Range \
are read, or else LaserScan. /tf and /tf_static give the pose of the ranger at each reading; \
readings outside their time span are skipped. A ranger that rotates on the robot makes scans; \
fixed rangers are an array. Ranges at or below min_range are at minimum range, those at or above \
max_range and those of 0 are no echo, NaN is no reading.";

const HELP: &str = "\
Fields: azimuth_deg|rad|grad (from the heading) or bearing_deg|rad|grad (in the world); range_m|cm|mm|in|ft (or dm|yd|um|km) or \
tof_us|ms|s; time (2026-01-31T12:00:00Z) or time_s|ms|us|ns (since 1970); scan; x_m|cm|mm, y_m|cm|mm, \
heading_deg|rad; temperature_c|k|f; status.

Examples:
  sonard import sweep.csv -o sweep.jsonl
  sonard import sweep.csv --columns azimuth_deg=1,range_cm=2 --clockwise --no-echo 255 \\
    --sensor hc-sr04 --pose 1.2,0.8,90 --scene my-room.json -o sweep.jsonl
  sonard import sweeps.json --columns scan=id,bearing_deg=bearings,range_m=ranges,x_m=at.0,y_m=at.1 \\
    -o sweeps.jsonl
  sonard import rosbag2_2026_01_31 --topic /front_sonar -o run.jsonl
  sonard import robot.clf --no-echo-from 5 --sensor pioneer -o robot.jsonl
  sonard import rounds.tsv --array pioneer-8 --columns range_m=1-8 -o rounds.jsonl
  sonard import wall.csv --columns time_ms=1,range_cm=2 --azimuth-deg 0 --started 2026-01-31T12:00:00Z -o wall.jsonl

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    let name = args.file.display().to_string();
    let failure_from =
        |error: ImportError| Failure::input(format!("{name}: {error}"), error.help());
    let mapping = args.columns.mapping()?;
    let scene = args.scene.as_deref().map(scene_file::load).transpose()?;
    let array = args.array.as_deref().map(load_array).transpose()?;
    let sensor = match &array {
        Some(array) => args.sensor.sensor_or(&array.sensor)?,
        None => args.sensor.sensor()?,
    };
    let air = args.air.air()?;
    let picture =
        args.picture.as_deref().map(|path| Target::new(path, args.overwrite)).transpose()?;
    let taken = taken(args, scene.as_ref(), array, &sensor, &air)?;
    let bytes = if args.file.as_os_str() == "-" { Some(standard_input()?) } else { None };
    let files = if args.file.is_dir() { bag::files(&args.file)? } else { vec![args.file.clone()] };
    bag::check(&files)?;
    let open = || -> io::Result<Box<dyn io::Read>> {
        Ok(match &bytes {
            Some(bytes) => Box::new(io::Cursor::new(Arc::clone(bytes))),
            None => bag::concatenate(&files)?,
        })
    };
    let mut found = ImportSource { open: &open }.examine(mapping, taken).map_err(failure_from)?;
    if let Some(sha256) =
        bag::digest_of_databases(&files).map_err(|error| failure_from(error.into()))?
    {
        found.assumptions.sha256 = sha256;
    }
    let session = session(args, &found, scene.as_ref(), sensor, &air);
    if let Some(picture) = &picture {
        let source = open().map_err(|error| failure_from(error.into()))?;
        let view = first_scan(&found, source, &session).map_err(failure_from)?;
        picture.write(&draw_scans(&view, scene.as_ref()), PICTURE_WIDTH_PX)?;
    }
    if args.dry_run {
        let source = open().map_err(|error| failure_from(error.into()))?;
        let scans = found.scans(source).map_err(failure_from)?;
        let scans =
            scans.map(|scan| scan.map(|_| 1_u64)).sum::<Result<u64, _>>().map_err(failure_from)?;
        report(args, &found, scans);
        return Ok(());
    }
    let mut out = records_to(args.output.as_deref(), args.overwrite)?;
    let source = open().map_err(|error| failure_from(error.into()))?;
    match write(&found, source, session, &mut *out) {
        Ok(scans) => {
            closed(out.finish())?;
            report(args, &found, scans);
            Ok(())
        }
        Err(ImportFailure::File(error)) => Err(failure_from(error)),
        Err(ImportFailure::Write(error @ StoreError::Record { .. })) => {
            Err(Failure::input(error, "correct the file"))
        }
        Err(ImportFailure::Write(error)) => closed(Err(error)),
    }
}

/// Reason for an early end.
enum ImportFailure {
    File(ImportError),
    Write(StoreError),
}

impl From<ImportError> for ImportFailure {
    fn from(error: ImportError) -> Self {
        Self::File(error)
    }
}

impl From<StoreError> for ImportFailure {
    fn from(error: StoreError) -> Self {
        Self::Write(error)
    }
}

/// Writes the session and all scans, and returns the number of scans.
fn write(
    found: &Imported,
    source: impl io::Read,
    session: Session,
    out: &mut dyn RecordWriter,
) -> Result<u64, ImportFailure> {
    out.write(&Record::Session(Box::new(session)))?;
    let mut scans = 0;
    for scan in found.scans(source)? {
        for record in scan? {
            out.write(&record)?;
        }
        scans += 1;
    }
    Ok(scans)
}

/// Returns `true` if the poses of the robot are known.
const fn has_poses(args: &Args, found: &Imported) -> bool {
    args.pose.is_some() || found.has_poses
}

/// Reads the first scan of a file, for a picture.
fn first_scan(
    found: &Imported,
    source: impl io::Read,
    session: &Session,
) -> Result<Vec<ScanView>, ImportError> {
    let mut records = vec![Record::Session(Box::new(session.clone()))];
    if let Some(scan) = found.scans(source)?.next() {
        records.extend(scan?);
    }
    Ok(ScanView::from_records(records))
}

/// Width of a PNG of the first scan, pixels.
const PICTURE_WIDTH_PX: u32 = 1000;

/// Prints assumptions, omissions and counts on standard error.
fn report(args: &Args, found: &Imported, scans: u64) {
    if found.is_inferred && !found.mapping.columns.is_empty() {
        let fields = found.mapping.columns.iter();
        let fields: Vec<_> = fields.map(|(field, column)| format!("{column} -> {field}")).collect();
        notice!("columns: {}", fields.join(", "));
    }
    for note in &found.notes {
        notice!("note: {note}");
    }
    if found.format.entry().has_columns && found.assumptions.array.is_none() {
        let Mapping { clockwise, zero_deg, azimuth_deg, .. } = found.mapping;
        if !clockwise && zero_deg == 0.0 && azimuth_deg.is_none() {
            notice!(
                "note: azimuths are counter-clockwise from the heading; --clockwise and --zero-deg change sense and zero"
            );
        }
    }
    let no_range = found.readings - found.echoes;
    notice!(
        "{}, {}: {} with a range, {no_range} without; sensor {}",
        format_count(scans, "scan"),
        format_count(found.readings, "reading"),
        found.echoes,
        found.assumptions.sensor
    );
    if !has_poses(args, found) {
        notice!("note: pose unknown: give --pose, or columns x_m, y_m and heading_deg");
    }
}

/// Reads standard input into memory, because a source is read more than once.
fn standard_input() -> Result<Arc<[u8]>, Failure> {
    let mut bytes = Vec::new();
    io::stdin().lock().take(MAX_STANDARD_INPUT_BYTES).read_to_end(&mut bytes).map_err(|error| {
        Failure::input(format!("cannot read standard input: {error}"), "give a file")
    })?;
    if bytes.len() as u64 == MAX_STANDARD_INPUT_BYTES {
        let what = format!("standard input is longer than {MAX_STANDARD_INPUT_BYTES} bytes");
        return Err(Failure::input(what, "give a file: files are not limited in size"));
    }
    Ok(bytes.into())
}

/// Maximum length of standard input, bytes.
const MAX_STANDARD_INPUT_BYTES: u64 = 256 << 20;

fn taken(
    args: &Args,
    scene: Option<&Scene>,
    array: Option<RangerArray>,
    sensor: &Sensor,
    air: &Air,
) -> Result<Assumptions, Failure> {
    let origin = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
    let pose = match (&args.pose, scene) {
        (Some(pose), Some(scene)) => scene_file::pose(scene, pose)?,
        (Some(pose), None) => {
            parse_pose(pose).map_err(|error| Failure::input(&error, error.help()))?
        }
        (None, _) => origin,
    };
    Ok(Assumptions {
        sha256: String::new(),
        pose,
        array,
        sensor: sensor.name.clone(),
        max_range_m: sensor.max_range_m,
        min_range_m: min_range_m(sensor, air),
        air: *air,
        started: started(&args.file),
        skip_checks: args.no_unit_check,
    })
}

/// Minimum range of a sensor, from its shortest blanking, metres.
fn min_range_m(sensor: &Sensor, air: &Air) -> f64 {
    let blanking_us = sensor.short_blanking_us.unwrap_or(f64::INFINITY).min(sensor.blanking_us);
    blanking_us * 1e-6 * air.sound_speed_m_s() / 2.0
}

/// Time of scans without times of their own: the modification time of the file.
fn started(file: &Path) -> Timestamp {
    let written = fs::metadata(file).and_then(|file| file.modified());
    written.ok().and_then(|time| Timestamp::try_from(time).ok()).unwrap_or_else(Timestamp::now)
}

fn session(
    args: &Args,
    found: &Imported,
    scene: Option<&Scene>,
    sensor: Sensor,
    air: &Air,
) -> Session {
    let mapping = match serde_json::to_value(&found.mapping) {
        Ok(serde_json::Value::Object(mapping)) => mapping,
        _ => serde_json::Map::new(),
    };
    let name = args.file.file_name().unwrap_or(args.file.as_os_str());
    let mut session = Session::new(found.assumptions.started, Provenance::Imported, sensor, air);
    session.array.clone_from(&found.assumptions.array);
    if let Some(scene) = scene {
        session.set_scene(scene);
    }
    session.imported = Some(Box::new(ImportRef {
        file: name.to_string_lossy().into_owned(),
        sha256: found.assumptions.sha256.clone(),
        mapping,
        poses_known: has_poses(args, found),
    }));
    session
}

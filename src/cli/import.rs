//! `sonard import`.

mod bag;
#[cfg(feature = "sqlite")]
mod database;

use std::{
    fs,
    io::{self, Read as _},
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::Timestamp;

use super::{
    Failure, Outcome,
    array::load_array,
    options::{AirArgs, SensorArgs},
    output::{OutPath, Overwrite, closed, records_to},
    scene_file,
};
use crate::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    import::{Format, ImportError, Imported, Mapping, Source, Taken},
    scan::{ImportRef, Provenance, Record, Session},
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
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene; as far as
    /// the file does not say
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); predicts in it whoever asks: it
    /// goes into the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// Array of rangers, a preset (`sonard array list`) or a file with an array's data; of a
    /// CARMEN or Player log that does not say where its rangers are
    #[arg(long, value_name = "NAME|FILE")]
    array: Option<String>,
    /// Accept the numbers as declared, even if they look wrong
    #[arg(long)]
    as_said: bool,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    air: AirArgs,
}

/// What the file's columns mean.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Columns")]
struct ColumnArgs {
    /// Meaning of the columns: FIELD=COLUMN,... with the number of the column, from 1, or its name; of JSON,
    /// the name of the member [default: as the header says]
    #[arg(long, value_name = "FIELD=COLUMN,...")]
    columns: Option<String>,
    /// Format of the file [default: guessed from its content]
    #[arg(long, value_enum)]
    format: Option<FormatName>,
    /// File (TOML) with all of this: the keys format, columns, topics, clockwise, zero_deg, none, none_from and
    /// sound_speed_m_s; options override it
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Topic of a recording to read; may be given several times [default: all Range but predictions, else LaserScan]
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
    /// Azimuths and bearings count clockwise
    #[arg(long)]
    clockwise: bool,
    /// Where azimuth zero points, degrees counter-clockwise from the heading (bearing zero: from the x axis)
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    zero_deg: Option<f64>,
    /// A range, in the file's unit, that means no echo; may be given several times
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    none: Vec<f64>,
    /// A range, in the file's unit, at and beyond which there is no echo
    #[arg(long, value_name = "VALUE")]
    none_from: Option<f64>,
    /// Speed of sound that the file's ranges were computed with, metres a second: they are computed again
    /// with that of the air
    #[arg(long, value_name = "M/S")]
    ranged_with: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormatName {
    /// Lines of values apart by commas, semicolons, tabs or blanks
    Csv,
    /// A list of objects, or an object a line; numbers or lists of numbers in them
    Json,
    /// The log of CARMEN
    Carmen,
    /// The log of Player
    Player,
    /// A recording of ROS 2 (MCAP or SQLite), of sensor_msgs/Range or LaserScan
    Mcap,
}

pub(super) const ABOUT: &str = "\
Convert readings from elsewhere to a log: tables, JSON, logs of CARMEN and Player, recordings of ROS 2.

The log is like any other, with provenance `imported`; its session states the source file and the meaning of its \
columns. Without --columns the meaning is taken from the header and shown. Numbers that contradict their stated \
unit (radians for degrees, centimetres for metres, a constant that stands for no echo) are refused. A file \
always makes the same log.

Scans are separated by the field `scan`, or else by the robot's position, or else by full turns.

Of a recording (MCAP, or a file or folder of rosbag2 in MCAP or SQLite) all sensor_msgs/Range are read, or else LaserScan; \
/tf and /tf_static must give the pose of the ranger at each reading. A ranger that turns on the robot makes \
scans; fixed rangers are an array. Ranges at or below min_range are too near, those at or above max_range no \
echo, NaN is no reading.";

const HELP: &str = "\
Fields: azimuth_deg|rad|grad (from the heading) or bearing_deg|rad|grad (in the world); range_m|cm|mm|in|ft or \
tof_us|ms|s; time (2026-01-31T12:00:00Z) or time_s|ms|us|ns (since 1970); scan; x_m|cm|mm, y_m|cm|mm, \
heading_deg|rad; temperature_c|k; status.

Examples:
  sonard import sweep.csv -o sweep.jsonl
  sonard import sweep.csv --columns azimuth_deg=1,range_cm=2 --clockwise --none 255 \\
    --sensor hc-sr04 --pose 1.2,0.8,90 --scene my-room.json -o sweep.jsonl
  sonard import sweeps.json --columns scan=id,bearing_deg=bearings,range_m=ranges,x_m=at.0,y_m=at.1 \\
    -o sweeps.jsonl
  sonard import rosbag2_2026_01_31 --topic /front_sonar -o run.jsonl
  sonard import robot.clf --none-from 5 --sensor pioneer -o robot.jsonl

Exit codes: 0 done, 2 wrong usage or input, 3 the disk gave up.";

pub(super) fn run(args: &Args) -> Outcome {
    let name = args.file.display().to_string();
    let refuse = |error: ImportError| Failure::input(format!("{name}: {error}"), error.help());
    let mapping = args.columns.mapping()?;
    let scene = args.scene.as_deref().map(scene_file::load).transpose()?;
    let (sensor, air) = (args.sensor.sensor()?, args.air.air()?);
    let taken = taken(args, scene.as_ref(), &sensor, &air)?;
    let bytes = if args.file.as_os_str() == "-" { Some(standard_input()?) } else { None };
    let files = if args.file.is_dir() { bag::files(&args.file)? } else { vec![args.file.clone()] };
    bag::check(&files)?;
    let open = || -> io::Result<Box<dyn io::Read>> {
        Ok(match &bytes {
            Some(bytes) => Box::new(io::Cursor::new(Arc::clone(bytes))),
            None => bag::one_after_the_other(&files)?,
        })
    };
    let mut found = Source { open: &open }.examine(mapping, taken).map_err(refuse)?;
    if let Some(sha256) = bag::digest_of_databases(&files).map_err(|error| refuse(error.into()))? {
        found.taken.sha256 = sha256;
    }
    let mut out = records_to(args.output.as_deref(), args.overwrite)?;
    let source = open().map_err(|error| refuse(error.into()))?;
    let session = session(args, &found, scene.as_ref(), sensor, &air);
    match write(&found, source, session, &mut *out) {
        Ok(scans) => {
            closed(out.finish())?;
            tell(&found, scans, has_poses(args, &found));
            Ok(())
        }
        Err(Stop::File(error)) => Err(refuse(error)),
        Err(Stop::Write(error @ StoreError::Record { .. })) => {
            Err(Failure::input(error, "correct the file"))
        }
        Err(Stop::Write(error)) => closed(Err(error)),
    }
}

/// Why it ended before the last scan.
enum Stop {
    File(ImportError),
    Write(StoreError),
}

impl From<ImportError> for Stop {
    fn from(error: ImportError) -> Self {
        Self::File(error)
    }
}

impl From<StoreError> for Stop {
    fn from(error: StoreError) -> Self {
        Self::Write(error)
    }
}

/// Writes the session and all scans; how many these are.
fn write(
    found: &Imported,
    source: impl io::Read,
    session: Session,
    out: &mut dyn RecordWriter,
) -> Result<u64, Stop> {
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

/// Whether it is known where the robot stood.
const fn has_poses(args: &Args, found: &Imported) -> bool {
    args.pose.is_some() || found.has_poses
}

/// Says what was taken for what, on standard error.
fn tell(found: &Imported, scans: u64, has_poses: bool) {
    if found.guessed && !found.mapping.columns.is_empty() {
        let said = found.mapping.columns.iter();
        let said: Vec<_> = said.map(|(field, column)| format!("{field} from {column}")).collect();
        notice!("by the header: {}", said.join(", "));
    }
    let silent = found.readings - found.echoes;
    notice!(
        "{scans} scans, {} readings: {} with a range, {silent} without; sensor {}",
        found.readings,
        found.echoes,
        found.taken.sensor
    );
    if !has_poses {
        notice!(
            "note: where the robot stood is not known: give --pose, or columns x_m, y_m and heading_deg"
        );
    }
}

/// All of standard input: a file is read more than once.
fn standard_input() -> Result<Arc<[u8]>, Failure> {
    let mut bytes = Vec::new();
    io::stdin().lock().take(MOST_STANDARD_INPUT).read_to_end(&mut bytes).map_err(|error| {
        Failure::input(format!("cannot read standard input: {error}"), "give a file")
    })?;
    if bytes.len() as u64 == MOST_STANDARD_INPUT {
        let what = format!("standard input is longer than {MOST_STANDARD_INPUT} bytes");
        return Err(Failure::input(what, "give a file: what it holds is read piece by piece"));
    }
    Ok(bytes.into())
}

/// So much of standard input is kept, bytes.
const MOST_STANDARD_INPUT: u64 = 256 << 20;

fn taken(args: &Args, scene: Option<&Scene>, sensor: &Sensor, air: &Air) -> Result<Taken, Failure> {
    let origin = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
    let pose = match (&args.pose, scene) {
        (Some(pose), Some(scene)) => scene_file::pose(scene, pose)?,
        (Some(pose), None) => {
            parse_pose(pose).map_err(|error| Failure::input(&error, error.help()))?
        }
        (None, _) => origin,
    };
    Ok(Taken {
        sha256: String::new(),
        pose,
        array: args.array.as_deref().map(load_array).transpose()?,
        sensor: sensor.name.clone(),
        longest_m: sensor.max_range_m,
        air: *air,
        started: started(&args.file),
        as_said: args.as_said,
    })
}

/// When scans were taken that do not say it: at the latest when their file was last written.
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
    let mut session = Session::new(found.taken.started, Provenance::Imported, sensor, air);
    session.array.clone_from(&found.taken.array);
    if let Some(scene) = scene {
        session.set_scene(scene);
    }
    session.imported = Some(Box::new(ImportRef {
        file: name.to_string_lossy().into_owned(),
        sha256: found.taken.sha256.clone(),
        mapping,
        poses_known: has_poses(args, found),
    }));
    session
}

impl ColumnArgs {
    fn mapping(&self) -> Result<Mapping, Failure> {
        let mut mapping = match &self.mapping {
            Some(path) => read_mapping(path)?,
            None => Mapping::default(),
        };
        if let Some(columns) = &self.columns {
            mapping.columns = Mapping::columns_of(columns)
                .map_err(|error| Failure::input(format!("--columns: {error}"), error.help()))?;
        }
        let format = self.format.map(|format| match format {
            FormatName::Csv => Format::Csv,
            FormatName::Json => Format::Json,
            FormatName::Carmen => Format::Carmen,
            FormatName::Player => Format::Player,
            FormatName::Mcap => Format::Mcap,
        });
        mapping.format = format.or(mapping.format);
        if !self.topic.is_empty() {
            mapping.topics.clone_from(&self.topic);
        }
        mapping.clockwise |= self.clockwise;
        mapping.zero_deg = self.zero_deg.unwrap_or(mapping.zero_deg);
        if !self.none.is_empty() {
            mapping.none.clone_from(&self.none);
        }
        mapping.none_from = self.none_from.or(mapping.none_from);
        mapping.sound_speed_m_s = self.ranged_with.or(mapping.sound_speed_m_s);
        if let Some(speed) =
            mapping.sound_speed_m_s.filter(|speed| !(200.0..=500.0).contains(speed))
        {
            let what = format!("ranges computed with a speed of sound of {speed} m/s");
            return Err(Failure::input(what, "give metres a second, 200 to 500"));
        }
        Ok(mapping)
    }
}

fn read_mapping(path: &Path) -> Result<Mapping, Failure> {
    let name = path.display();
    let text = fs::read_to_string(path).map_err(|error| {
        Failure::input(format!("cannot read {name}: {error}"), "give a TOML file")
    })?;
    toml::from_str(&text).map_err(|error| {
        Failure::input(format!("{name}: {error}"), "see `sonard import --help` for its keys")
    })
}

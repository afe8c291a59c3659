//! Columns of exported tables, shared by all table formats.
//!
//! Names are those of the log records, with the unit; fields of `sim` are prefixed by `sim_`.
//! Values missing in the log are empty cells, never special numbers.

use std::borrow::Cow;

use jiff::Timestamp;
use serde::Serialize;

use sonard_model::{geometry::Pose, viewpoint::Viewpoint};
use sonard_records::{CrosstalkRecord, PathRecord, Ping, ScanView, Session, SimRecord};

/// Reading with the context of its scan.
#[derive(Debug, Clone, Copy)]
pub struct ReadingRow<'a> {
    /// File name of the log.
    log: &'a str,
    /// Number of the session among the exported ones, from 1.
    session: Option<u32>,
    scan: &'a ScanView,
    ping: &'a Ping,
    viewpoint: Option<Viewpoint>,
}

impl<'a> ReadingRow<'a> {
    /// Creates the row of a reading.
    pub(crate) fn new(
        log: &'a str,
        session: Option<u32>,
        scan: &'a ScanView,
        ping: &'a Ping,
    ) -> Self {
        Self { log, session, scan, ping, viewpoint: scan.viewpoint(ping) }
    }

    fn session_record(&self) -> Option<&'a Session> {
        self.scan.session.as_deref()
    }

    /// Returns the pose of the robot at the firing.
    fn pose(&self) -> Option<Pose> {
        self.ping.pose.or_else(|| self.scan.pose())
    }

    fn sim(&self) -> Option<&'a SimRecord> {
        self.ping.sim.as_ref()
    }

    fn sim_path(&self) -> Option<&'a PathRecord> {
        self.sim()?.path.as_ref()
    }

    fn sound_speed_m_s(&self) -> Option<f64> {
        let of_scan = self.scan.start.as_ref().and_then(|start| start.air);
        let session_air = || self.session_record().map(|session| session.air.sound_speed_m_s);
        of_scan.map(|air| air.sound_speed_m_s).or_else(session_air)
    }

    fn temperature_c(&self) -> Option<f64> {
        let of_scan = self.scan.start.as_ref().and_then(|start| start.air);
        let session_air = || self.session_record().map(|session| session.air.temperature_c);
        of_scan.map(|air| air.temperature_c).or_else(session_air)
    }
}

/// Type of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text, encoded as UTF-8.
    Text,
    /// Signed 64-bit integer.
    Integer,
    /// Finite double-precision number.
    Number,
    /// Truth value of a flag.
    Flag,
    /// Time with nanosecond resolution.
    Time,
    /// Possibly empty list of unsigned integers.
    Integers,
    /// Possibly empty list of finite single-precision numbers.
    Numbers,
}

/// Value of a cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Value<'a> {
    /// Value of a [`ColumnKind::Text`] column.
    Text(Cow<'a, str>),
    /// Value of a [`ColumnKind::Integer`] column.
    Integer(i64),
    /// Value of a [`ColumnKind::Number`] column.
    Number(f64),
    /// Value of a [`ColumnKind::Flag`] column.
    Flag(bool),
    /// Value of a [`ColumnKind::Time`] column.
    Time(Timestamp),
    /// Value of a [`ColumnKind::Integers`] column.
    Integers(&'a [u32]),
    /// Value of a [`ColumnKind::Numbers`] column.
    Numbers(&'a [f32]),
}

impl Value<'_> {
    /// Returns the kind of column that the value belongs to.
    #[must_use]
    pub const fn kind(&self) -> ColumnKind {
        match self {
            Self::Text(_) => ColumnKind::Text,
            Self::Integer(_) => ColumnKind::Integer,
            Self::Number(_) => ColumnKind::Number,
            Self::Flag(_) => ColumnKind::Flag,
            Self::Time(_) => ColumnKind::Time,
            Self::Integers(_) => ColumnKind::Integers,
            Self::Numbers(_) => ColumnKind::Numbers,
        }
    }
}

/// Name and type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColumnType {
    /// Column name, with the unit.
    pub name: &'static str,
    /// Type of the cells.
    pub kind: ColumnKind,
    /// True if single precision is sufficient; binary formats then store four bytes instead of
    /// eight.
    pub is_single: bool,
}

/// Column of a table of readings.
#[derive(Debug, Clone, Copy)]
pub struct TableColumn {
    /// Column name, with the unit.
    pub name: &'static str,
    /// Type of the cells.
    pub kind: ColumnKind,
    /// True if single precision is sufficient; binary formats then store four bytes instead of
    /// eight.
    pub is_single: bool,
    cell: for<'a> fn(&ReadingRow<'a>) -> Option<Value<'a>>,
}

impl TableColumn {
    /// Returns name and type of the column.
    #[must_use]
    pub const fn column_type(&self) -> ColumnType {
        ColumnType { name: self.name, kind: self.kind, is_single: self.is_single }
    }

    /// Returns the cell of a reading; `None` for a value missing in the log.
    #[must_use]
    pub fn cell<'a>(&self, row: &ReadingRow<'a>) -> Option<Value<'a>> {
        (self.cell)(row)
    }
}

const fn text(
    name: &'static str,
    cell: for<'a> fn(&ReadingRow<'a>) -> Option<Value<'a>>,
) -> TableColumn {
    TableColumn { name, kind: ColumnKind::Text, is_single: false, cell }
}

const fn integer(
    name: &'static str,
    cell: for<'a> fn(&ReadingRow<'a>) -> Option<Value<'a>>,
) -> TableColumn {
    TableColumn { name, kind: ColumnKind::Integer, is_single: false, cell }
}

const fn number(
    name: &'static str,
    cell: for<'a> fn(&ReadingRow<'a>) -> Option<Value<'a>>,
) -> TableColumn {
    TableColumn { name, kind: ColumnKind::Number, is_single: false, cell }
}

/// Column of a measured or predicted quantity: seven digits resolve a micrometre in ten metres.
const fn single(
    name: &'static str,
    cell: for<'a> fn(&ReadingRow<'a>) -> Option<Value<'a>>,
) -> TableColumn {
    TableColumn { name, kind: ColumnKind::Number, is_single: true, cell }
}

const fn time(
    name: &'static str,
    cell: for<'a> fn(&ReadingRow<'a>) -> Option<Value<'a>>,
) -> TableColumn {
    TableColumn { name, kind: ColumnKind::Time, is_single: false, cell }
}

/// Returns the serialized name of an enum value, as written in a log.
pub(crate) fn serialized_name(value: impl Serialize) -> Option<String> {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => Some(name),
        _ => None,
    }
}

fn enum_text<'a>(value: impl Serialize) -> Option<Value<'a>> {
    serialized_name(value).map(|name| Value::Text(name.into()))
}

fn path_text(path: &PathRecord) -> Value<'_> {
    Value::Text(path.describe().into())
}

fn sender(crosstalk: &CrosstalkRecord) -> Value<'_> {
    Value::Text((&*crosstalk.ranger).into())
}

/// All columns, in table order.
pub const COLUMNS: &[TableColumn] = &[
    text("log", |row| Some(Value::Text(row.log.into()))),
    integer("session", |row| row.session.map(|number| Value::Integer(number.into()))),
    time("session_started", |row| Some(Value::Time(row.session_record()?.started))),
    text("provenance", |row| {
        enum_text(row.ping.provenance.or(Some(row.session_record()?.provenance))?)
    }),
    text("scene", |row| Some(Value::Text((&*row.session_record()?.scene.as_ref()?.name).into()))),
    text("sensor", |row| Some(Value::Text((&*row.session_record()?.sensor.name).into()))),
    text("array", |row| Some(Value::Text((&*row.session_record()?.array.as_ref()?.name).into()))),
    text("scan", |row| Some(Value::Text(row.scan.scan.to_string().into()))),
    time("scan_started", |row| Some(Value::Time(row.scan.start.as_ref()?.time))),
    integer("collection_pose", |row| {
        Some(Value::Integer(row.session_record()?.collection.as_ref()?.pose.into()))
    }),
    integer("collection_repeat", |row| {
        Some(Value::Integer(row.session_record()?.collection.as_ref()?.repeat.into()))
    }),
    integer("index", |row| Some(Value::Integer(row.ping.index.into()))),
    time("time", |row| row.ping.time.map(Value::Time)),
    number("time_sigma_us", |row| row.ping.time_sigma_us.map(Value::Number)),
    number("x_m", |row| row.pose().map(|pose| Value::Number(pose.x_m))),
    number("y_m", |row| row.pose().map(|pose| Value::Number(pose.y_m))),
    number("heading_deg", |row| row.pose().map(|pose| Value::Number(pose.heading_deg))),
    number("azimuth_deg", |row| Some(Value::Number(row.ping.azimuth_deg))),
    integer("step", |row| Some(Value::Integer(row.ping.step.into()))),
    text("ranger", |row| Some(Value::Text(row.ping.ranger.as_deref()?.into()))),
    number("transducer_x_m", |row| Some(Value::Number(row.viewpoint?.x_m))),
    number("transducer_y_m", |row| Some(Value::Number(row.viewpoint?.y_m))),
    number("transducer_z_m", |row| row.viewpoint?.z_m.map(Value::Number)),
    number("direction_deg", |row| Some(Value::Number(row.viewpoint?.direction_deg))),
    number("tilt_deg", |row| Some(Value::Number(row.viewpoint?.tilt_deg))),
    number("temperature_c", |row| row.temperature_c().map(Value::Number)),
    number("sound_speed_m_s", |row| row.sound_speed_m_s().map(Value::Number)),
    text("status", |row| enum_text(row.ping.status)),
    single("range_m", |row| row.ping.range_m.map(Value::Number)),
    single("tof_us", |row| row.ping.tof_us.map(Value::Number)),
    integer("fired_ticks", |row| {
        row.ping.fired_ticks.and_then(|ticks| i64::try_from(ticks).ok()).map(Value::Integer)
    }),
    TableColumn {
        name: "echo_ticks",
        kind: ColumnKind::Integers,
        is_single: false,
        cell: |row| Some(Value::Integers(&row.ping.echo_ticks)),
    },
    TableColumn {
        name: "repaired",
        kind: ColumnKind::Flag,
        is_single: false,
        cell: |row| Some(Value::Flag(row.ping.repaired)),
    },
    single("amplitude", |row| row.ping.amplitude.map(Value::Number)),
    single("margin_db", |row| row.ping.margin_db.map(Value::Number)),
    text("path_kind", |row| enum_text(row.ping.path.as_ref()?.kind)),
    integer("path_order", |row| Some(Value::Integer(row.ping.path.as_ref()?.order.into()))),
    single("path_length_m", |row| Some(Value::Number(row.ping.path.as_ref()?.length_m))),
    text("path", |row| row.ping.path.as_ref().map(path_text)),
    text("crosstalk_ranger", |row| Some(sender(row.ping.crosstalk.as_ref()?))),
    number("crosstalk_before_us", |row| {
        Some(Value::Number(row.ping.crosstalk.as_ref()?.before_us))
    }),
    text("sim_status", |row| enum_text(row.sim()?.status)),
    single("sim_range_m", |row| row.sim()?.range_m.map(Value::Number)),
    single("sim_amplitude", |row| row.sim()?.amplitude.map(Value::Number)),
    single("sim_margin_db", |row| row.sim()?.margin_db.map(Value::Number)),
    text("sim_path_kind", |row| enum_text(row.sim_path()?.kind)),
    integer("sim_path_order", |row| Some(Value::Integer(row.sim_path()?.order.into()))),
    single("sim_path_length_m", |row| Some(Value::Number(row.sim_path()?.length_m))),
    text("sim_path", |row| row.sim_path().map(path_text)),
    text("sim_crosstalk_ranger", |row| Some(sender(row.sim()?.crosstalk.as_ref()?))),
    number("sim_crosstalk_before_us", |row| {
        Some(Value::Number(row.sim()?.crosstalk.as_ref()?.before_us))
    }),
    single("residual_m", |row| row.ping.residual_m.map(Value::Number)),
    single("confidence", |row| row.ping.confidence.map(Value::Number)),
];

//! The columns of tables, which are the same in every format of a table.
//!
//! Names are those of the log's records, with the unit in them; what stands in `sim` there begins with `sim_`.
//! What the log does not say is nothing, never a number that means nothing.

use std::borrow::Cow;

use jiff::Timestamp;
use serde::Serialize;

use sonard_model::{geometry::Pose, viewpoint::Viewpoint};
use sonard_records::{CrosstalkRecord, PathRecord, Ping, ScanView, Session, SimRecord};

/// A reading with what holds for its scan.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    /// The log's name.
    log: &'a str,
    /// Number of the session among those that are exported, from 1.
    session: Option<u32>,
    scan: &'a ScanView,
    ping: &'a Ping,
    viewpoint: Option<Viewpoint>,
}

impl<'a> Row<'a> {
    /// Of a reading of a scan.
    pub(crate) fn new(
        log: &'a str,
        session: Option<u32>,
        scan: &'a ScanView,
        ping: &'a Ping,
    ) -> Self {
        Self { log, session, scan, ping, viewpoint: scan.viewpoint(ping) }
    }

    fn of_session(&self) -> Option<&'a Session> {
        self.scan.session.as_deref()
    }

    /// Where the robot stood at firing.
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
        let of_session = || self.of_session().map(|session| session.air.sound_speed_m_s);
        of_scan.map(|air| air.sound_speed_m_s).or_else(of_session)
    }

    fn temperature_c(&self) -> Option<f64> {
        let of_scan = self.scan.start.as_ref().and_then(|start| start.air);
        let of_session = || self.of_session().map(|session| session.air.temperature_c);
        of_scan.map(|air| air.temperature_c).or_else(of_session)
    }
}

/// What a cell can hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// UTF-8.
    Text,
    /// A whole number.
    Integer,
    /// A finite number.
    Number,
    /// Yes or no.
    Flag,
    /// A moment, to the nanosecond.
    Time,
    /// Whole numbers, perhaps none.
    Integers,
    /// Finite numbers of seven digits, perhaps none.
    Numbers,
}

/// What a cell holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Value<'a> {
    /// Of [`Kind::Text`].
    Text(Cow<'a, str>),
    /// Of [`Kind::Integer`].
    Integer(i64),
    /// Of [`Kind::Number`].
    Number(f64),
    /// Of [`Kind::Flag`].
    Flag(bool),
    /// Of [`Kind::Time`].
    Time(Timestamp),
    /// Of [`Kind::Integers`].
    Integers(&'a [u32]),
    /// Of [`Kind::Numbers`].
    Numbers(&'a [f32]),
}

impl Value<'_> {
    /// Which kind it is of.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        match self {
            Self::Text(_) => Kind::Text,
            Self::Integer(_) => Kind::Integer,
            Self::Number(_) => Kind::Number,
            Self::Flag(_) => Kind::Flag,
            Self::Time(_) => Kind::Time,
            Self::Integers(_) => Kind::Integers,
            Self::Numbers(_) => Kind::Numbers,
        }
    }
}

/// What a column of a table is called and holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its name, with the unit.
    pub name: &'static str,
    /// What its cells hold.
    pub kind: Kind,
    /// Of numbers, whether seven digits say all: formats that have such numbers take four bytes instead of eight.
    pub is_single: bool,
}

/// A column of a table of logs.
#[derive(Debug, Clone, Copy)]
pub struct Column {
    /// Its name, with the unit.
    pub name: &'static str,
    /// What its cells hold.
    pub kind: Kind,
    /// Of numbers, whether seven digits say all: formats that have such numbers take four bytes instead of eight.
    pub is_single: bool,
    cell: for<'a> fn(&Row<'a>) -> Option<Value<'a>>,
}

impl Column {
    /// What it is called and holds.
    #[must_use]
    pub const fn field(&self) -> Field {
        Field { name: self.name, kind: self.kind, is_single: self.is_single }
    }

    /// The cell of a reading; `None` where the log does not say it.
    #[must_use]
    pub fn cell<'a>(&self, row: &Row<'a>) -> Option<Value<'a>> {
        (self.cell)(row)
    }
}

const fn text(name: &'static str, cell: for<'a> fn(&Row<'a>) -> Option<Value<'a>>) -> Column {
    Column { name, kind: Kind::Text, is_single: false, cell }
}

const fn integer(name: &'static str, cell: for<'a> fn(&Row<'a>) -> Option<Value<'a>>) -> Column {
    Column { name, kind: Kind::Integer, is_single: false, cell }
}

const fn number(name: &'static str, cell: for<'a> fn(&Row<'a>) -> Option<Value<'a>>) -> Column {
    Column { name, kind: Kind::Number, is_single: false, cell }
}

/// A number of what was heard: a micrometre in ten metres is its seventh digit.
const fn single(name: &'static str, cell: for<'a> fn(&Row<'a>) -> Option<Value<'a>>) -> Column {
    Column { name, kind: Kind::Number, is_single: true, cell }
}

const fn time(name: &'static str, cell: for<'a> fn(&Row<'a>) -> Option<Value<'a>>) -> Column {
    Column { name, kind: Kind::Time, is_single: false, cell }
}

/// A word of the records, as a log has it.
pub(crate) fn logged_word(value: impl Serialize) -> Option<String> {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => Some(word),
        _ => None,
    }
}

fn word<'a>(value: impl Serialize) -> Option<Value<'a>> {
    logged_word(value).map(|word| Value::Text(word.into()))
}

fn words(path: &PathRecord) -> Value<'_> {
    Value::Text(path.in_words().into())
}

fn sender(crosstalk: &CrosstalkRecord) -> Value<'_> {
    Value::Text((&*crosstalk.ranger).into())
}

/// The columns, in their order.
pub const COLUMNS: &[Column] = &[
    text("log", |row| Some(Value::Text(row.log.into()))),
    integer("session", |row| row.session.map(|number| Value::Integer(number.into()))),
    time("session_started", |row| Some(Value::Time(row.of_session()?.started))),
    text("provenance", |row| word(row.ping.provenance.or(Some(row.of_session()?.provenance))?)),
    text("scene", |row| Some(Value::Text((&*row.of_session()?.scene.as_ref()?.name).into()))),
    text("sensor", |row| Some(Value::Text((&*row.of_session()?.sensor.name).into()))),
    text("array", |row| Some(Value::Text((&*row.of_session()?.array.as_ref()?.name).into()))),
    text("scan", |row| Some(Value::Text(row.scan.scan.to_string().into()))),
    time("scan_started", |row| Some(Value::Time(row.scan.start.as_ref()?.time))),
    integer("collection_pose", |row| {
        Some(Value::Integer(row.of_session()?.collection.as_ref()?.pose.into()))
    }),
    integer("collection_repeat", |row| {
        Some(Value::Integer(row.of_session()?.collection.as_ref()?.repeat.into()))
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
    text("status", |row| word(row.ping.status)),
    single("range_m", |row| row.ping.range_m.map(Value::Number)),
    single("tof_us", |row| row.ping.tof_us.map(Value::Number)),
    integer("fired_ticks", |row| {
        row.ping.fired_ticks.and_then(|ticks| i64::try_from(ticks).ok()).map(Value::Integer)
    }),
    Column {
        name: "echo_ticks",
        kind: Kind::Integers,
        is_single: false,
        cell: |row| Some(Value::Integers(&row.ping.echo_ticks)),
    },
    Column {
        name: "repaired",
        kind: Kind::Flag,
        is_single: false,
        cell: |row| Some(Value::Flag(row.ping.repaired)),
    },
    single("amplitude", |row| row.ping.amplitude.map(Value::Number)),
    single("margin_db", |row| row.ping.margin_db.map(Value::Number)),
    text("path_kind", |row| word(row.ping.path.as_ref()?.kind)),
    integer("path_order", |row| Some(Value::Integer(row.ping.path.as_ref()?.order.into()))),
    single("path_length_m", |row| Some(Value::Number(row.ping.path.as_ref()?.length_m))),
    text("path", |row| row.ping.path.as_ref().map(words)),
    text("crosstalk_ranger", |row| Some(sender(row.ping.crosstalk.as_ref()?))),
    number("crosstalk_before_us", |row| {
        Some(Value::Number(row.ping.crosstalk.as_ref()?.before_us))
    }),
    text("sim_status", |row| word(row.sim()?.status)),
    single("sim_range_m", |row| row.sim()?.range_m.map(Value::Number)),
    single("sim_amplitude", |row| row.sim()?.amplitude.map(Value::Number)),
    single("sim_margin_db", |row| row.sim()?.margin_db.map(Value::Number)),
    text("sim_path_kind", |row| word(row.sim_path()?.kind)),
    integer("sim_path_order", |row| Some(Value::Integer(row.sim_path()?.order.into()))),
    single("sim_path_length_m", |row| Some(Value::Number(row.sim_path()?.length_m))),
    text("sim_path", |row| row.sim_path().map(words)),
    text("sim_crosstalk_ranger", |row| Some(sender(row.sim()?.crosstalk.as_ref()?))),
    number("sim_crosstalk_before_us", |row| {
        Some(Value::Number(row.sim()?.crosstalk.as_ref()?.before_us))
    }),
    single("residual_m", |row| row.ping.residual_m.map(Value::Number)),
    single("confidence", |row| row.ping.confidence.map(Value::Number)),
];

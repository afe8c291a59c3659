//! What the columns of a file mean.

use std::collections::BTreeMap;

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Field, Format, ImportError, Quantity, rounds::MAX_RANGERS};

/// Which column of a table, or member of a JSON object, has a field.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Column {
    /// Its place, from 1.
    Number(usize),
    /// Its name in the header; of JSON the member, with dots into members and lists (`pose.0`).
    Name(String),
    /// The places of several, one for each ranger of an array.
    Several(Vec<usize>),
}

impl Column {
    /// Reads `3`, `range`, or `1-24` for one column a ranger.
    fn of(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Ok(number) = text.parse() {
            return if number == 0 {
                Err("there is no column 0".to_owned())
            } else {
                Ok(Self::Number(number))
            };
        }
        let span = text.split_once('-').and_then(|(first, last)| {
            Some((first.parse::<usize>().ok()?, last.parse::<usize>().ok()?))
        });
        match span {
            Some((first, last)) if first > 0 && first <= last && last <= MAX_RANGERS => {
                Ok(Self::Several((first..=last).collect()))
            }
            Some(_) => Err(format!("`{text}` is no span of columns")),
            None => Ok(Self::Name(text.to_owned())),
        }
    }
}

impl std::fmt::Display for Column {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "column {number}"),
            Self::Name(name) => write!(f, "`{name}`"),
            Self::Several(numbers) => match numbers[..] {
                [first, .., last] => write!(f, "columns {first} to {last}"),
                [only] => write!(f, "column {only}"),
                [] => f.write_str("no column"),
            },
        }
    }
}

/// Sign between the whole part of a number and its fraction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Decimal {
    /// `15.5`; a comma groups thousands.
    Point,
    /// `15,5`; a point groups thousands.
    Comma,
}

/// Unit of the ranges of a format that specifies metres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RangeUnit {
    /// Metres.
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
    /// Inches.
    In,
    /// Feet.
    Ft,
}

impl RangeUnit {
    /// All of them, with their names.
    pub const ALL: [(&'static str, Self); 5] =
        [("m", Self::M), ("cm", Self::Cm), ("mm", Self::Mm), ("in", Self::In), ("ft", Self::Ft)];

    /// Length of one, metres.
    #[must_use]
    pub const fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
            Self::In => 0.0254,
            Self::Ft => 0.3048,
        }
    }
}

/// What a file's columns mean, and what has to be done to its numbers. It is what a mapping file (TOML) says,
/// and stands in the session of the log that is made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema, Default)]
#[serde(default, deny_unknown_fields)]
pub struct Mapping {
    /// How the file is written; without it, what it looks like.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<Format>,
    /// Which column has which field; without any, what the header says.
    pub columns: BTreeMap<Field, Column>,
    /// Topics of a recording that are read; without any, all of `sensor_msgs/Range` but predictions, else of
    /// `sensor_msgs/LaserScan`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// Azimuths and bearings of the file count clockwise.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub clockwise: bool,
    /// Direction of the file's azimuth zero, degrees counter-clockwise from the robot's heading (of its bearing
    /// zero, from the x axis).
    #[serde(skip_serializing_if = "is_zero")]
    pub zero_deg: f64,
    /// Ranges, in the file's unit, that mean no echo.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub none: Vec<f64>,
    /// Ranges, in the file's unit, at and beyond which there is no echo.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub none_from: Option<f64>,
    /// Speed of sound that the file's ranges were computed with, metres a second; they are computed again
    /// with that of the air. Without it they are taken as they are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sound_speed_m_s: Option<f64>,
    /// Azimuth of every reading, degrees: of a fixed ranger, whose file has no column for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<f64>,
    /// Unit of the ranges of logs and recordings whose format specifies metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_unit: Option<RangeUnit>,
    /// Sign before the fraction of numbers; without it, as the file shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal: Option<Decimal>,
    /// Encoding of a text, by a label of the WHATWG Encoding Standard (`latin1`, `utf-16le`); without it, as the file
    /// shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoding: Option<String>,
    /// Form of times, in the signs of `strftime`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_format: Option<String>,
    /// Offset from UTC of times without a zone, such as `+01:00`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub utc_offset: Option<String>,
    /// Time of the first reading, where the file has times of day or counts from the start of a board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub started: Option<Timestamp>,
    /// Device of a log of several: `HOST:ROBOT:INDEX` of Player, or the end of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
}

fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

impl Mapping {
    /// Reads `azimuth_deg=1,range_cm=distance`.
    ///
    /// # Errors
    /// A field that there is not, or one named twice.
    pub fn columns_of(text: &str) -> Result<BTreeMap<Field, Column>, ImportError> {
        let mut columns = BTreeMap::new();
        for pair in text.split(',') {
            let help = "write FIELD=COLUMN, with the number of the column (from 1) or its name: \
                        azimuth_deg=1,range_cm=distance";
            let (field, column) = pair
                .split_once('=')
                .ok_or_else(|| ImportError::mapping(format!("`{pair}` says no column"), help))?;
            let field: Field = field.trim().parse()?;
            let column = Column::of(column)
                .map_err(|what| ImportError::mapping(format!("`{pair}`: {what}"), help))?;
            if columns.insert(field, column).is_some() {
                return Err(ImportError::mapping(format!("{field} is named twice"), help));
            }
        }
        Ok(columns)
    }

    /// The field of a quantity, if it has one.
    #[must_use]
    pub fn field(&self, quantity: Quantity) -> Option<Field> {
        self.columns.keys().copied().find(|field| field.quantity() == quantity)
    }

    /// Checks whether a range of the file, in its unit, stands for no echo.
    pub(crate) fn is_no_echo(&self, range: f64) -> bool {
        self.none.contains(&range) || self.none_from.is_some_and(|from| range >= from)
    }

    /// Length of a unit of ranges in a format that says metres.
    pub(crate) fn metres(&self) -> f64 {
        self.range_unit.unwrap_or(RangeUnit::M).metres()
    }

    /// The option `--no-echo` with further values, those given before among them.
    pub(crate) fn none_option(&self, more: &[f64]) -> String {
        let values = self.none.iter().chain(more);
        values.map(|value| format!("--no-echo={value}")).collect::<Vec<_>>().join(" ")
    }

    /// The option `--columns` with one field in place of another of its quantity.
    pub(crate) fn columns_option_with(&self, field: Field, names: &[String]) -> String {
        let columns = self.columns.iter().map(|(known, column)| {
            let known = if known.quantity() == field.quantity() { field } else { *known };
            (known, column.clone())
        });
        columns_option(columns, names)
    }

    /// Whether it says enough to make readings, and nothing twice.
    ///
    /// # Errors
    /// What is missing, or too much.
    pub fn check(&self) -> Result<(), ImportError> {
        let mut seen = BTreeMap::new();
        for field in self.columns.keys() {
            if let Some(other) = seen.insert(field.quantity(), field) {
                return Err(ImportError::mapping(
                    format!("{other} and {field} both say the {}", field.quantity().words()),
                    "leave one of them out",
                ));
            }
        }
        let has = |quantity| seen.contains_key(&quantity);
        for (one, other) in
            [(Quantity::Azimuth, Quantity::Bearing), (Quantity::Range, Quantity::Tof)]
        {
            let (this, that) = (one.words(), other.words());
            let is_fixed = one == Quantity::Azimuth && self.azimuth_deg.is_some();
            match (has(one), has(other)) {
                (false, false) if is_fixed || (one == Quantity::Azimuth && self.is_of_array()) => {}
                (true, _) | (_, true) if is_fixed => {
                    let what = "both --azimuth-deg and a column say the direction";
                    return Err(ImportError::mapping(what, "leave one of them out"));
                }
                (true, true) => {
                    let what = format!("both {this} and {that} are named");
                    return Err(ImportError::mapping(what, "leave one of them out"));
                }
                (false, false) => {
                    return Err(ImportError::mapping(
                        format!("no column has the {this} or the {that}"),
                        "name the columns: --columns azimuth_deg=1,range_cm=2",
                    ));
                }
                _ => {}
            }
        }
        if has(Quantity::X) != has(Quantity::Y) {
            return Err(ImportError::mapping(
                "only one of x and y is named",
                "name both, or neither",
            ));
        }
        Ok(())
    }

    /// Checks whether one column a ranger is named.
    pub(crate) fn is_of_array(&self) -> bool {
        self.columns.values().any(|column| matches!(column, Column::Several(_)))
    }
}

/// The option `--columns` as one types it in a shell; `names` are those of all columns, for names that cannot be typed.
pub(crate) fn columns_option(
    columns: impl IntoIterator<Item = (Field, Column)>,
    names: &[String],
) -> String {
    let pair = |(field, column): (Field, Column)| {
        let place = |name: &str| names.iter().position(|known| known == name).map(|at| at + 1);
        let text = match column {
            Column::Number(number) => number.to_string(),
            Column::Several(numbers) => match numbers[..] {
                [first, .., last] => format!("{first}-{last}"),
                _ => numbers.iter().map(usize::to_string).collect(),
            },
            Column::Name(name) if name.contains(',') || name.trim() != name => {
                place(&name).map_or(name, |place| place.to_string())
            }
            Column::Name(name) => name,
        };
        format!("{field}={text}")
    };
    let text = columns.into_iter().map(pair).collect::<Vec<_>>().join(",");
    format!("--columns {}", typed(&text))
}

/// A word as one types it in a shell.
pub(crate) fn typed(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_=,.-/%+@:".contains(c);
    if word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

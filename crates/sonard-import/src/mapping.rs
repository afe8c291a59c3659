//! Mapping of the columns of a file to fields.

use std::collections::BTreeMap;

use jiff::Timestamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Field, FieldQuantity, Format, ImportError, array_rounds::MAX_RANGERS};

/// Column of a table, or member of a JSON object, mapped to a field.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Column {
    /// Column number, from 1.
    Number(usize),
    /// Column name; in JSON the member, with dots into members and lists (`pose.0`).
    Name(String),
    /// Column numbers, one for each ranger of an array.
    Several(Vec<usize>),
}

impl Column {
    /// Parses `3`, `range`, or `1-24` for one column per ranger.
    fn parse(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Ok(number) = text.parse() {
            return if number == 0 {
                Err("columns count from 1".to_owned())
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
            Some(_) => Err(format!(
                "`{text}` is not a range of columns (FIRST-LAST, at most {MAX_RANGERS})"
            )),
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

/// Decimal sign of numbers in text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Decimal {
    /// `15.5`; a comma groups thousands.
    Point,
    /// `15,5`; a point groups thousands.
    Comma,
}

/// Unit of ranges in a format that specifies metres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RangeUnit {
    /// Metres, as in ROS messages.
    M,
    /// Centimetres, as reported by many drivers.
    Cm,
    /// Millimetres, as reported by many drivers.
    Mm,
    /// Inches of 25.4 mm.
    In,
    /// Feet of 0.3048 m.
    Ft,
}

impl RangeUnit {
    /// All units with their names.
    pub const ALL: [(&'static str, Self); 5] =
        [("m", Self::M), ("cm", Self::Cm), ("mm", Self::Mm), ("in", Self::In), ("ft", Self::Ft)];

    /// Returns the length of the unit in metres.
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

/// Meaning of a file's columns, and the conversions of its numbers. Serialized in mapping files
/// (TOML) and in the session record of the imported log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema, Default)]
#[serde(default, deny_unknown_fields)]
pub struct Mapping {
    /// Format of the file; detected if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<Format>,
    /// Column of each field; inferred from the header if empty.
    pub columns: BTreeMap<Field, Column>,
    /// Topics to read from a recording; if empty, all of `sensor_msgs/Range` except predictions, or
    /// else of `sensor_msgs/LaserScan`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// True if azimuths and bearings of the file are clockwise.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub clockwise: bool,
    /// Direction of the file's zero azimuth, degrees counter-clockwise from the robot's heading;
    /// for bearings, from the x axis.
    #[serde(skip_serializing_if = "is_zero")]
    pub zero_deg: f64,
    /// True if the readings of a scan are in no order of direction: all readings at one pose are a
    /// scan.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub unordered: bool,
    /// Range values for no echo, in the unit of the file.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub none: Vec<f64>,
    /// Lower limit of range values for no echo, in the unit of the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub none_from: Option<f64>,
    /// Sound speed with which the ranges of the file were computed, m/s. Ranges are recomputed with
    /// that of the air; if absent, they are kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sound_speed_m_s: Option<f64>,
    /// Azimuth of every reading, degrees, for a fixed ranger without a direction column.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<f64>,
    /// Unit of ranges in logs and recordings whose format specifies metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_unit: Option<RangeUnit>,
    /// Decimal sign; detected if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal: Option<Decimal>,
    /// Encoding of a text, as a label of the WHATWG Encoding Standard (`latin1`, `utf-16le`);
    /// detected if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoding: Option<String>,
    /// Time format, in `strftime` specifiers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_format: Option<String>,
    /// UTC offset of times without a time zone, such as `+01:00`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub utc_offset: Option<String>,
    /// Time of the first reading, for times of day and counters that start with a board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub started: Option<Timestamp>,
    /// Device of a log with several: `HOST:ROBOT:INDEX` of Player, or the end of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
}

fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

impl Mapping {
    /// Parses `azimuth_deg=1,range_cm=distance`.
    ///
    /// # Errors
    /// Returns an error for an unknown field or a field given twice.
    pub fn parse_columns(text: &str) -> Result<BTreeMap<Field, Column>, ImportError> {
        let mut columns = BTreeMap::new();
        for pair in text.split(',') {
            let help = "write FIELD=COLUMN, with the number of the column (from 1) or its name: \
                        azimuth_deg=1,range_cm=distance";
            let (field, column) = pair
                .split_once('=')
                .ok_or_else(|| ImportError::mapping(format!("`{pair}` names no column"), help))?;
            let field: Field = field.trim().parse()?;
            let column = Column::parse(column)
                .map_err(|what| ImportError::mapping(format!("`{pair}`: {what}"), help))?;
            if columns.insert(field, column).is_some() {
                return Err(ImportError::mapping(format!("{field} is given twice"), help));
            }
        }
        Ok(columns)
    }

    /// Returns the mapped field of a quantity.
    #[must_use]
    pub fn field(&self, quantity: FieldQuantity) -> Option<Field> {
        self.columns.keys().copied().find(|field| field.quantity() == quantity)
    }

    /// Returns `true` for a range, in the unit of the file, that means no echo.
    pub(crate) fn is_no_echo(&self, range: f64) -> bool {
        self.none.contains(&range) || self.none_from.is_some_and(|from| range >= from)
    }

    /// Returns the length in metres of one unit of ranges, for formats that specify metres.
    pub(crate) fn metres(&self) -> f64 {
        self.range_unit.unwrap_or(RangeUnit::M).metres()
    }

    /// Formats `--no-echo` options for the current values and `more`.
    pub(crate) fn none_option(&self, more: &[f64]) -> String {
        let values = self.none.iter().chain(more);
        values.map(|value| format!("--no-echo={value}")).collect::<Vec<_>>().join(" ")
    }

    /// Formats `--columns` with `field` in place of the field with the same role.
    pub(crate) fn columns_option_with(&self, field: Field, names: &[String]) -> String {
        let columns = self.columns.iter().map(|(known, column)| {
            let is_replaced = known.quantity().role() == field.quantity().role();
            let known = if is_replaced { field } else { *known };
            (known, column.clone())
        });
        columns_option(columns, names)
    }

    /// Checks that the mapping is complete and unambiguous.
    ///
    /// # Errors
    /// Returns an error for a missing or duplicate quantity.
    pub fn check(&self) -> Result<(), ImportError> {
        self.check_fields(self.has_array_columns())
    }

    /// Checks that the mapping is complete and unambiguous; rounds of an array need no direction.
    ///
    /// # Errors
    /// Returns an error for a missing or duplicate quantity.
    pub(crate) fn check_fields(&self, is_array: bool) -> Result<(), ImportError> {
        let mut seen = BTreeMap::new();
        for field in self.columns.keys() {
            if let Some(other) = seen.insert(field.quantity(), field) {
                return Err(ImportError::mapping(
                    format!("{other} and {field} are both the {}", field.quantity().label()),
                    "leave one of them out",
                ));
            }
        }
        let has = |quantity| seen.contains_key(&quantity);
        for (preferred, alternative) in [
            (FieldQuantity::Azimuth, FieldQuantity::Bearing),
            (FieldQuantity::Range, FieldQuantity::Tof),
        ] {
            let (name, alternative_name) = (preferred.label(), alternative.label());
            let is_fixed = preferred == FieldQuantity::Azimuth && self.azimuth_deg.is_some();
            match (has(preferred), has(alternative)) {
                (false, false) if is_fixed || (preferred == FieldQuantity::Azimuth && is_array) => {
                }
                (true, _) | (_, true) if is_fixed => {
                    let what = "both --azimuth-deg and a column give the direction";
                    return Err(ImportError::mapping(what, "leave one of them out"));
                }
                (true, true) => {
                    let what = format!("both {name} and {alternative_name} are mapped");
                    return Err(ImportError::mapping(what, "leave one of them out"));
                }
                (false, false) => {
                    return Err(ImportError::mapping(
                        format!("no column is mapped to {name} or {alternative_name}"),
                        "map the columns: --columns azimuth_deg=1,range_cm=2",
                    ));
                }
                _ => {}
            }
        }
        if has(FieldQuantity::X) != has(FieldQuantity::Y) {
            return Err(ImportError::mapping(
                "only one of x and y is mapped",
                "map both, or neither",
            ));
        }
        Ok(())
    }

    /// Returns `true` if a field is mapped to one column per ranger.
    pub(crate) fn has_array_columns(&self) -> bool {
        self.columns.values().any(|column| matches!(column, Column::Several(_)))
    }
}

/// Formats `--columns` as typed in a shell. Names that cannot be typed become numbers, by their
/// index in `names`.
pub(crate) fn columns_option(
    columns: impl IntoIterator<Item = (Field, Column)>,
    names: &[String],
) -> String {
    let is_repeated = |name: &String| names.iter().filter(|known| *known == name).nth(1).is_some();
    let pair = |(field, column): (Field, Column)| {
        let place = |name: &str| names.iter().position(|known| known == name).map(|at| at + 1);
        let text = match column {
            Column::Number(number) => number.to_string(),
            Column::Several(numbers) => match numbers[..] {
                [first, .., last] => format!("{first}-{last}"),
                _ => numbers.iter().map(usize::to_string).collect(),
            },
            Column::Name(name)
                if name.contains([',', '=']) || name.trim() != name || is_repeated(&name) =>
            {
                place(&name).map_or(name, |place| place.to_string())
            }
            Column::Name(name) => name,
        };
        format!("{field}={text}")
    };
    let text = columns.into_iter().map(pair).collect::<Vec<_>>().join(",");
    format!("--columns {}", shell_quoted(&text))
}

/// Quotes a word for a shell if necessary.
pub(crate) fn shell_quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_=,.-/%+@:".contains(c);
    if word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

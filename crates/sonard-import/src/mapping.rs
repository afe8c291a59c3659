//! What the columns of a file mean.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Field, ImportError, Quantity};

/// How a file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Lines of values apart by commas, semicolons, tabs or blanks.
    Csv,
    /// JSON: a list of objects, or an object a line; numbers or lists of numbers in them.
    Json,
    /// The log of CARMEN.
    Carmen,
    /// The log of Player.
    Player,
    /// A recording of ROS 2.
    Mcap,
}

/// Which column of a table, or member of a JSON object, has a field.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Column {
    /// Its place, from 1.
    Number(usize),
    /// Its name in the header; of JSON the member, with dots into members and lists (`pose.0`).
    Name(String),
}

impl std::fmt::Display for Column {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "column {number}"),
            Self::Name(name) => write!(f, "`{name}`"),
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
    /// Ranges, in the file's unit, that mean that nothing was heard.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub none: Vec<f64>,
    /// Ranges, in the file's unit, at and beyond which there is no echo.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub none_from: Option<f64>,
    /// Speed of sound that the file's ranges were computed with, metres a second; they are computed again
    /// with that of the air. Without it they are taken as they are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sound_speed_m_s: Option<f64>,
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
            let column = match column.trim().parse() {
                Ok(0) => {
                    return Err(ImportError::mapping(
                        format!("`{pair}`: there is no column 0"),
                        help,
                    ));
                }
                Ok(number) => Column::Number(number),
                Err(_) => Column::Name(column.trim().to_owned()),
            };
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

    /// Whether a range of the file, in its unit, means that nothing was heard.
    pub(crate) fn is_silence(&self, range: f64) -> bool {
        self.none.contains(&range) || self.none_from.is_some_and(|from| range >= from)
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
            match (has(one), has(other)) {
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
}

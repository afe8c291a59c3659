//! Fields of a mapping: a physical quantity in a unit, under one name.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize, de};

use crate::ImportError;

/// Physical or descriptive quantity of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FieldQuantity {
    /// Direction of the beam from the robot's heading.
    Azimuth,
    /// Direction of the beam in the world.
    Bearing,
    /// Half the path of the first echo.
    Range,
    /// Time from firing to the first echo.
    Tof,
    /// Time at which the ranger fired.
    Time,
    /// Scan identifier: any text; a change starts a new scan.
    Scan,
    /// Position of the robot along the x axis.
    X,
    /// Position of the robot along the y axis.
    Y,
    /// Heading of the robot.
    Heading,
    /// Air temperature at the reading.
    Temperature,
    /// Outcome of the firing, named as in the log.
    Status,
}

impl FieldQuantity {
    /// Returns the English name of the quantity, for messages.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::Azimuth => "azimuth",
            Self::Bearing => "bearing",
            Self::Range => "range",
            Self::Tof => "time of flight",
            Self::Time => "time",
            Self::Scan => "scan",
            Self::X => "x",
            Self::Y => "y",
            Self::Heading => "heading",
            Self::Temperature => "temperature",
            Self::Status => "status",
        }
    }
}

impl FieldQuantity {
    /// Returns the first quantity with the same role in a reading: azimuth for a bearing, range for
    /// a time of flight.
    pub(crate) const fn role(self) -> Self {
        match self {
            Self::Bearing => Self::Azimuth,
            Self::Tof => Self::Range,
            other => other,
        }
    }

    /// Returns `true` for a direction, a range or a time of flight.
    pub(crate) const fn is_measurement(self) -> bool {
        matches!(self, Self::Azimuth | Self::Bearing | Self::Range | Self::Tof)
    }
}

const DEG: f64 = 180.0 / std::f64::consts::PI;

/// Field names with quantity and scale factor to degrees, metres, microseconds, seconds or degrees
/// Celsius. Fields without a factor hold text.
const FIELDS: [(&str, FieldQuantity, Option<f64>); 36] = [
    ("azimuth_deg", FieldQuantity::Azimuth, Some(1.0)),
    ("azimuth_rad", FieldQuantity::Azimuth, Some(DEG)),
    ("bearing_deg", FieldQuantity::Bearing, Some(1.0)),
    ("bearing_rad", FieldQuantity::Bearing, Some(DEG)),
    ("range_m", FieldQuantity::Range, Some(1.0)),
    ("range_cm", FieldQuantity::Range, Some(0.01)),
    ("range_mm", FieldQuantity::Range, Some(0.001)),
    ("range_in", FieldQuantity::Range, Some(0.0254)),
    ("range_ft", FieldQuantity::Range, Some(0.3048)),
    ("tof_us", FieldQuantity::Tof, Some(1.0)),
    ("tof_ms", FieldQuantity::Tof, Some(1e3)),
    ("tof_s", FieldQuantity::Tof, Some(1e6)),
    ("time", FieldQuantity::Time, None),
    ("time_s", FieldQuantity::Time, Some(1.0)),
    ("time_ms", FieldQuantity::Time, Some(1e-3)),
    ("time_us", FieldQuantity::Time, Some(1e-6)),
    ("time_ns", FieldQuantity::Time, Some(1e-9)),
    ("scan", FieldQuantity::Scan, None),
    ("x_m", FieldQuantity::X, Some(1.0)),
    ("x_cm", FieldQuantity::X, Some(0.01)),
    ("x_mm", FieldQuantity::X, Some(0.001)),
    ("y_m", FieldQuantity::Y, Some(1.0)),
    ("y_cm", FieldQuantity::Y, Some(0.01)),
    ("y_mm", FieldQuantity::Y, Some(0.001)),
    ("heading_deg", FieldQuantity::Heading, Some(1.0)),
    ("heading_rad", FieldQuantity::Heading, Some(DEG)),
    ("temperature_c", FieldQuantity::Temperature, Some(1.0)),
    ("temperature_k", FieldQuantity::Temperature, Some(1.0)),
    ("status", FieldQuantity::Status, None),
    ("azimuth_grad", FieldQuantity::Azimuth, Some(0.9)),
    ("bearing_grad", FieldQuantity::Bearing, Some(0.9)),
    ("range_dm", FieldQuantity::Range, Some(0.1)),
    ("range_yd", FieldQuantity::Range, Some(0.9144)),
    ("range_um", FieldQuantity::Range, Some(1e-6)),
    ("range_km", FieldQuantity::Range, Some(1e3)),
    ("temperature_f", FieldQuantity::Temperature, Some(1.0)),
];

/// A quantity in a unit, such as `range_cm`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Field(usize);

impl Field {
    /// Returns every field that a mapping may use.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..FIELDS.len()).map(Self)
    }

    /// Returns the field with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        FIELDS.iter().position(|(known, ..)| *known == name).map(Self)
    }

    /// Returns the name used in mappings and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        FIELDS[self.0].0
    }

    /// Returns the quantity that the field holds.
    #[must_use]
    pub const fn quantity(self) -> FieldQuantity {
        FIELDS[self.0].1
    }

    /// Converts a number to degrees, metres, microseconds, seconds or degrees Celsius.
    pub(crate) fn scaled(self, number: f64) -> f64 {
        match self.name() {
            "temperature_k" => return number - 273.15,
            "temperature_f" => return (number - 32.0) / 1.8,
            _ => {}
        }
        number * FIELDS[self.0].2.unwrap_or(1.0)
    }

    /// Returns `true` for an angle in radians.
    pub(crate) fn is_radians(self) -> bool {
        self.unit() == Some("rad")
    }

    /// Returns the unit suffix of the name; `None` for text.
    pub(crate) fn unit(self) -> Option<&'static str> {
        FIELDS[self.0].2.and(self.name().rsplit_once('_')).map(|(_, unit)| unit)
    }

    /// Returns `true` for units that are offered where the unit is unknown.
    pub(crate) fn is_usual(self) -> bool {
        !matches!(self.unit(), Some("dm" | "yd" | "um" | "km"))
    }

    /// Returns the field of a quantity in a unit.
    pub(crate) fn with_unit(quantity: FieldQuantity, unit: Option<&str>) -> Option<Self> {
        Self::all().find(|field| field.quantity() == quantity && field.unit() == unit)
    }

    /// Returns all fields of a quantity.
    pub(crate) fn of_quantity(quantity: FieldQuantity) -> impl Iterator<Item = Self> {
        Self::all().filter(move |field| field.quantity() == quantity)
    }
}

impl fmt::Debug for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Field {
    type Err = ImportError;

    fn from_str(name: &str) -> Result<Self, ImportError> {
        Self::from_name(name).ok_or_else(|| {
            let known: Vec<_> = Self::all().map(Self::name).collect();
            ImportError::mapping(
                format!("unknown field `{name}`"),
                format!("the fields are {}", known.join(", ")),
            )
        })
    }
}

impl Serialize for Field {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Field {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        name.parse()
            .map_err(|error: ImportError| de::Error::custom(format!("{error}; {}", error.help())))
    }
}

impl JsonSchema for Field {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Field".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let names: Vec<_> = Self::all().map(Self::name).collect();
        schemars::json_schema!({ "type": "string", "enum": names })
    }
}

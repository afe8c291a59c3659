//! Conversion of table rows to readings.

use jiff::Timestamp;
use sonard_model::{acoustics::Air, geometry::Pose, reading::PingStatus};

use crate::{
    Assumptions, Field, FieldQuantity, FileLocation, ImportError, Mapping,
    array_rounds::ArrayRound,
    mapping::Decimal,
    number::{self, DecimalEvidence},
    time::TimeReader,
};

/// Cells of the mapped columns, in the order of the mapping. A column has one cell, or one per
/// ranger of an array; `None` is an empty cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    pub(crate) place: FileLocation,
    pub(crate) cells: Vec<Vec<Option<String>>>,
}

/// Numbers as in the file, before conversion of units and direction sense and before no-echo values
/// are removed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct RawReading {
    /// Azimuth or bearing, in the unit of the file.
    pub(crate) direction: f64,
    /// Range or time of flight.
    pub(crate) range: Option<f64>,
}

/// Single firing, in the units and conventions of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedReading {
    /// Position in the file.
    pub location: FileLocation,
    /// Direction of the beam, degrees counter-clockwise: from the heading, or a bearing from the x
    /// axis.
    pub direction_deg: f64,
    /// True if `direction_deg` is a bearing in the world frame.
    pub is_bearing: bool,
    /// Outcome of the firing.
    pub status: PingStatus,
    /// Range of the first echo (half its path), metres.
    pub range_m: Option<f64>,
    /// Time of flight of the first echo, microseconds.
    pub tof_us: Option<f64>,
    /// Time at which the ranger fired.
    pub time: Option<Timestamp>,
    /// Scan identifier, where the file has one.
    pub scan: Option<String>,
    /// Position of the robot, x and y in metres.
    pub position_m: Option<[f64; 2]>,
    /// Heading of the robot, degrees.
    pub heading_deg: Option<f64>,
    /// Air at the reading, where the file contains its temperature.
    pub air: Option<Air>,
    /// Unconverted numbers of the file.
    pub(crate) raw: RawReading,
}

impl ImportedReading {
    /// Returns the pose of the robot, completed from `fallback`.
    pub(crate) fn pose(&self, fallback: &Pose) -> Pose {
        let [x_m, y_m] = self.position_m.unwrap_or([fallback.x_m, fallback.y_m]);
        Pose { x_m, y_m, heading_deg: self.heading_deg.unwrap_or(fallback.heading_deg) }
    }
}

/// Converts rows to readings, in their order.
#[derive(Debug)]
pub(crate) struct RowReader<'a> {
    mapping: &'a Mapping,
    fields: Vec<Field>,
    assumptions: &'a Assumptions,
    decimal: Decimal,
    pub(crate) times: TimeReader<'a>,
}

impl<'a> RowReader<'a> {
    /// # Errors
    /// Returns an error for an invalid UTC offset in the mapping.
    pub(crate) fn new(
        mapping: &'a Mapping,
        assumptions: &'a Assumptions,
        decimal: Decimal,
    ) -> Result<Self, ImportError> {
        let fields = mapping.columns.keys().copied().collect();
        Ok(Self {
            mapping,
            fields,
            assumptions,
            decimal,
            times: TimeReader::new(mapping, assumptions.started)?,
        })
    }

    /// Returns the cells of a quantity.
    fn cells<'r>(
        &self,
        row: &'r Row,
        quantity: FieldQuantity,
    ) -> Option<(Field, &'r [Option<String>])> {
        let place = self.fields.iter().position(|field| field.quantity() == quantity)?;
        Some((self.fields[place], row.cells.get(place)?))
    }

    /// Returns the first cell of a quantity, if it is not empty.
    fn cell<'r>(&self, row: &'r Row, quantity: FieldQuantity) -> Option<(Field, &'r str)> {
        let (field, cells) = self.cells(row, quantity)?;
        cells.first()?.as_deref().map(|cell| (field, cell))
    }

    fn number_of(
        &self,
        row: &Row,
        quantity: FieldQuantity,
    ) -> Result<Option<(Field, f64)>, ImportError> {
        let Some((field, cell)) = self.cell(row, quantity) else { return Ok(None) };
        Ok(self.number(row.place, field, cell)?.map(|number| (field, number)))
    }

    fn scaled(&self, row: &Row, quantity: FieldQuantity) -> Result<Option<f64>, ImportError> {
        let found = self.number_of(row, quantity)?;
        Ok(found.map(|(field, number)| field.scaled(number)))
    }

    /// Converts a row to a reading.
    ///
    /// # Errors
    /// Returns an error with field and column for an invalid value.
    pub(crate) fn read(&mut self, row: &Row) -> Result<ImportedReading, ImportError> {
        let is_bearing = self.mapping.field(FieldQuantity::Bearing).is_some();
        let direction = if is_bearing { FieldQuantity::Bearing } else { FieldQuantity::Azimuth };
        let fixed = self.mapping.azimuth_deg;
        let found = self.number_of(row, direction)?;
        let found = found.map(|(field, number)| (number, field.scaled(number)));
        let (raw_direction, direction_deg) =
            found.or(fixed.map(|deg| (deg, deg))).ok_or_else(|| {
                let what = format!("no {} in this row", direction.label());
                ImportError::at(
                    row.place,
                    what,
                    "every reading needs a direction: correct that row",
                )
            })?;
        let sense = if self.mapping.clockwise { -1.0 } else { 1.0 };
        let status = match self.cell(row, FieldQuantity::Status) {
            Some((_, word)) => Some(self.status(row.place, word)?),
            None => None,
        };
        let air = match self.scaled(row, FieldQuantity::Temperature)? {
            Some(temperature_c) => Some(self.air(row.place, temperature_c)?),
            None => None,
        };
        let sound_speed_m_s = air.unwrap_or(self.assumptions.air).sound_speed_m_s();
        let measured = match self.number_of(row, FieldQuantity::Range)? {
            Some(range) => Some(range),
            None => self.number_of(row, FieldQuantity::Tof)?,
        };
        let is_without = status.is_some_and(|status| status != PingStatus::Echo);
        let measured = measured.filter(|_| !is_without);
        let tof_us =
            measured.and_then(|(field, number)| self.tof_us(field, number, sound_speed_m_s));
        let range_m = tof_us.map(|tof_us| tof_us * 1e-6 * sound_speed_m_s / 2.0);
        let [x, y] = [self.scaled(row, FieldQuantity::X)?, self.scaled(row, FieldQuantity::Y)?];
        Ok(ImportedReading {
            location: row.place,
            direction_deg: fixed.unwrap_or(self.mapping.zero_deg + sense * direction_deg),
            is_bearing,
            status: status.unwrap_or(if range_m.is_some() {
                PingStatus::Echo
            } else {
                PingStatus::NoEcho
            }),
            range_m,
            tof_us,
            time: self.time(row)?,
            scan: self.cell(row, FieldQuantity::Scan).map(|(_, scan)| scan.to_owned()),
            position_m: x.zip(y).map(|(x, y)| [x, y]),
            heading_deg: self.scaled(row, FieldQuantity::Heading)?,
            air,
            raw: RawReading { direction: raw_direction, range: measured.map(|(_, number)| number) },
        })
    }

    /// Converts a row with one range per ranger to a round.
    ///
    /// # Errors
    /// Returns an error with field and column for an invalid value.
    pub(crate) fn round(&mut self, row: &Row) -> Result<ArrayRound, ImportError> {
        let found =
            self.cells(row, FieldQuantity::Range).or_else(|| self.cells(row, FieldQuantity::Tof));
        let Some((field, cells)) = found else {
            return Err(ImportError::mapping("no column has a range", "name one with --columns"));
        };
        let sound_speed_m_s = self.assumptions.air.sound_speed_m_s();
        let raw = cells.iter().map(|cell| match cell {
            Some(cell) => self.number(row.place, field, cell),
            None => Ok(None),
        });
        let raw: Vec<Option<f64>> = raw.collect::<Result<_, _>>()?;
        let range_m = |number: &Option<f64>| {
            let tof_us = self.tof_us(field, (*number)?, sound_speed_m_s)?;
            Some(tof_us * 1e-6 * sound_speed_m_s / 2.0)
        };
        let ranges_m = raw.iter().map(range_m).collect();
        let [x, y] = [self.scaled(row, FieldQuantity::X)?, self.scaled(row, FieldQuantity::Y)?];
        let heading_deg = self.scaled(row, FieldQuantity::Heading)?;
        let fallback = self.assumptions.pose;
        let pose = (x.is_some() || heading_deg.is_some()).then(|| Pose {
            x_m: x.unwrap_or(fallback.x_m),
            y_m: y.unwrap_or(fallback.y_m),
            heading_deg: heading_deg.unwrap_or(fallback.heading_deg),
        });
        Ok(ArrayRound { place: row.place, time: self.time(row)?, pose, ranges_m, raw })
    }

    fn air(&self, place: FileLocation, temperature_c: f64) -> Result<Air, ImportError> {
        let Assumptions { air, .. } = self.assumptions;
        Air::new(temperature_c, air.humidity_percent(), air.pressure_kpa())
            .map_err(|error| ImportError::at(place, error.to_string(), "is the unit right?"))
    }

    /// Converts a number of the file to a time of flight, microseconds; `None` for a no-echo value
    /// or a number that is not a distance.
    fn tof_us(&self, field: Field, number: f64, sound_speed_m_s: f64) -> Option<f64> {
        if self.mapping.is_no_echo(number) || number.is_infinite() || number <= 0.0 {
            return None;
        }
        Some(match field.quantity() {
            FieldQuantity::Tof => field.scaled(number),
            // A ranger measures time; its program computed the range with a sound speed of its own.
            _ => {
                let assumed_m_s = self.mapping.sound_speed_m_s.unwrap_or(sound_speed_m_s);
                2e6 * field.scaled(number) / assumed_m_s
            }
        })
    }

    /// Parses a number; `None` for the usual markers of a missing value.
    fn number(
        &self,
        place: FileLocation,
        field: Field,
        cell: &str,
    ) -> Result<Option<f64>, ImportError> {
        if is_missing(cell, field.quantity()) {
            return Ok(None);
        }
        let is_range = matches!(field.quantity(), FieldQuantity::Range | FieldQuantity::Tof);
        match number::parse(cell, self.decimal) {
            Some(number) if !number.is_finite() && !is_range => Err(self.invalid_value(
                place,
                field,
                format!("{cell} is not finite"),
                "correct that value",
            )),
            Some(number) => Ok(Some(number)),
            None => {
                let what = format!("`{}` is not a number", shortened(cell));
                let with_unit = cell.trim_end_matches(|c: char| c.is_alphabetic() || c == '\u{b0}');
                let has_unit = number::parse(with_unit, self.decimal).is_some();
                let help = match number::decimal_evidence(cell) {
                    DecimalEvidence::Unknown if has_unit => {
                        "remove the unit from the values, and name it in the column or with --columns"
                    }
                    DecimalEvidence::Unknown if is_range => {
                        "is it the right column? see --columns; if the word means no echo, leave the value empty"
                    }
                    DecimalEvidence::Unknown => "is it the right column? see --columns",
                    _ => "is the comma a decimal sign? --decimal comma",
                };
                Err(self.invalid_value(place, field, what, help))
            }
        }
    }

    fn status(&self, place: FileLocation, word: &str) -> Result<PingStatus, ImportError> {
        serde_json::from_value(word.to_lowercase().into()).map_err(|_| {
            let what = format!("unknown status `{}`", shortened(word));
            ImportError::at(place, what, "use echo, no_echo, min_range or link_lost")
        })
    }

    fn time(&mut self, row: &Row) -> Result<Option<Timestamp>, ImportError> {
        let Some((field, cell)) = self.cell(row, FieldQuantity::Time) else { return Ok(None) };
        let read = if field.name() == "time" {
            self.times.parse_text(cell)
        } else {
            let Some(number) = self.number(row.place, field, cell)? else { return Ok(None) };
            self.times.number(Some(field), field.scaled(number)).map(Some)
        };
        read.map_err(|(what, help)| self.invalid_value(row.place, field, what, &help))
    }

    fn invalid_value(
        &self,
        place: FileLocation,
        field: Field,
        what: String,
        help: &str,
    ) -> ImportError {
        let column = self.mapping.columns.get(&field).map(|column| format!("{field} ({column})"));
        ImportError::At { place, column, what, help: help.to_owned() }
    }
}

/// Returns `true` for the usual markers of a missing value; for a range, also for words that mean
/// no echo.
fn is_missing(cell: &str, quantity: FieldQuantity) -> bool {
    let cell = cell.to_lowercase();
    let is_dashes = !cell.is_empty() && cell.bytes().all(|byte| byte == b'-');
    let is_range = matches!(quantity, FieldQuantity::Range | FieldQuantity::Tof);
    is_dashes
        || matches!(cell.as_str(), "nan" | "null" | "none" | "nil" | "na" | "n/a" | "#n/a" | "n.a.")
        || (is_range && NO_ECHO_WORDS.contains(&cell.as_str()))
}

/// Words that programs write in place of a range where no echo was received.
const NO_ECHO_WORDS: [&str; 8] =
    ["no echo", "no_echo", "noecho", "out of range", "out_of_range", "timeout", "ol", "overflow"];

/// Truncates a text for an error message.
fn shortened(text: &str) -> String {
    let short: String = text.chars().take(40).collect();
    if short.len() < text.len() { format!("{short}...") } else { short }
}

//! A row's numbers as a reading.

use jiff::Timestamp;
use sonard_model::{acoustics::Air, geometry::Pose, reading::PingStatus};

use crate::{Field, ImportError, Location, Mapping, Quantity, Taken};

/// The values of the mapping's columns, in its order; `None` where there is nothing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    pub(crate) place: Location,
    pub(crate) cells: Vec<Option<String>>,
}

/// One firing, in the units and senses of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Where it stands in the file.
    pub place: Location,
    /// Direction of the beam, degrees counter-clockwise: from the heading, or of a bearing in the world.
    pub direction_deg: f64,
    /// Whether that is a bearing.
    pub is_bearing: bool,
    /// What became of it.
    pub status: PingStatus,
    /// Half the path of its first echo, metres.
    pub range_m: Option<f64>,
    /// Its time of flight, microseconds.
    pub tof_us: Option<f64>,
    /// When it was fired.
    pub time: Option<Timestamp>,
    /// Which scan it belongs to, where the file says so.
    pub scan: Option<String>,
    /// Where the robot stood: x and y in metres, and heading in degrees.
    pub place_m: Option<[f64; 2]>,
    /// The same.
    pub heading_deg: Option<f64>,
    /// The air, where the file says its temperature.
    pub air: Option<Air>,
}

impl Reading {
    /// Where the robot stood, with what the row does not say from another pose.
    pub(crate) fn pose(&self, otherwise: &Pose) -> Pose {
        let [x_m, y_m] = self.place_m.unwrap_or([otherwise.x_m, otherwise.y_m]);
        Pose { x_m, y_m, heading_deg: self.heading_deg.unwrap_or(otherwise.heading_deg) }
    }
}

/// Makes readings of rows.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    mapping: &'a Mapping,
    fields: Vec<Field>,
    taken: &'a Taken,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(mapping: &'a Mapping, taken: &'a Taken) -> Self {
        Self { mapping, fields: mapping.columns.keys().copied().collect(), taken }
    }

    /// The reading of a row.
    ///
    /// # Errors
    /// A value that is none, with its field and column.
    pub(crate) fn read(&self, row: &Row) -> Result<Reading, ImportError> {
        let cells = || self.fields.iter().copied().zip(&row.cells);
        let text = |quantity: Quantity| {
            let (_, cell) = cells().find(|(field, _)| field.quantity() == quantity)?;
            cell.clone()
        };
        let number = |quantity: Quantity| {
            let found = cells().find(|(field, _)| field.quantity() == quantity);
            let Some((field, Some(cell))) = found else { return Ok(None) };
            self.number(row.place, field, cell).map(|number| number.map(|number| (field, number)))
        };
        let scaled = |quantity| {
            number(quantity).map(|found| found.map(|(field, number)| field.scaled(number)))
        };
        let is_bearing = self.mapping.field(Quantity::Bearing).is_some();
        let direction = if is_bearing { Quantity::Bearing } else { Quantity::Azimuth };
        let direction_deg = scaled(direction)?.ok_or_else(|| {
            let what = format!("there is no {}", direction.words());
            ImportError::at(row.place, what, "every reading needs a direction: correct that row")
        })?;
        let sense = if self.mapping.clockwise { -1.0 } else { 1.0 };
        let status = match text(Quantity::Status) {
            Some(word) => Some(self.status(row.place, &word)?),
            None => None,
        };
        let air = match scaled(Quantity::Temperature)? {
            Some(temperature_c) => Some(self.air(row.place, temperature_c)?),
            None => None,
        };
        let sound_speed_m_s = air.unwrap_or(self.taken.air).sound_speed_m_s();
        let measured = number(Quantity::Range)?.or(number(Quantity::Tof)?);
        let tof_us = self.tof_us(row.place, measured, status, sound_speed_m_s)?;
        let range_m = tof_us.map(|tof_us| tof_us * 1e-6 * sound_speed_m_s / 2.0);
        let [x, y] = [scaled(Quantity::X)?, scaled(Quantity::Y)?];
        Ok(Reading {
            place: row.place,
            direction_deg: self.mapping.zero_deg + sense * direction_deg,
            is_bearing,
            status: status.unwrap_or(if range_m.is_some() {
                PingStatus::Echo
            } else {
                PingStatus::NoEcho
            }),
            range_m,
            tof_us,
            time: self.time(row)?,
            scan: text(Quantity::Scan),
            place_m: x.zip(y).map(|(x, y)| [x, y]),
            heading_deg: scaled(Quantity::Heading)?,
            air,
        })
    }

    fn air(&self, place: Location, temperature_c: f64) -> Result<Air, ImportError> {
        let Taken { air, .. } = self.taken;
        Air::new(temperature_c, air.humidity_percent(), air.pressure_kpa())
            .map_err(|error| ImportError::at(place, error.to_string(), "is the unit right?"))
    }

    /// The time of flight of a row, microseconds; `None` where nothing was heard.
    fn tof_us(
        &self,
        place: Location,
        measured: Option<(Field, f64)>,
        status: Option<PingStatus>,
        sound_speed_m_s: f64,
    ) -> Result<Option<f64>, ImportError> {
        let Some((field, number)) = measured else { return Ok(None) };
        let is_silent = status.is_some_and(|status| status != PingStatus::Echo);
        if self.mapping.is_silence(number) || number.is_infinite() || is_silent {
            return Ok(None);
        }
        if number <= 0.0 {
            let help = "if that means that nothing was heard, say so: --none=VALUE";
            return Err(self.wrong(
                place,
                field,
                format!("a {} of {number}", field.quantity().words()),
                help,
            ));
        }
        Ok(Some(match field.quantity() {
            Quantity::Tof => field.scaled(number),
            // What the ranger measured is a time: its program made a range of that.
            _ => {
                let assumed_m_s = self.mapping.sound_speed_m_s.unwrap_or(sound_speed_m_s);
                2e6 * field.scaled(number) / assumed_m_s
            }
        }))
    }

    /// A number; `None` where the cell says that there is none.
    fn number(
        &self,
        place: Location,
        field: Field,
        cell: &str,
    ) -> Result<Option<f64>, ImportError> {
        match cell.to_lowercase().as_str() {
            "nan" | "null" | "none" | "na" | "n/a" | "-" => return Ok(None),
            _ => {}
        }
        match cell.parse::<f64>() {
            Ok(number) if !number.is_finite() && field.quantity() != Quantity::Range => {
                Err(self.wrong(place, field, format!("{cell} is not finite"), "correct that value"))
            }
            Ok(number) => Ok(Some(number)),
            Err(_) => {
                let what = format!("`{}` is no number", shortened(cell));
                Err(self.wrong(place, field, what, "is it the right column? see --columns"))
            }
        }
    }

    fn status(&self, place: Location, word: &str) -> Result<PingStatus, ImportError> {
        serde_json::from_value(word.to_lowercase().into()).map_err(|_| {
            let what = format!("`{}` is no status", shortened(word));
            ImportError::at(place, what, "write echo, no_echo, min_range or link_lost")
        })
    }

    fn time(&self, row: &Row) -> Result<Option<Timestamp>, ImportError> {
        let found = self
            .fields
            .iter()
            .zip(&row.cells)
            .find(|(field, _)| field.quantity() == Quantity::Time);
        let Some((&field, Some(cell))) = found else { return Ok(None) };
        if field.name() == "time" {
            let time = cell.parse::<Timestamp>();
            return time.map(Some).map_err(|error| {
                let help =
                    "write it as in 2026-01-31T12:00:00Z, or name a column time_s for seconds";
                self.wrong(row.place, field, error.to_string(), help)
            });
        }
        let Some(seconds) = self.number(row.place, field, cell)? else { return Ok(None) };
        let nanoseconds = (field.scaled(seconds) * 1e9).round();
        Timestamp::from_nanosecond(nanoseconds as i128).map(Some).map_err(|error| {
            self.wrong(
                row.place,
                field,
                error.to_string(),
                "times count from 1970: is the unit right?",
            )
        })
    }

    fn wrong(&self, place: Location, field: Field, what: String, help: &str) -> ImportError {
        let column = self.mapping.columns.get(&field).map(|column| format!("{field} ({column})"));
        ImportError::At { place, column, what, help: help.to_owned() }
    }
}

/// So much of a text as an error can show.
fn shortened(text: &str) -> String {
    let short: String = text.chars().take(40).collect();
    if short.len() < text.len() { format!("{short}...") } else { short }
}

//! A row's numbers as a reading.

use jiff::Timestamp;
use sonard_model::{acoustics::Air, geometry::Pose, reading::PingStatus};

use crate::{
    Field, ImportError, Location, Mapping, Quantity, Taken, mapping::Decimal, number,
    rounds::Round, time::Times,
};

/// The values of the mapping's columns, in its order: one each, or of an array one a ranger; `None` where there is
/// nothing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    pub(crate) place: Location,
    pub(crate) cells: Vec<Vec<Option<String>>>,
}

/// Numbers of a reading as the file has them, before units, senses and no echo.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Raw {
    /// Azimuth or bearing.
    pub(crate) direction: f64,
    /// Range or time of flight.
    pub(crate) range: Option<f64>,
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
    /// The same numbers as the file has them.
    pub(crate) raw: Raw,
}

impl Reading {
    /// Where the robot stood, with what the row does not say from another pose.
    pub(crate) fn pose(&self, otherwise: &Pose) -> Pose {
        let [x_m, y_m] = self.place_m.unwrap_or([otherwise.x_m, otherwise.y_m]);
        Pose { x_m, y_m, heading_deg: self.heading_deg.unwrap_or(otherwise.heading_deg) }
    }
}

/// Makes readings of rows, in their order.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    mapping: &'a Mapping,
    fields: Vec<Field>,
    taken: &'a Taken,
    decimal: Decimal,
    pub(crate) times: Times<'a>,
}

impl<'a> Reader<'a> {
    /// # Errors
    /// The mapping has an offset from UTC that is none.
    pub(crate) fn new(
        mapping: &'a Mapping,
        taken: &'a Taken,
        decimal: Decimal,
    ) -> Result<Self, ImportError> {
        let fields = mapping.columns.keys().copied().collect();
        Ok(Self { mapping, fields, taken, decimal, times: Times::new(mapping, taken.started)? })
    }

    /// The cells of a quantity.
    fn cells<'r>(&self, row: &'r Row, quantity: Quantity) -> Option<(Field, &'r [Option<String>])> {
        let place = self.fields.iter().position(|field| field.quantity() == quantity)?;
        Some((self.fields[place], row.cells.get(place)?))
    }

    /// The cell of a quantity that has one.
    fn cell<'r>(&self, row: &'r Row, quantity: Quantity) -> Option<(Field, &'r str)> {
        let (field, cells) = self.cells(row, quantity)?;
        cells.first()?.as_deref().map(|cell| (field, cell))
    }

    fn number_of(
        &self,
        row: &Row,
        quantity: Quantity,
    ) -> Result<Option<(Field, f64)>, ImportError> {
        let Some((field, cell)) = self.cell(row, quantity) else { return Ok(None) };
        Ok(self.number(row.place, field, cell)?.map(|number| (field, number)))
    }

    fn scaled(&self, row: &Row, quantity: Quantity) -> Result<Option<f64>, ImportError> {
        let found = self.number_of(row, quantity)?;
        Ok(found.map(|(field, number)| field.scaled(number)))
    }

    /// The reading of a row.
    ///
    /// # Errors
    /// A value that is none, with its field and column.
    pub(crate) fn read(&mut self, row: &Row) -> Result<Reading, ImportError> {
        let is_bearing = self.mapping.field(Quantity::Bearing).is_some();
        let direction = if is_bearing { Quantity::Bearing } else { Quantity::Azimuth };
        let fixed = self.mapping.azimuth_deg;
        let found = self.number_of(row, direction)?;
        let found = found.map(|(field, number)| (number, field.scaled(number)));
        let (raw_direction, direction_deg) =
            found.or(fixed.map(|deg| (deg, deg))).ok_or_else(|| {
                let what = format!("there is no {}", direction.words());
                ImportError::at(
                    row.place,
                    what,
                    "every reading needs a direction: correct that row",
                )
            })?;
        let sense = if self.mapping.clockwise { -1.0 } else { 1.0 };
        let status = match self.cell(row, Quantity::Status) {
            Some((_, word)) => Some(self.status(row.place, word)?),
            None => None,
        };
        let air = match self.scaled(row, Quantity::Temperature)? {
            Some(temperature_c) => Some(self.air(row.place, temperature_c)?),
            None => None,
        };
        let sound_speed_m_s = air.unwrap_or(self.taken.air).sound_speed_m_s();
        let measured = match self.number_of(row, Quantity::Range)? {
            Some(range) => Some(range),
            None => self.number_of(row, Quantity::Tof)?,
        };
        let is_without = status.is_some_and(|status| status != PingStatus::Echo);
        let measured = measured.filter(|_| !is_without);
        let tof_us =
            measured.and_then(|(field, number)| self.tof_us(field, number, sound_speed_m_s));
        let range_m = tof_us.map(|tof_us| tof_us * 1e-6 * sound_speed_m_s / 2.0);
        let [x, y] = [self.scaled(row, Quantity::X)?, self.scaled(row, Quantity::Y)?];
        Ok(Reading {
            place: row.place,
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
            scan: self.cell(row, Quantity::Scan).map(|(_, scan)| scan.to_owned()),
            place_m: x.zip(y).map(|(x, y)| [x, y]),
            heading_deg: self.scaled(row, Quantity::Heading)?,
            air,
            raw: Raw { direction: raw_direction, range: measured.map(|(_, number)| number) },
        })
    }

    /// The round of a row that has a range of each ranger.
    ///
    /// # Errors
    /// A value that is none, with its field and column.
    pub(crate) fn round(&mut self, row: &Row) -> Result<Round, ImportError> {
        let found = self.cells(row, Quantity::Range).or_else(|| self.cells(row, Quantity::Tof));
        let Some((field, cells)) = found else {
            return Err(ImportError::mapping("no column has a range", "name one with --columns"));
        };
        let sound_speed_m_s = self.taken.air.sound_speed_m_s();
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
        let [x, y] = [self.scaled(row, Quantity::X)?, self.scaled(row, Quantity::Y)?];
        let heading_deg = self.scaled(row, Quantity::Heading)?;
        let otherwise = self.taken.pose;
        let pose = (x.is_some() || heading_deg.is_some()).then(|| Pose {
            x_m: x.unwrap_or(otherwise.x_m),
            y_m: y.unwrap_or(otherwise.y_m),
            heading_deg: heading_deg.unwrap_or(otherwise.heading_deg),
        });
        Ok(Round { place: row.place, time: self.time(row)?, pose, ranges_m, raw })
    }

    fn air(&self, place: Location, temperature_c: f64) -> Result<Air, ImportError> {
        let Taken { air, .. } = self.taken;
        Air::new(temperature_c, air.humidity_percent(), air.pressure_kpa())
            .map_err(|error| ImportError::at(place, error.to_string(), "is the unit right?"))
    }

    /// The time of flight of a number of the file, microseconds; `None` of one that stands for no echo, or is no
    /// distance.
    fn tof_us(&self, field: Field, number: f64, sound_speed_m_s: f64) -> Option<f64> {
        if self.mapping.is_no_echo(number) || number.is_infinite() || number <= 0.0 {
            return None;
        }
        Some(match field.quantity() {
            Quantity::Tof => field.scaled(number),
            // What the ranger measured is a time: its program made a range of that.
            _ => {
                let assumed_m_s = self.mapping.sound_speed_m_s.unwrap_or(sound_speed_m_s);
                2e6 * field.scaled(number) / assumed_m_s
            }
        })
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
        match number::parse(cell, self.decimal) {
            Some(number) if !number.is_finite() && field.quantity() != Quantity::Range => {
                Err(self.wrong(place, field, format!("{cell} is not finite"), "correct that value"))
            }
            Some(number) => Ok(Some(number)),
            None => {
                let what = format!("`{}` is no number", shortened(cell));
                let help = match number::shows(cell) {
                    number::Shows::Nothing => "is it the right column? see --columns",
                    _ => "is the comma a decimal sign? --decimal comma",
                };
                Err(self.wrong(place, field, what, help))
            }
        }
    }

    fn status(&self, place: Location, word: &str) -> Result<PingStatus, ImportError> {
        serde_json::from_value(word.to_lowercase().into()).map_err(|_| {
            let what = format!("`{}` is no status", shortened(word));
            ImportError::at(place, what, "write echo, no_echo, min_range or link_lost")
        })
    }

    fn time(&mut self, row: &Row) -> Result<Option<Timestamp>, ImportError> {
        let Some((field, cell)) = self.cell(row, Quantity::Time) else { return Ok(None) };
        let read = if field.name() == "time" {
            self.times.text(cell)
        } else {
            let Some(number) = self.number(row.place, field, cell)? else { return Ok(None) };
            self.times.number(Some(field), field.scaled(number)).map(Some)
        };
        read.map_err(|(what, help)| self.wrong(row.place, field, what, &help))
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

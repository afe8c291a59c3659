//! Meaning of an imported file's columns, on the command line and in a mapping file.

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser as _, ValueParser};
use jiff::Timestamp;

use super::super::Failure;
use crate::import::{Decimal, FORMATS, Format, Mapping, RangeUnit};

/// Meaning of the file's columns.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Columns")]
pub(super) struct ColumnArgs {
    /// Meaning of the columns: FIELD=COLUMN,... with the number of the column, from 1, or its name; of JSON,
    /// the name of the member; of an array's rows the numbers of all ranges, as in range_m=1-8 [default: as the header says]
    #[arg(long, value_name = "FIELD=COLUMN,...")]
    columns: Option<String>,
    /// Format of the file [default: by its content]
    #[arg(long, value_name = "FORMAT", value_parser = format())]
    format: Option<Format>,
    /// File (TOML) with all of this: the keys format, columns, topics and those of the options here, with _ for -;
    /// options override it
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Topic of a recording to read; may be given several times [default: all Range but predictions, else LaserScan]
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
    /// Device of a Player log of several: HOST:ROBOT:INDEX, or the end of it [default: the first]
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Azimuths and bearings count clockwise
    #[arg(long)]
    clockwise: bool,
    /// Where azimuth zero points, degrees counter-clockwise from the heading (bearing zero: from the x axis)
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    zero_deg: Option<f64>,
    /// Azimuth, degrees counter-clockwise from the heading; that of every reading of a fixed ranger, whose file has no
    /// column for it
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    azimuth_deg: Option<f64>,
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
    /// Unit of ranges and limits in logs and recordings, whose formats specify metres
    #[arg(long, value_name = "UNIT", value_parser = one_of(&RangeUnit::ALL))]
    range_unit: Option<RangeUnit>,
    /// Sign before the fraction of numbers: point or comma [default: as the file shows]
    #[arg(long, value_name = "SIGN", value_parser = one_of(&DECIMALS))]
    decimal: Option<Decimal>,
    /// Encoding of a text, such as utf-16le or latin1 [default: as the file shows]
    #[arg(long, value_name = "NAME")]
    encoding: Option<String>,
    /// Form of times, in the signs of strftime: '%d/%m/%Y %H:%M:%S'
    #[arg(long, value_name = "FORM")]
    time_format: Option<String>,
    /// Offset from UTC of times without a zone, such as +01:00 [default: UTC]
    #[arg(long, value_name = "OFFSET", allow_hyphen_values = true)]
    utc_offset: Option<String>,
    /// Time of the first reading, where the file has times of day or counts from the start of a board
    /// (2026-01-31T12:00:00Z) [default: the file's date]
    #[arg(long, value_name = "TIME")]
    started: Option<Timestamp>,
}

const DECIMALS: [(&str, Decimal); 2] = [("point", Decimal::Point), ("comma", Decimal::Comma)];

/// The formats of the registry, each with what it holds.
fn format() -> ValueParser {
    let names = FORMATS.iter().map(|entry| PossibleValue::new(entry.name).help(entry.about));
    let parser = PossibleValuesParser::new(names.collect::<Vec<_>>());
    parser.try_map(|name| Format::named(&name).ok_or("no format of that name")).into()
}

fn one_of<T: Copy + Send + Sync + 'static>(values: &'static [(&'static str, T)]) -> ValueParser {
    let parser = PossibleValuesParser::new(values.iter().map(|(name, _)| *name));
    let find =
        |name: String| values.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
    parser.try_map(move |name| find(name).ok_or("no such value")).into()
}

impl ColumnArgs {
    /// The mapping of the file and of the options, which override it.
    pub(super) fn mapping(&self) -> Result<Mapping, Failure> {
        let mut mapping = match &self.mapping {
            Some(path) => read_mapping(path)?,
            None => Mapping::default(),
        };
        if let Some(columns) = &self.columns {
            mapping.columns = Mapping::columns_of(columns)
                .map_err(|error| Failure::input(format!("--columns: {error}"), error.help()))?;
        }
        mapping.format = self.format.or(mapping.format);
        if !self.topic.is_empty() {
            mapping.topics.clone_from(&self.topic);
        }
        mapping.clockwise |= self.clockwise;
        mapping.zero_deg = self.zero_deg.unwrap_or(mapping.zero_deg);
        mapping.azimuth_deg = self.azimuth_deg.or(mapping.azimuth_deg);
        if !self.none.is_empty() {
            mapping.none.clone_from(&self.none);
        }
        mapping.none_from = self.none_from.or(mapping.none_from);
        mapping.sound_speed_m_s = self.ranged_with.or(mapping.sound_speed_m_s);
        mapping.range_unit = self.range_unit.or(mapping.range_unit);
        mapping.decimal = self.decimal.or(mapping.decimal);
        mapping.started = self.started.or(mapping.started);
        for (given, kept) in [
            (&self.device, &mut mapping.device),
            (&self.encoding, &mut mapping.encoding),
            (&self.time_format, &mut mapping.time_format),
            (&self.utc_offset, &mut mapping.utc_offset),
        ] {
            if given.is_some() {
                kept.clone_from(given);
            }
        }
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

//! Meaning of an imported file's columns, from options and a mapping file.

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser as _, ValueParser};
use jiff::Timestamp;

use super::super::Failure;
use crate::import::{Decimal, FORMATS, Format, Mapping, RangeUnit};

/// Options for the meaning of the file's columns.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Columns")]
pub(super) struct ColumnArgs {
    /// Meaning of the columns: FIELD=COLUMN,... with the number of the column, from 1, or its name;
    /// for JSON, the name of the member; for an array's rows, the numbers of all ranges, as in
    /// range_m=1-8 [default: from the header]
    #[arg(long, value_name = "FIELD=COLUMN,...")]
    columns: Option<String>,
    /// Format of the file [default: from its content]
    #[arg(long, value_name = "FORMAT", value_parser = format())]
    format: Option<Format>,
    /// File (TOML) with these settings; keys: format, columns, topics, device, clockwise, zero_deg,
    /// azimuth_deg, unordered, none, none_from, sound_speed_m_s, range_unit, decimal, encoding,
    /// time_format, utc_offset, started. Options take precedence
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Topic of a recording to read (repeatable) [default: all Range except predictions, else
    /// LaserScan]
    #[arg(long, value_name = "TOPIC")]
    topic: Vec<String>,
    /// Device in a log of several: HOST:ROBOT:INDEX of Player, or the end of it; the host of CARMEN
    /// [default: the first]
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Azimuths and bearings are clockwise
    #[arg(long)]
    clockwise: bool,
    /// Direction of azimuth zero, degrees counter-clockwise from the heading (for bearings: from
    /// the x axis)
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    zero_deg: Option<f64>,
    /// Azimuth, degrees counter-clockwise from the heading; of every reading, for a fixed ranger
    /// whose file has no such column
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    azimuth_deg: Option<f64>,
    /// Readings of a scan are in no order of direction: all readings at one pose are a scan
    #[arg(long)]
    unordered: bool,
    /// Range, in the file's unit, that means no echo (repeatable)
    #[arg(long, alias = "none", value_name = "VALUE", allow_negative_numbers = true)]
    no_echo: Vec<f64>,
    /// Range, in the file's unit, at and above which there is no echo
    #[arg(long, alias = "none-from", value_name = "VALUE")]
    no_echo_from: Option<f64>,
    /// Speed of sound with which the file's ranges were computed, metres per second; they are
    /// converted to the speed of sound in the air
    #[arg(long, value_name = "M/S")]
    source_sound_speed: Option<f64>,
    /// Unit of ranges and limits in logs and recordings whose format specifies metres
    #[arg(long, value_name = "UNIT", value_parser = one_of(&RangeUnit::ALL))]
    range_unit: Option<RangeUnit>,
    /// Decimal separator of numbers: point or comma [default: detected]
    #[arg(long, value_name = "SIGN", value_parser = one_of(&DECIMALS))]
    decimal: Option<Decimal>,
    /// Encoding of a text, such as utf-16le or latin1 [default: detected]
    #[arg(long, value_name = "NAME")]
    encoding: Option<String>,
    /// Format of times, as for strftime: '%d/%m/%Y %H:%M:%S'
    #[arg(long, value_name = "FORM")]
    time_format: Option<String>,
    /// Offset from UTC of times without a zone, such as +01:00 [default: UTC]
    #[arg(long, value_name = "OFFSET", allow_hyphen_values = true)]
    utc_offset: Option<String>,
    /// Time of the first reading, for files with times of day or times since start-up
    /// (2026-01-31T12:00:00Z) [default: the file's modification time]
    #[arg(long, value_name = "TIME")]
    started: Option<Timestamp>,
}

const DECIMALS: [(&str, Decimal); 2] = [("point", Decimal::Point), ("comma", Decimal::Comma)];

/// Parser of format names, with descriptions from the registry.
fn format() -> ValueParser {
    let names = FORMATS.iter().map(|entry| PossibleValue::new(entry.name).help(entry.about));
    let parser = PossibleValuesParser::new(names.collect::<Vec<_>>());
    parser.try_map(|name| Format::from_name(&name).ok_or("no format of that name")).into()
}

fn one_of<T: Copy + Send + Sync + 'static>(values: &'static [(&'static str, T)]) -> ValueParser {
    let parser = PossibleValuesParser::new(values.iter().map(|(name, _)| *name));
    let find =
        |name: String| values.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
    parser.try_map(move |name| find(name).ok_or("no such value")).into()
}

impl ColumnArgs {
    /// Returns the mapping of the file, overridden by the options.
    pub(super) fn mapping(&self) -> Result<Mapping, Failure> {
        let mut mapping = match &self.mapping {
            Some(path) => read_mapping(path)?,
            None => Mapping::default(),
        };
        if let Some(columns) = &self.columns {
            mapping.columns = Mapping::parse_columns(columns)
                .map_err(|error| Failure::input(format!("--columns: {error}"), error.help()))?;
        }
        mapping.format = self.format.or(mapping.format);
        if !self.topic.is_empty() {
            mapping.topics.clone_from(&self.topic);
        }
        mapping.clockwise |= self.clockwise;
        mapping.unordered |= self.unordered;
        mapping.zero_deg = self.zero_deg.unwrap_or(mapping.zero_deg);
        mapping.azimuth_deg = self.azimuth_deg.or(mapping.azimuth_deg);
        if !self.no_echo.is_empty() {
            mapping.none.clone_from(&self.no_echo);
        }
        mapping.none_from = self.no_echo_from.or(mapping.none_from);
        mapping.sound_speed_m_s = self.source_sound_speed.or(mapping.sound_speed_m_s);
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
            let what = format!("--source-sound-speed is {speed} m/s");
            return Err(Failure::input(what, "give metres per second, 200 to 500"));
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
        Failure::input(
            format!("{name}: {error}"),
            "see --mapping in `sonard import --help` for the keys",
        )
    })
}

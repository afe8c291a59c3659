//! Examination of text files, and their second reading for records.

use std::{collections::VecDeque, io::Read};

use serde_json::Value;

use crate::{
    Column, Field, FieldQuantity, FileLocation, ImportError, ImportSource, Imported,
    ImportedReading, Row,
    array_rounds::{self, DeviceCounts, LogMessage, RoundReader},
    format::ReadLine,
    json::{self, FirstEntry},
    layout::TableLayout,
    lines::{LineEnding, LineReader},
    mapping::{Decimal, columns_option},
    no_echo_constant::DirectionKind,
    reading::RowReader,
    ros_text,
    scans::{self, ScanSplitter},
    source::ScanRecords,
    table::{self, RowFaults},
    text::Survey,
    unit_check::{RangeStats, SweepStats, UnitContext},
};

/// Rows of a table or of JSON.
type Rows<'a> = Box<dyn Iterator<Item = Result<Row, ImportError>> + 'a>;

impl ImportSource<'_> {
    pub(crate) fn examine_rows(
        &self,
        survey: &Survey,
        head: &str,
        found: &mut Imported,
    ) -> Result<(), ImportError> {
        let names = self.names(head, found)?;
        found.mapping.check_fields(found.is_of_array())?;
        let rangers = found.assumptions.array.as_ref().map(|array| array.rangers.len());
        if found.is_of_array() {
            return self.examine_rounds(&names, found);
        }
        if rangers.is_some() {
            return Err(ImportError::mapping(
                "--array needs rows with one range per ranger, but a single column is mapped to the range",
                "leave --array out, or map the columns of all ranges: --columns range_m=1-8",
            ));
        }
        let mut faults = RowFaults::default();
        let mut stats = SweepStats::new();
        let mut reader = RowReader::new(&found.mapping, &found.assumptions, found.decimal())?;
        let units = UnitContext {
            mapping: &found.mapping,
            names: &names,
            has_columns: true,
            zero_is_no_echo: false,
        };
        match &found.header {
            Some(header) => {
                let source = found.decoded((self.open)()?);
                let mut rows = table::TableRows::new(source, header, &found.mapping)?;
                for row in rows.by_ref() {
                    stats.add(&reader.read(&row?)?, (&units, &found.assumptions));
                }
                faults = rows.faults;
            }
            None => {
                for row in found.rows((self.open)()?)? {
                    stats.add(&reader.read(&row?)?, (&units, &found.assumptions));
                }
            }
        }
        check_one_row(found, stats.ranges.readings)?;
        let notes = stats.check(&units, &found.assumptions)?;
        let times = reader.times.notes();
        found.notes.extend(notes);
        found.notes.extend(times);
        found.note_ends(survey, faults);
        (found.readings, found.echoes) = (stats.ranges.readings, stats.ranges.echoes);
        found.has_poses = found.mapping.field(FieldQuantity::X).is_some();
        Ok(())
    }

    /// Returns the column names; detects the layout of a table and completes the mapping.
    fn names(&self, head: &str, found: &mut Imported) -> Result<Vec<String>, ImportError> {
        let rangers = found.assumptions.array.as_ref().map(|array| array.rangers.len());
        let (names, columns) = if found.format == crate::Format::Json {
            match self.json_entry(head, found)? {
                FirstEntry::Names(names) => (names, None),
                FirstEntry::List(length) => (Vec::new(), Some(length)),
                FirstEntry::Other => (Vec::new(), None),
            }
        } else {
            let header = TableLayout::detect(head, &found.mapping)?;
            found.notes.extend(header.notes.iter().cloned());
            let names = if header.has_names { header.cells.clone() } else { Vec::new() };
            let columns = header.cells.len();
            found.header = Some(header);
            (names, Some(columns))
        };
        if !found.is_inferred {
            return Ok(names);
        }
        if let Some(rangers) = rangers {
            if found.mapping.infer_array(&names, rangers) {
                return Ok(names);
            }
            if let Some(columns) = columns.filter(|_| names.is_empty()) {
                return Err(missing_array_unit(found, columns, rangers));
            }
        }
        if names.is_empty() {
            return Err(missing_names(columns, found.format == crate::Format::Json));
        }
        let notes = found.mapping.infer_columns(&names)?;
        found.notes.extend(notes);
        Ok(names)
    }

    /// Returns the kind of the first entry of a JSON file; reads the whole file if the entry
    /// exceeds the head.
    fn json_entry(&self, head: &str, found: &Imported) -> Result<FirstEntry, ImportError> {
        if let Some(entry) = FirstEntry::from_head(head) {
            return Ok(entry);
        }
        let source = found.decoded((self.open)()?);
        let first = json::objects(source)?.next();
        Ok(first.transpose()?.map_or(FirstEntry::Other, |value| FirstEntry::from_value(&value)))
    }

    /// Examines rows that are rounds of an array.
    fn examine_rounds(&self, names: &[String], found: &mut Imported) -> Result<(), ImportError> {
        let Some(array) = &found.assumptions.array else {
            return Err(ImportError::mapping(
                "several columns of ranges need an array",
                "give the array: --array NAME or FILE",
            ));
        };
        let count = array.rangers.len();
        let mut reader = RowReader::new(&found.mapping, &found.assumptions, found.decimal())?;
        let mut ranges = RangeStats::new(DirectionKind::Rangers);
        let units = UnitContext {
            mapping: &found.mapping,
            names,
            has_columns: true,
            zero_is_no_echo: false,
        };
        let mut has_poses = false;
        for row in found.rows((self.open)()?)? {
            let round = reader.round(&row?)?;
            if round.raw.len() != count {
                let what = format!(
                    "{} ranges, but the array {} has {count} rangers",
                    round.raw.len(),
                    array.name
                );
                return Err(ImportError::at(
                    round.place,
                    what,
                    "give the array with which the file was recorded",
                ));
            }
            has_poses |= round.pose.is_some();
            for (place, (raw, range_m)) in round.raw.iter().zip(&round.ranges_m).enumerate() {
                ranges.add(round.place, place as f64, *raw, *range_m, (&units, &found.assumptions));
            }
        }
        if ranges.readings == 0 {
            return Err(ImportError::mapping(
                "the file has no readings",
                "give a file with readings",
            ));
        }
        let notes = ranges.check(&units, &found.assumptions)?;
        let times = reader.times.notes();
        found.notes.extend(notes.into_iter().chain(times));
        found.has_poses = has_poses;
        (found.readings, found.echoes) = (ranges.readings, ranges.echoes);
        Ok(())
    }

    pub(crate) fn examine_ros_text(&self, found: &mut Imported) -> Result<(), ImportError> {
        found.is_inferred = false;
        let mut stats = SweepStats::new();
        let mut reader =
            ros_text::MessageConverter::new(&found.mapping, found.assumptions.started)?;
        let units = UnitContext {
            mapping: &found.mapping,
            names: &[],
            has_columns: false,
            zero_is_no_echo: true,
        };
        let (mut assumptions, metres) = (found.assumptions.clone(), found.mapping.metres());
        let source = found.decoded((self.open)()?);
        let mut has_fixed = false;
        for message in ros_text::messages(source, found.is_json)? {
            let message = message?;
            has_fixed |= ros_text::is_range(&message);
            let readings = reader.read(&message)?;
            // The messages state the range of their sensor.
            assumptions.max_range_m =
                assumptions.max_range_m.max(reader.notes.max_stated_m(metres));
            for reading in readings {
                stats.add(&reading, (&units, &assumptions));
            }
        }
        check_messages(&reader.notes, &found.assumptions)?;
        let notes = stats.check(&units, &assumptions)?;
        found.notes.extend(reader.notes.lines());
        found.notes.extend(reader.times.notes());
        found.notes.extend(notes);
        if reader.others > 0 {
            found.notes.push(format!(
                "skipped: {} messages, cut off or other than LaserScan and Range",
                reader.others
            ));
        }
        found.notes.push(
            "the file has no frames: the scanner is assumed upright and facing ahead".to_owned(),
        );
        if has_fixed && found.mapping.azimuth_deg.is_none() {
            found.notes.push(
                "Range messages have no direction: assumed ahead; set it with --azimuth-deg DEG"
                    .to_owned(),
            );
        }
        (found.readings, found.echoes) = (stats.ranges.readings, stats.ranges.echoes);
        Ok(())
    }

    pub(crate) fn examine_lines(
        &self,
        read: ReadLine,
        survey: &Survey,
        found: &mut Imported,
    ) -> Result<(), ImportError> {
        found.is_inferred = false;
        let mut counts = DeviceCounts::default();
        let mut cut = None;
        let note_cut = |place| cut = Some(place);
        for message in messages(read, found.decoded((self.open)()?), note_cut) {
            counts.add(&message?.1);
        }
        if let Some(place) = cut {
            found.notes.push(format!("{place} is incomplete: skipped"));
        } else if !survey.ends_with_line_end() {
            found.notes.push("the last line has no line end: it may be truncated".to_owned());
        }
        let (devices, notes) = counts.select(found.mapping.device.as_deref())?;
        found.notes.extend(notes);
        found.devices = devices;
        let mut rounds =
            RoundReader::new(&found.mapping, &found.devices, found.assumptions.started)?;
        let mut ranges = RangeStats::new(DirectionKind::Rangers);
        let units = UnitContext {
            mapping: &found.mapping,
            names: &[],
            has_columns: false,
            zero_is_no_echo: true,
        };
        let mut has_poses = false;
        for message in messages(read, found.decoded((self.open)()?), |_| ()) {
            let (place, message) = message?;
            let Some(round) = rounds.push(place, message)? else { continue };
            has_poses |= round.pose.is_some();
            for (ranger, (raw, range_m)) in round.raw.iter().zip(&round.ranges_m).enumerate() {
                ranges.add(place, ranger as f64, *raw, *range_m, (&units, &found.assumptions));
            }
        }
        let Some(count) = rounds.rangers else {
            return Err(ImportError::mapping(
                "the log has no sonar messages",
                "give a log with sonar data",
            ));
        };
        let (array, note) = match (&rounds.geometry, &found.assumptions.array) {
            (Some(geometry), given) => {
                let note = given.as_ref().map(|given| {
                    format!(
                        "the log contains the positions of its rangers: the array {} is ignored",
                        given.name
                    )
                });
                (array_rounds::array(geometry, &found.assumptions.sensor), note)
            }
            (None, Some(array)) => (array.clone(), None),
            (None, None) => {
                return Err(ImportError::mapping(
                    format!("the log does not contain the positions of its {count} rangers"),
                    "give the array: --array NAME or FILE",
                ));
            }
        };
        if rounds.skipped > 0 && ranges.readings == 0 {
            return Err(ImportError::mapping(
                format!("all {} rounds are before the first pose of the log", rounds.skipped),
                "give a log in which poses precede the ranges",
            ));
        }
        if array.rangers.len() != count {
            return Err(ImportError::mapping(
                format!(
                    "the log has {count} rangers, but the array {} has {}",
                    array.name,
                    array.rangers.len()
                ),
                "give the array with which the log was recorded",
            ));
        }
        let notes = ranges.check(&units, &found.assumptions)?;
        let times = rounds.times.notes();
        if rounds.skipped > 0 {
            found.notes.push(format!(
                "{} rounds before the first pose skipped, position unknown",
                rounds.skipped
            ));
        }
        (found.readings, found.echoes) = (ranges.readings, ranges.echoes);
        found.notes.extend(note.into_iter().chain(notes).chain(times));
        found.has_poses = has_poses;
        found.assumptions.array = Some(array);
        Ok(())
    }
}

/// Rejects messages whose ranges are all outside their limits, or whose angles are degrees.
pub(crate) fn check_messages(
    notes: &crate::limits::LimitNotes,
    assumptions: &crate::Assumptions,
) -> Result<(), ImportError> {
    match notes.unit_fault() {
        Some((what, help)) if !assumptions.skip_checks => {
            Err(ImportError::Implausible { what, help: help.to_owned() })
        }
        _ => Ok(()),
    }
}

/// Rejects a table of a single long row, which has probably lost its line ends.
fn check_one_row(found: &Imported, readings: u64) -> Result<(), ImportError> {
    let Some(header) = found.header.as_ref().filter(|header| !header.has_names) else {
        return Ok(());
    };
    let (values, columns) = (header.cells.len(), found.mapping.columns.len());
    if readings != 1 || values < 2 * columns.max(2) || found.assumptions.skip_checks {
        return Ok(());
    }
    Err(ImportError::Implausible {
        what: format!("the file is one row of {values} values, of which {columns} are read"),
        help: "are line ends missing? Give one reading per line; --no-unit-check reads the row as it is"
            .to_owned(),
    })
}

/// Builds the error that requests the unit of rows with one value per ranger of the array.
fn missing_array_unit(found: &Imported, columns: usize, rangers: usize) -> ImportError {
    let name = found.assumptions.array.as_ref().map_or("", |array| &array.name);
    if columns != rangers {
        let ends = if columns > rangers { vec![rangers, columns] } else { Vec::new() };
        let field = Field::of_quantity(FieldQuantity::Range).take(1);
        let options = field.flat_map(|field| {
            ends.iter().map(move |end| {
                let column = Column::Several((end + 1 - rangers..=*end).collect());
                columns_option([(field, column)], &[])
            })
        });
        let options: Vec<String> = options.collect();
        let help = match options.is_empty() {
            true => "give the array with which the file was recorded".to_owned(),
            false => {
                format!("map the columns of its ranges, with their unit: {}", options.join(" | "))
            }
        };
        let what =
            format!("each row has {columns} values, but the array {name} has {rangers} rangers");
        return ImportError::mapping(what, help);
    }
    let column = Column::Several((1..=rangers).collect());
    let options = Field::of_quantity(FieldQuantity::Range)
        .take(3)
        .map(|field| columns_option([(field, column.clone())], &[]));
    let options: Vec<String> = options.collect();
    ImportError::mapping(
        format!(
            "each row has {rangers} values without names, as many as the array {name} has rangers"
        ),
        format!("select their unit: {}", options.join(" | ")),
    )
}

fn missing_names(columns: Option<usize>, is_json: bool) -> ImportError {
    let count = columns.map_or(String::new(), |count| format!(" of {count} values"));
    let what = if is_json {
        format!("the entries are lists{count} without names")
    } else {
        format!("the first line{count} has no column names")
    };
    let help = "map the columns by number, with units: --columns azimuth_deg=1,range_cm=2 (degrees and centimetres), \
                    --columns azimuth_rad=1,range_m=2 (radians and metres), or one column per ranger of an array: \
                    --array NAME --columns range_m=1-8";
    ImportError::mapping(what, help)
}

impl Imported {
    /// Returns `true` if each row is a round of an array.
    pub(crate) fn is_of_array(&self) -> bool {
        self.mapping.has_array_columns()
            || (self.format == crate::Format::Json && self.assumptions.array.is_some())
    }

    fn decimal(&self) -> Decimal {
        let by_header = self.header.as_ref().map(|header| header.decimal);
        self.mapping.decimal.or(by_header).unwrap_or(Decimal::Point)
    }

    fn note_ends(&mut self, survey: &Survey, faults: RowFaults) {
        let cut = faults.cut.iter().flatten();
        self.notes.extend(
            cut.map(|place| format!("{place} is incomplete (a column is missing): skipped")),
        );
        if faults.cut[1].is_none()
            && self.header.as_ref().is_some_and(|header| header.ends == LineEnding::Lines)
            && !survey.ends_with_line_end()
        {
            self.notes
                .push("the last line has no line end: its last value may be truncated".to_owned());
        }
        if faults.short > 0 {
            self.notes.push(format!(
                "{} rows have fewer values than the table has columns; no mapped column is missing",
                faults.short
            ));
        }
    }

    fn rows<'a>(&'a self, source: impl Read + 'a) -> Result<Rows<'a>, ImportError> {
        let source = self.decoded(source);
        Ok(match &self.header {
            Some(header) => Box::new(table::TableRows::new(source, header, &self.mapping)?),
            None => json::rows(source, &self.mapping, self.is_of_array())?,
        })
    }

    pub(crate) fn scans_of_rows<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = ScanRecords> + 'a>, ImportError> {
        let mut reader = RowReader::new(&self.mapping, &self.assumptions, self.decimal())?;
        let readings = self.rows(source)?.map(move |row| reader.read(&row?));
        Ok(self.cut(readings))
    }

    pub(crate) fn scans_of_messages<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = ScanRecords> + 'a>, ImportError> {
        let mut reader = ros_text::MessageConverter::new(&self.mapping, self.assumptions.started)?;
        let messages = ros_text::messages(self.decoded(source), self.is_json)?;
        let air_m_s = self.assumptions.air.sound_speed_m_s();
        let assumed_m_s = self.mapping.sound_speed_m_s.unwrap_or(air_m_s);
        let readings = messages.flat_map(move |message: Result<Value, ImportError>| {
            let read = message.and_then(|message| reader.read(&message));
            let each = match read {
                Ok(readings) => readings.into_iter().map(Ok).collect::<Vec<_>>(),
                Err(error) => vec![Err(error)],
            };
            each.into_iter().map(move |reading: Result<ImportedReading, ImportError>| {
                reading.map(|reading| {
                    let tof_us = reading.range_m.map(|range_m| 2e6 * range_m / assumed_m_s);
                    let range_m = tof_us.map(|tof_us| tof_us * 1e-6 * air_m_s / 2.0);
                    ImportedReading { tof_us, range_m, ..reading }
                })
            })
        });
        Ok(self.cut(readings))
    }

    /// Splits readings into scans and converts them to records.
    fn cut<'a>(
        &'a self,
        mut readings: impl Iterator<Item = Result<ImportedReading, ImportError>> + 'a,
    ) -> Box<dyn Iterator<Item = ScanRecords> + 'a> {
        let (mut splitter, mut number) = (Some(ScanSplitter::new(self.mapping.unordered)), 0);
        let mut ready = VecDeque::new();
        Box::new(std::iter::from_fn(move || {
            let scan = loop {
                if let Some(scan) = ready.pop_front() {
                    break scan;
                }
                match readings.next() {
                    Some(Ok(reading)) => ready.extend(splitter.as_mut()?.push(reading)),
                    Some(Err(error)) => return Some(Err(error)),
                    None => ready.extend(splitter.take()?.finish()),
                }
            };
            number += 1;
            Some(Ok(scans::records(&self.assumptions, number, &scan)))
        }))
    }

    pub(crate) fn rounds_of_rows<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = ScanRecords> + 'a>, ImportError> {
        let mut reader = RowReader::new(&self.mapping, &self.assumptions, self.decimal())?;
        let rounds = self.rows(source)?.map(move |row| reader.round(&row?));
        Ok(Box::new(
            (1..)
                .zip(rounds)
                .map(|(number, round)| Ok(scans::round(&self.assumptions, number, &round?))),
        ))
    }

    pub(crate) fn rounds_of_lines<'a>(
        &'a self,
        read: ReadLine,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = ScanRecords> + 'a>, ImportError> {
        let mut rounds = RoundReader::new(&self.mapping, &self.devices, self.assumptions.started)?;
        let found = messages(read, self.decoded(source), |_| ()).filter_map(move |message| {
            let round = message.and_then(|(place, message)| rounds.push(place, message));
            round.transpose()
        });
        Ok(Box::new(
            (1..)
                .zip(found)
                .map(|(number, round)| Ok(scans::round(&self.assumptions, number, &round?))),
        ))
    }
}

/// Parses the range and pose messages of a robot's log, with their positions in the file. A last
/// line that is cut off is passed to `note_cut` and skipped.
fn messages(
    read: ReadLine,
    source: impl Read,
    mut note_cut: impl FnMut(FileLocation),
) -> impl Iterator<Item = Result<(FileLocation, LogMessage), ImportError>> {
    LineReader::new(source, LineEnding::Lines).filter_map(move |line| {
        let message = line.and_then(|line| match read(line.place(), &line.text) {
            Err(_) if !line.is_ended => {
                note_cut(line.place());
                Ok(None)
            }
            message => Ok(message?.map(|message| (line.place(), message))),
        });
        message.transpose()
    })
}

//! Texts of each kind: examined once, and read again for their records.

use std::io::Read;

use serde_json::Value;

use crate::{
    Column, Field, ImportError, Imported, Location, Quantity, Reading, Row, Source,
    doubt::{Doubts, Ranges, Ways},
    format::ReadLine,
    json::{self, Entry},
    layout::Header,
    lines::{Ends, Lines},
    mapping::{Decimal, columns_option},
    reading::Reader,
    ros_text,
    rounds::{self, Devices, Message, Rounds},
    scans::{self, Cutter},
    silence::Across,
    source::Scan,
    table::{self, Raggedness},
    text::Survey,
};

/// Rows of a table or of JSON.
type Rows<'a> = Box<dyn Iterator<Item = Result<Row, ImportError>> + 'a>;

impl Source<'_> {
    pub(crate) fn examine_rows(
        &self,
        survey: &Survey,
        head: &str,
        found: &mut Imported,
    ) -> Result<(), ImportError> {
        let names = self.names(head, found)?;
        found.mapping.check()?;
        let rangers = found.taken.array.as_ref().map(|array| array.rangers.len());
        if found.is_of_array() {
            return self.examine_rounds(&names, found);
        }
        if rangers.is_some() {
            return Err(ImportError::mapping(
                "--array is for rows with a range of each ranger, and one column has the range",
                "leave --array out, or give the columns of all ranges: --columns range_m=1-8",
            ));
        }
        let mut raggedness = Raggedness::default();
        let mut doubts = Doubts::new();
        let mut reader = Reader::new(&found.mapping, &found.taken, found.decimal())?;
        let ways = Ways {
            mapping: &found.mapping,
            names: &names,
            has_columns: true,
            zero_is_no_echo: false,
        };
        match &found.header {
            Some(header) => {
                let source = found.decoded((self.open)()?);
                let mut rows = table::Rows::of(source, header, &found.mapping)?;
                for row in rows.by_ref() {
                    doubts.add(&reader.read(&row?)?, (&ways, &found.taken));
                }
                raggedness = rows.raggedness;
            }
            None => {
                for row in found.rows((self.open)()?)? {
                    doubts.add(&reader.read(&row?)?, (&ways, &found.taken));
                }
            }
        }
        check_one_row(found, doubts.ranges.readings)?;
        let notes = doubts.check(&ways, &found.taken)?;
        let times = reader.times.notes();
        found.notes.extend(notes);
        found.notes.extend(times);
        found.note_ends(survey, raggedness);
        (found.readings, found.echoes) = (doubts.ranges.readings, doubts.ranges.echoes);
        found.has_poses = found.mapping.field(Quantity::X).is_some();
        Ok(())
    }

    /// Names of the columns, with the layout of a table, and the mapping completed by them.
    fn names(&self, head: &str, found: &mut Imported) -> Result<Vec<String>, ImportError> {
        let rangers = found.taken.array.as_ref().map(|array| array.rangers.len());
        let (names, columns) = if found.format == crate::Format::Json {
            match self.json_entry(head, found)? {
                Entry::Names(names) => (names, None),
                Entry::List(length) => (Vec::new(), Some(length)),
                Entry::Other => (Vec::new(), None),
            }
        } else {
            let header = Header::of(head, &found.mapping)?;
            found.notes.extend(header.notes.iter().cloned());
            let names = if header.has_names { header.cells.clone() } else { Vec::new() };
            let columns = header.cells.len();
            found.header = Some(header);
            (names, Some(columns))
        };
        if !found.guessed {
            return Ok(names);
        }
        if let Some(rangers) = rangers {
            if found.mapping.guess_array(&names, rangers) {
                return Ok(names);
            }
            if names.is_empty() && columns == Some(rangers) {
                return Err(ask_unit_of_array(found, rangers));
            }
        }
        if names.is_empty() {
            return Err(unnamed(columns, found.format == crate::Format::Json));
        }
        let notes = found.mapping.guess(&names)?;
        found.notes.extend(notes);
        Ok(names)
    }

    /// The first entry of a JSON file; of one too long for a look, the whole file is read.
    fn json_entry(&self, head: &str, found: &Imported) -> Result<Entry, ImportError> {
        if let Some(entry) = Entry::of_head(head) {
            return Ok(entry);
        }
        let source = found.decoded((self.open)()?);
        let first = json::objects(source)?.next();
        Ok(first.transpose()?.map_or(Entry::Other, |value| Entry::of(&value)))
    }

    /// Rows that are rounds of an array.
    fn examine_rounds(&self, names: &[String], found: &mut Imported) -> Result<(), ImportError> {
        let Some(array) = &found.taken.array else {
            return Err(ImportError::mapping(
                "several columns of ranges need an array",
                "give their places: --array NAME or FILE",
            ));
        };
        let count = array.rangers.len();
        let mut reader = Reader::new(&found.mapping, &found.taken, found.decimal())?;
        let mut ranges = Ranges::new(Across::Rangers);
        let ways =
            Ways { mapping: &found.mapping, names, has_columns: true, zero_is_no_echo: false };
        let mut has_poses = false;
        for row in found.rows((self.open)()?)? {
            let round = reader.round(&row?)?;
            if round.raw.len() != count {
                let what = format!(
                    "{} ranges, and the array {} has {count} rangers",
                    round.raw.len(),
                    array.name
                );
                return Err(ImportError::at(
                    round.place,
                    what,
                    "give the array that the file is of",
                ));
            }
            has_poses |= round.pose.is_some();
            for (place, (raw, range_m)) in round.raw.iter().zip(&round.ranges_m).enumerate() {
                ranges.add(round.place, place as f64, *raw, *range_m, (&ways, &found.taken));
            }
        }
        if ranges.readings == 0 {
            return Err(ImportError::mapping(
                "there is no reading in it",
                "give a file with readings",
            ));
        }
        let notes = ranges.check(&ways, &found.taken)?;
        let times = reader.times.notes();
        found.notes.extend(notes.into_iter().chain(times));
        found.has_poses = has_poses;
        (found.readings, found.echoes) = (ranges.readings, ranges.echoes);
        Ok(())
    }

    pub(crate) fn examine_ros_text(&self, found: &mut Imported) -> Result<(), ImportError> {
        found.guessed = false;
        let mut doubts = Doubts::new();
        let mut reader = ros_text::Reader::new(&found.mapping);
        let ways =
            Ways { mapping: &found.mapping, names: &[], has_columns: false, zero_is_no_echo: true };
        let source = found.decoded((self.open)()?);
        let mut has_fixed = false;
        for message in ros_text::messages(source, found.is_json)? {
            let message = message?;
            has_fixed |= !ros_text::is_scan(&message);
            for reading in reader.read(&message)? {
                doubts.add(&reading, (&ways, &found.taken));
            }
        }
        check_beyond(&reader.notes, &found.taken)?;
        let notes = doubts.check(&ways, &found.taken)?;
        found.notes.extend(reader.notes.lines());
        found.notes.extend(notes);
        if reader.others > 0 {
            found.notes.push(format!(
                "left out: {} messages that are no LaserScan or Range",
                reader.others
            ));
        }
        found.notes.push(
            "frames are not in it: the scanner is taken to stand upright and look ahead".to_owned(),
        );
        if has_fixed && found.mapping.azimuth_deg.is_none() {
            found.notes.push(
                "Range messages have no direction: taken as ahead; --azimuth-deg DEG gives another"
                    .to_owned(),
            );
        }
        (found.readings, found.echoes) = (doubts.ranges.readings, doubts.ranges.echoes);
        Ok(())
    }

    pub(crate) fn examine_lines(
        &self,
        read: ReadLine,
        found: &mut Imported,
    ) -> Result<(), ImportError> {
        found.guessed = false;
        let mut devices = Devices::default();
        for message in messages(read, found.decoded((self.open)()?)) {
            devices.add(&message?.1);
        }
        let (chosen, notes) = devices.choose(found.mapping.device.as_deref())?;
        found.notes.extend(notes);
        found.chosen = chosen;
        let mut rounds = Rounds::new(&found.mapping, &found.chosen, found.taken.started)?;
        let mut ranges = Ranges::new(Across::Rangers);
        let ways =
            Ways { mapping: &found.mapping, names: &[], has_columns: false, zero_is_no_echo: true };
        let mut has_poses = false;
        for message in messages(read, found.decoded((self.open)()?)) {
            let (place, message) = message?;
            let Some(round) = rounds.take(place, message)? else { continue };
            has_poses |= round.pose.is_some();
            for (ranger, (raw, range_m)) in round.raw.iter().zip(&round.ranges_m).enumerate() {
                ranges.add(place, ranger as f64, *raw, *range_m, (&ways, &found.taken));
            }
        }
        let Some(count) = rounds.rangers else {
            return Err(ImportError::mapping(
                "there is no sonar message in it",
                "give a log with sonars",
            ));
        };
        let (array, note) = match (&rounds.geometry, &found.taken.array) {
            (Some(geometry), given) => {
                let note = given.as_ref().map(|given| {
                    format!(
                        "the log states the places of its rangers: the array {} is not used",
                        given.name
                    )
                });
                (rounds::array(geometry, &found.taken.sensor), note)
            }
            (None, Some(array)) => (array.clone(), None),
            (None, None) => {
                return Err(ImportError::mapping(
                    format!("the log does not say where its {count} rangers are"),
                    "say it: --array NAME or FILE",
                ));
            }
        };
        if array.rangers.len() != count {
            return Err(ImportError::mapping(
                format!(
                    "the log has {count} rangers, and the array {} has {}",
                    array.name,
                    array.rangers.len()
                ),
                "give the array that the log is of",
            ));
        }
        let notes = ranges.check(&ways, &found.taken)?;
        let times = rounds.times.notes();
        (found.readings, found.echoes) = (ranges.readings, ranges.echoes);
        found.notes.extend(note.into_iter().chain(notes).chain(times));
        found.has_poses = has_poses;
        found.taken.array = Some(array);
        Ok(())
    }
}

/// Refuses ranges that are all beyond the greatest one that is stated beside them.
pub(crate) fn check_beyond(
    notes: &crate::limits::LimitNotes,
    taken: &crate::Taken,
) -> Result<(), ImportError> {
    if taken.as_said || !notes.are_all_beyond() {
        return Ok(());
    }
    Err(ImportError::Doubtful {
        what: format!(
            "all {} ranges are beyond max_range = {}, the greatest that is stated beside them",
            notes.readings,
            notes.most()
        ),
        help: "are ranges and limits in different units? Correct the driver; --no-unit-check takes all as no echo".to_owned(),
    })
}

/// A file that is one line of many values has lost its line ends.
fn check_one_row(found: &Imported, readings: u64) -> Result<(), ImportError> {
    let Some(header) = found.header.as_ref().filter(|header| !header.has_names) else {
        return Ok(());
    };
    let (values, columns) = (header.cells.len(), found.mapping.columns.len());
    if readings != 1 || values < 2 * columns.max(2) || found.taken.as_said {
        return Ok(());
    }
    Err(ImportError::Doubtful {
        what: format!("the file is one row of {values} values, of which {columns} are read"),
        help: "have its line ends been lost? Give a file with a reading a line; --no-unit-check takes the row as it is".to_owned(),
    })
}

/// Asks for the unit of rows that have as many values as an array has rangers.
fn ask_unit_of_array(found: &Imported, rangers: usize) -> ImportError {
    let name = found.taken.array.as_ref().map_or("", |array| &array.name);
    let column = Column::Several((1..=rangers).collect());
    let options = Field::of_quantity(Quantity::Range)
        .take(3)
        .map(|field| columns_option([(field, column.clone())], &[]));
    let options: Vec<String> = options.collect();
    ImportError::mapping(
        format!(
            "each row has {rangers} values, as many as the array {name} has rangers, and no names"
        ),
        format!("choose their unit: {}", options.join(" | ")),
    )
}

fn unnamed(columns: Option<usize>, is_json: bool) -> ImportError {
    let count = columns.map_or(String::new(), |count| format!(" of {count} values"));
    let what = if is_json {
        format!("its entries are lists{count} without names")
    } else {
        format!("the first line{count} has no names of columns")
    };
    let help = "say what the columns are, and their units, by their numbers: --columns azimuth_deg=1,range_cm=2 for degrees and \
                centimetres, --columns azimuth_rad=1,range_m=2 for radians and metres; one column a ranger of an array: \
                --array NAME --columns range_m=1-8";
    ImportError::mapping(what, help)
}

impl Imported {
    /// Checks whether each row is a round of an array.
    pub(crate) fn is_of_array(&self) -> bool {
        self.mapping.is_of_array()
            || (self.format == crate::Format::Json && self.taken.array.is_some())
    }

    fn decimal(&self) -> Decimal {
        let by_header = self.header.as_ref().map(|header| header.decimal);
        self.mapping.decimal.or(by_header).unwrap_or(Decimal::Point)
    }

    fn note_ends(&mut self, survey: &Survey, raggedness: Raggedness) {
        if let Some(place) = raggedness.cut {
            self.notes.push(format!("{place} was cut: it lacks a column and is left out"));
        } else if self.header.as_ref().is_some_and(|header| header.ends == Ends::Lines)
            && !survey.has_last_end()
        {
            self.notes.push(
                "the last line has no end: it may have been cut within its last value".to_owned(),
            );
        }
        if raggedness.short > 0 {
            self.notes.push(format!(
                "{} rows have fewer values than the table has columns; what is read is there",
                raggedness.short
            ));
        }
    }

    fn rows<'a>(&'a self, source: impl Read + 'a) -> Result<Rows<'a>, ImportError> {
        let source = self.decoded(source);
        Ok(match &self.header {
            Some(header) => Box::new(table::Rows::of(source, header, &self.mapping)?),
            None => json::rows(source, &self.mapping, self.is_of_array())?,
        })
    }

    pub(crate) fn scans_of_rows<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = Scan> + 'a>, ImportError> {
        let mut reader = Reader::new(&self.mapping, &self.taken, self.decimal())?;
        let readings = self.rows(source)?.map(move |row| reader.read(&row?));
        Ok(self.cut(readings))
    }

    pub(crate) fn scans_of_messages<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = Scan> + 'a>, ImportError> {
        let mut reader = ros_text::Reader::new(&self.mapping);
        let messages = ros_text::messages(self.decoded(source), self.is_json)?;
        let air_m_s = self.taken.air.sound_speed_m_s();
        let assumed_m_s = self.mapping.sound_speed_m_s.unwrap_or(air_m_s);
        let readings = messages.flat_map(move |message: Result<Value, ImportError>| {
            let read = message.and_then(|message| reader.read(&message));
            let each = match read {
                Ok(readings) => readings.into_iter().map(Ok).collect::<Vec<_>>(),
                Err(error) => vec![Err(error)],
            };
            each.into_iter().map(move |reading: Result<Reading, ImportError>| {
                reading.map(|reading| {
                    let tof_us = reading.range_m.map(|range_m| 2e6 * range_m / assumed_m_s);
                    let range_m = tof_us.map(|tof_us| tof_us * 1e-6 * air_m_s / 2.0);
                    Reading { tof_us, range_m, ..reading }
                })
            })
        });
        Ok(self.cut(readings))
    }

    /// Readings cut into scans, as records.
    fn cut<'a>(
        &'a self,
        mut readings: impl Iterator<Item = Result<Reading, ImportError>> + 'a,
    ) -> Box<dyn Iterator<Item = Scan> + 'a> {
        let (mut cutter, mut number) = (Some(Cutter::default()), 0);
        Box::new(std::iter::from_fn(move || {
            let scan = loop {
                match readings.next() {
                    Some(Ok(reading)) => {
                        if let Some(scan) = cutter.as_mut()?.push(reading) {
                            break scan;
                        }
                    }
                    Some(Err(error)) => return Some(Err(error)),
                    None => break cutter.take()?.finish()?,
                }
            };
            number += 1;
            Some(Ok(scans::records(&self.taken, number, &scan)))
        }))
    }

    pub(crate) fn rounds_of_rows<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = Scan> + 'a>, ImportError> {
        let mut reader = Reader::new(&self.mapping, &self.taken, self.decimal())?;
        let rounds = self.rows(source)?.map(move |row| reader.round(&row?));
        Ok(Box::new(
            (1..).zip(rounds).map(|(number, round)| Ok(scans::round(&self.taken, number, &round?))),
        ))
    }

    pub(crate) fn rounds_of_lines<'a>(
        &'a self,
        read: ReadLine,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = Scan> + 'a>, ImportError> {
        let mut rounds = Rounds::new(&self.mapping, &self.chosen, self.taken.started)?;
        let found = messages(read, self.decoded(source)).filter_map(move |message| {
            let round = message.and_then(|(place, message)| rounds.take(place, message));
            round.transpose()
        });
        Ok(Box::new(
            (1..).zip(found).map(|(number, round)| Ok(scans::round(&self.taken, number, &round?))),
        ))
    }
}

/// The messages of a robot's log that are of ranges or poses, and their places.
fn messages(
    read: ReadLine,
    source: impl Read,
) -> impl Iterator<Item = Result<(Location, Message), ImportError>> {
    Lines::of(source, Ends::Lines).filter_map(move |line| {
        let message = line.and_then(|line| {
            let message = read(line.place(), &line.text)?;
            Ok(message.map(|message| (line.place(), message)))
        });
        message.transpose()
    })
}

//! A file from its first byte to its records.

use std::io::{self, Read};

use jiff::Timestamp;
use serde_json::Value;
use sha2::{Digest as _, Sha256};
use sonard_model::{acoustics::Air, array::RangerArray, geometry::Pose};
use sonard_records::Record;

use crate::{
    Format, ImportError, Location, Mapping, Quantity, Reading, Row, carmen,
    doubt::Doubts,
    json, player,
    reading::Reader,
    recording::{Bag, MAGIC},
    rounds::{self, Message, Rounds},
    scans::{self, Cutter},
    table::{self, Header, Lines},
};

/// So much of a file is looked at to find out what it is, bytes.
const HEAD_BYTES: u64 = 64 * 1024;

/// A file that can be opened more than once.
pub struct Source<'a> {
    /// Opens it at its beginning.
    pub open: &'a dyn Fn() -> io::Result<Box<dyn Read>>,
}

/// What is taken for true about the readings beside what their file says.
#[derive(Debug, Clone, PartialEq)]
pub struct Taken {
    /// SHA-256 of the file, hexadecimal; made by [`Source::examine`].
    pub sha256: String,
    /// Where the robot stands, as far as the file does not say.
    pub pose: Pose,
    /// The rangers of a log that has many and does not say where they are.
    pub array: Option<RangerArray>,
    /// The sensor's name, and how far it hears, metres.
    pub sensor: String,
    /// The same.
    pub longest_m: f64,
    /// The air, as far as the file does not say.
    pub air: Air,
    /// When scans were taken whose file does not say it.
    pub started: Timestamp,
    /// Take the numbers as they are said to be, whatever speaks against it.
    pub as_said: bool,
}

/// A file that was looked through, and what it holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// How it is written.
    pub format: Format,
    /// What its columns mean, guessed ones included.
    pub mapping: Mapping,
    /// Whether they were guessed.
    pub guessed: bool,
    /// What is taken for true, with the file's hash, and its array if it has one.
    pub taken: Taken,
    /// Its readings.
    pub readings: u64,
    /// Those with a range.
    pub echoes: u64,
    /// Whether it says where the robot stood.
    pub has_poses: bool,
    header: Option<Header>,
    /// The frames and topics of a recording.
    bag: Option<Bag>,
}

impl Source<'_> {
    /// Reads the whole file once: what it is, whether each line can be read, and whether its numbers are what the
    /// mapping says.
    ///
    /// # Errors
    /// The first place that is wrong, or what speaks against the mapping.
    pub fn examine(&self, mapping: Mapping, taken: Taken) -> Result<Imported, ImportError> {
        let mut head = Vec::new();
        (self.open)()?.take(HEAD_BYTES).read_to_end(&mut head)?;
        let is_recording = head.starts_with(MAGIC);
        let head = if is_recording { "" } else { text(&head)? };
        let by_looks = || if is_recording { Format::Mcap } else { look(head) };
        let format = mapping.format.unwrap_or_else(by_looks);
        let mut found = Imported {
            format,
            guessed: mapping.columns.is_empty(),
            mapping: Mapping { format: Some(format), ..mapping },
            taken: Taken { sha256: digest((self.open)()?)?, ..taken },
            readings: 0,
            echoes: 0,
            has_poses: false,
            header: None,
            bag: None,
        };
        match format {
            Format::Csv | Format::Json => self.examine_rows(head, &mut found)?,
            Format::Carmen | Format::Player => self.examine_messages(&mut found)?,
            Format::Mcap => self.examine_recording(&mut found)?,
        }
        Ok(found)
    }

    fn examine_recording(&self, found: &mut Imported) -> Result<(), ImportError> {
        if found.taken.array.is_some() || !found.mapping.columns.is_empty() {
            return Err(ImportError::mapping(
                "a recording says itself where its rangers are and what its fields mean",
                "leave the array and the columns out",
            ));
        }
        let bag = Bag::look(self.open, &found.mapping)?;
        found.guessed = false;
        found.has_poses = bag.has_poses;
        found.taken.array = bag.array(&found.taken.sensor);
        if let Some(array) = &found.taken.array {
            array.check().map_err(|error| {
                ImportError::mapping(format!("its rangers: {error}"), "choose some: --topic TOPIC")
            })?;
        }
        for scan in bag.scans((self.open)()?, &found.mapping, &found.taken) {
            for record in scan? {
                if let Record::Ping(ping) = record {
                    found.readings += 1;
                    found.echoes += u64::from(ping.range_m.is_some());
                }
            }
        }
        found.bag = Some(bag);
        Ok(())
    }

    fn examine_rows(&self, head: &str, found: &mut Imported) -> Result<(), ImportError> {
        if found.format == Format::Csv {
            found.header = Some(Header::of(head)?);
        }
        if found.guessed {
            let names = match &found.header {
                Some(header) if header.has_names => header.cells.clone(),
                Some(_) => Vec::new(),
                None => self.json_names(head)?,
            };
            found.mapping.guess(&names)?;
            found.mapping.check().map_err(|error| unguessed(&error, &names))?;
        }
        found.mapping.check()?;
        let mut doubts = Doubts::new();
        let longest_m = found.taken.longest_m;
        for reading in found.readings((self.open)()?)? {
            doubts.add(&reading?, found.mapping.zero_deg, longest_m);
        }
        (found.readings, found.echoes) = (doubts.readings, doubts.echoes);
        found.has_poses = found.mapping.field(Quantity::X).is_some();
        if found.taken.as_said { Ok(()) } else { doubts.check(&found.mapping, longest_m) }
    }

    /// Member names of the first object; of a list too long for a look, the whole file is read.
    fn json_names(&self, head: &str) -> Result<Vec<String>, ImportError> {
        let first = serde_json::Deserializer::from_str(head).into_iter::<Value>().next();
        if let Some(Ok(value)) = first {
            return Ok(json::names(&value));
        }
        let value: Value =
            serde_json::from_reader(io::BufReader::new((self.open)()?)).map_err(|error| {
                ImportError::at(
                    Location::Line(error.line() as u64),
                    format!("no JSON: {error}"),
                    "correct the file",
                )
            })?;
        Ok(json::names(&value))
    }

    fn examine_messages(&self, found: &mut Imported) -> Result<(), ImportError> {
        let mapping = found.mapping.clone();
        let mut rounds = Rounds::new(&mapping);
        let format = found.format;
        for message in messages(format, (self.open)()?) {
            let (place, message) = message?;
            if let Some(round) = rounds.take(place, message)? {
                found.readings += round.ranges_m.len() as u64;
                found.echoes += round.ranges_m.iter().flatten().count() as u64;
                found.has_poses |= round.pose.is_some();
            }
        }
        let Some(count) = rounds.rangers else {
            return Err(ImportError::mapping(
                "there is no sonar message in it",
                "give a log with sonars",
            ));
        };
        let array = match (&found.taken.array, &rounds.geometry) {
            (Some(array), _) => array.clone(),
            (None, Some(geometry)) => rounds::array(geometry, &found.taken.sensor),
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
        found.taken.array = Some(array);
        Ok(())
    }
}

/// SHA-256 of all bytes of a file, in hexadecimal digits.
///
/// # Errors
/// It can't be read.
pub fn digest(mut source: impl Read) -> io::Result<String> {
    let (mut hash, mut piece) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        match source.read(&mut piece) {
            Ok(0) => return Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()),
            Ok(count) => hash.update(&piece[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

fn unguessed(error: &ImportError, names: &[String]) -> ImportError {
    let help = if names.is_empty() {
        "the first line has no names: --columns azimuth_deg=1,range_cm=2".to_owned()
    } else {
        format!(
            "of `{}` nothing is known: --columns azimuth_deg=NAME,range_cm=NAME",
            names.join("`, `")
        )
    };
    ImportError::mapping(error.to_string(), help)
}

/// The beginning of a file as text; a character that its end cuts is left out.
fn text(head: &[u8]) -> Result<&str, ImportError> {
    let error = match std::str::from_utf8(head) {
        Ok(text) if !text.contains('\0') => return Ok(text),
        Ok(_) => None,
        Err(error) => Some(error),
    };
    if let Some(error) = error.filter(|error| error.error_len().is_none()) {
        return Ok(std::str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default());
    }
    if head.starts_with(b"SQLite format 3\0") {
        return Err(ImportError::mapping(
            "it is an SQLite database, as some recordings of ROS 2 are",
            "give the file by its name: it can't be read from its beginning to its end",
        ));
    }
    Err(ImportError::mapping("it is no text", "is it compressed? Unpack it first: `gunzip FILE`"))
}

/// What a file looks like.
fn look(head: &str) -> Format {
    let mut lines = head.lines().map(str::trim_start);
    if lines.clone().find(|line| !line.is_empty()).is_some_and(|line| line.starts_with(['{', '[']))
    {
        return Format::Json;
    }
    let is_carmen = |line: &str| {
        ["SONAR ", "ODOM ", "TRUEPOS ", "PARAM ", "# CARMEN"]
            .iter()
            .any(|word| line.starts_with(word))
    };
    let is_player = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().take(4).collect();
        line.starts_with("## Player")
            || matches!(words[..], [time, _, _, "sonar" | "position2d" | "position"] if time.parse::<f64>().is_ok())
    };
    lines
        .find_map(|line| match line {
            _ if is_carmen(line) => Some(Format::Carmen),
            _ if is_player(line) => Some(Format::Player),
            _ => None,
        })
        .unwrap_or(Format::Csv)
}

/// Records of a scan, or what is wrong.
type Scan = Result<Vec<Record>, ImportError>;

impl Imported {
    fn readings<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<impl Iterator<Item = Result<Reading, ImportError>> + 'a, ImportError> {
        type Rows<'a> = Box<dyn Iterator<Item = Result<Row, ImportError>> + 'a>;
        let rows: Rows<'a> = match &self.header {
            Some(header) => Box::new(table::rows(source, header, &self.mapping)?),
            None => json::rows(source, &self.mapping)?,
        };
        let reader = Reader::new(&self.mapping, &self.taken);
        Ok(rows.map(move |row| reader.read(&row?)))
    }

    /// The records of each scan, one after the other; `source` is the file again.
    ///
    /// # Errors
    /// It can't be read, or is another file than before.
    pub fn scans<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = Scan> + 'a>, ImportError> {
        Ok(match self.format {
            Format::Csv | Format::Json => {
                let mut readings = self.readings(source)?;
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
            Format::Carmen | Format::Player => Box::new(self.rounds(source)),
            Format::Mcap => match &self.bag {
                Some(bag) => Box::new(bag.scans(source, &self.mapping, &self.taken)),
                None => Box::new(std::iter::empty()),
            },
        })
    }

    fn rounds<'a>(&'a self, source: impl Read + 'a) -> impl Iterator<Item = Scan> + 'a {
        let mut rounds = Rounds::new(&self.mapping);
        let found = messages(self.format, source).filter_map(move |message| {
            let round = message.and_then(|(place, message)| rounds.take(place, message));
            round.transpose()
        });
        (1..).zip(found).map(|(number, round)| Ok(scans::round(&self.taken, number, &round?)))
    }
}

/// The messages of a robot's log that are of ranges or poses, and where they stand.
fn messages(
    format: Format,
    source: impl Read,
) -> impl Iterator<Item = Result<(Location, Message), ImportError>> {
    Lines::of(source).filter_map(move |line| {
        let read = |(number, line): (u64, String)| {
            let place = Location::Line(number);
            let message = match format {
                Format::Carmen => carmen::message(place, &line),
                _ => player::message(place, &line),
            };
            message.map(|message| message.map(|message| (place, message)))
        };
        line.and_then(read).transpose()
    })
}

//! A file from its first byte to its records.

use std::io::{self, Read};

use jiff::Timestamp;
use sha2::{Digest as _, Sha256};
use sonard_model::{acoustics::Air, array::RangerArray, geometry::Pose};
use sonard_records::Record;

use crate::{
    Format, ImportError, Mapping,
    doubt::{Ranges, Ways},
    encoding::{self, Encoding, UTF_8},
    format::{self, Kind},
    layout::Header,
    recording::Bag,
    rounds::Chosen,
    silence::Across,
    text::{self, Survey, hexadecimal},
};

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
    /// The rangers of a file that has many and does not say where they are.
    pub array: Option<RangerArray>,
    /// The sensor's name.
    pub sensor: String,
    /// The longest range of the sensor, metres.
    pub longest_m: f64,
    /// The least range of the sensor, by its shortest blanking, metres.
    pub least_m: f64,
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
    /// Its format.
    pub format: Format,
    /// The meaning of its columns, guessed ones included.
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
    /// Notes on assumptions and on what was left out, a line each.
    pub notes: Vec<String>,
    pub(crate) encoding: &'static Encoding,
    pub(crate) header: Option<Header>,
    /// The first bytes of a text, which show how it is written.
    pub(crate) is_json: bool,
    /// The devices of a robot's log that are read.
    pub(crate) chosen: Chosen,
    /// The frames and topics of a recording.
    pub(crate) bag: Option<Bag>,
}

impl Source<'_> {
    /// Reads the whole file: what it is, whether each line can be read, and whether its numbers are what the mapping
    /// says.
    ///
    /// # Errors
    /// The first place that is wrong, or what speaks against the mapping, with the option that resolves it.
    pub fn examine(&self, mapping: Mapping, taken: Taken) -> Result<Imported, ImportError> {
        let survey = Survey::of((self.open)()?)?;
        let (encoding, head) = self.text(&survey, &mapping)?;
        let format = mapping.format.unwrap_or_else(|| Format::detect(&survey.head, &head));
        let entry = format.entry();
        if !mapping.columns.is_empty() && !entry.has_columns {
            return Err(ImportError::mapping(
                format!("a file of the format {} defines its own fields", entry.name),
                "leave --columns out",
            ));
        }
        let mut found = Imported {
            format,
            guessed: mapping.columns.is_empty(),
            mapping: Mapping { format: Some(format), ..mapping },
            taken: Taken { sha256: survey.sha256.clone(), ..taken },
            readings: 0,
            echoes: 0,
            has_poses: false,
            notes: Vec::new(),
            encoding,
            header: None,
            is_json: head.trim_start().starts_with(['{', '[']),
            chosen: Chosen::default(),
            bag: None,
        };
        if encoding != UTF_8 && !matches!(entry.kind, Kind::Recording) {
            found.notes.push(format!("the text is {}", encoding.name()));
        }
        match entry.kind {
            Kind::Rows => self.examine_rows(&survey, &head, &mut found)?,
            Kind::RosText => self.examine_ros_text(&mut found)?,
            Kind::Lines(read) => self.examine_lines(read, &mut found)?,
            Kind::Recording => self.examine_recording(&mut found)?,
        }
        Ok(found)
    }

    /// Encoding and beginning of a text; of a recording an empty one.
    fn text(
        &self,
        survey: &Survey,
        mapping: &Mapping,
    ) -> Result<(&'static Encoding, String), ImportError> {
        let is_recording = Format::detect(&survey.head, "") == Format::Mcap;
        if is_recording || mapping.format == Some(Format::Mcap) {
            return Ok((UTF_8, String::new()));
        }
        if let Some(label) = &mapping.encoding {
            let encoding = Encoding::for_label(label.as_bytes()).ok_or_else(|| {
                ImportError::mapping(
                    format!("there is no encoding `{label}`"),
                    "give utf-8, utf-16le, utf-16be or latin1",
                )
            })?;
            check_supported(encoding)?;
            return Ok((encoding, text::head(survey, encoding)));
        }
        let Some(encoding) = survey.encoding() else {
            return Err(format::foreign(&survey.head, "").unwrap_or_else(|| {
                ImportError::mapping(
                    "it is no text: it has bytes that no text has",
                    "give a text, or a recording; a text of an encoding that was not found: --encoding NAME",
                )
            }));
        };
        check_supported(encoding)?;
        let head = text::head(survey, encoding);
        match format::foreign(&survey.head, &head).filter(|_| mapping.format.is_none()) {
            Some(error) => Err(error),
            None => Ok((encoding, head)),
        }
    }

    fn examine_recording(&self, found: &mut Imported) -> Result<(), ImportError> {
        if found.taken.array.is_some() {
            return Err(ImportError::mapping(
                "a recording states the places of its rangers",
                "leave --array out",
            ));
        }
        let bag = Bag::look(self.open, &found.mapping, &found.taken)?;
        found.guessed = false;
        found.has_poses = bag.has_poses;
        found.taken.array = bag.array(&found.taken.sensor);
        if let Some(array) = &found.taken.array {
            array.check().map_err(|error| {
                ImportError::mapping(format!("its rangers: {error}"), "choose some: --topic TOPIC")
            })?;
        }
        let across = if found.taken.array.is_some() { Across::Rangers } else { Across::Angles };
        let ways =
            Ways { mapping: &found.mapping, names: &[], has_columns: false, zero_is_no_echo: true };
        let mut ranges = Ranges::new(across);
        let notes = bag.examine(self.open, (&ways, &found.taken), &mut ranges)?;
        found.notes.extend(notes);
        found.notes.extend(ranges.check(&ways, &found.taken)?);
        (found.readings, found.echoes) = (ranges.readings, ranges.echoes);
        found.bag = Some(bag);
        Ok(())
    }
}

/// SHA-256 of all bytes of a file, in hexadecimal digits.
///
/// # Errors
/// It can't be read.
pub fn digest(mut source: impl Read) -> io::Result<String> {
    let mut hash = Sha256::new();
    let mut piece = vec![0; 1 << 16];
    loop {
        match source.read(&mut piece) {
            Ok(0) => return Ok(hexadecimal(hash)),
            Ok(count) => hash.update(&piece[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// Records of a scan, or what is wrong.
pub(crate) type Scan = Result<Vec<Record>, ImportError>;

impl Imported {
    /// The text of the file as UTF-8.
    pub(crate) fn decoded<'a>(&self, source: impl Read + 'a) -> Box<dyn Read + 'a> {
        Box::new(encoding::decoded(source, self.encoding))
    }

    /// The records of each scan, one after the other; `source` is the file again.
    ///
    /// # Errors
    /// It can't be read, or is another file than before.
    pub fn scans<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = Scan> + 'a>, ImportError> {
        match self.format.entry().kind {
            Kind::Rows if self.is_of_array() => self.rounds_of_rows(source),
            Kind::Rows => self.scans_of_rows(source),
            Kind::RosText => self.scans_of_messages(source),
            Kind::Lines(read) => self.rounds_of_lines(read, source),
            Kind::Recording => match &self.bag {
                Some(bag) => Ok(Box::new(bag.scans(source, &self.mapping, &self.taken)?)),
                None => Ok(Box::new(std::iter::empty())),
            },
        }
    }
}

/// Rejects a text that this build does not decode.
fn check_supported(encoding: &'static Encoding) -> Result<(), ImportError> {
    if encoding::is_supported(encoding) {
        return Ok(());
    }
    Err(ImportError::mapping(
        format!("the text is {}, and this build reads UTF-8 alone", encoding.name()),
        "convert it with `sonard import`, or save it as UTF-8",
    ))
}

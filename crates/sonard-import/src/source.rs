//! Examination of a file and conversion of its content to records.

use std::io::{self, Read};

use jiff::Timestamp;
use sha2::{Digest as _, Sha256};
use sonard_model::{acoustics::Air, array::RangerArray, geometry::Pose};
use sonard_records::Record;

use crate::{
    Format, ImportError, Mapping,
    array_rounds::SelectedDevices,
    encoding::{self, Encoding, UTF_8},
    format::{self, FormatKind},
    layout::TableLayout,
    no_echo_constant::DirectionKind,
    recording::Bag,
    text::{self, Survey, hexadecimal},
    unit_check::{RangeStats, UnitContext},
};

/// File that can be opened repeatedly.
pub struct ImportSource<'a> {
    /// Opens the file at its beginning.
    pub open: &'a dyn Fn() -> io::Result<Box<dyn Read>>,
}

/// Assumptions for what a file does not contain.
#[derive(Debug, Clone, PartialEq)]
pub struct Assumptions {
    /// SHA-256 of the file, hexadecimal; set by [`ImportSource::examine`].
    pub sha256: String,
    /// Pose of the robot, for the parts missing in the file.
    pub pose: Pose,
    /// Array, for files with several ranges per row or message and without ranger positions.
    pub array: Option<RangerArray>,
    /// Name of the sensor.
    pub sensor: String,
    /// Maximum range of the sensor, metres.
    pub max_range_m: f64,
    /// Minimum range of the sensor at its shortest blanking, metres.
    pub min_range_m: f64,
    /// Air, for files without temperature.
    pub air: Air,
    /// Start time, for files without times.
    pub started: Timestamp,
    /// True to skip the plausibility checks of units and no-echo values.
    pub skip_checks: bool,
}

/// Examined file with its complete mapping.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// Detected or requested format.
    pub format: Format,
    /// Complete mapping, including inferred columns.
    pub mapping: Mapping,
    /// True if the columns were inferred from their names.
    pub is_inferred: bool,
    /// Assumptions, completed with the file's hash and its array.
    pub assumptions: Assumptions,
    /// Number of readings in the file.
    pub readings: u64,
    /// Number of readings with a range.
    pub echoes: u64,
    /// True if the file contains poses.
    pub has_poses: bool,
    /// Notes on assumptions and skipped content, one line each.
    pub notes: Vec<String>,
    pub(crate) encoding: &'static Encoding,
    pub(crate) header: Option<TableLayout>,
    /// True for JSON, by the first character.
    pub(crate) is_json: bool,
    /// Devices selected from a robot's log.
    pub(crate) devices: SelectedDevices,
    /// Frames and topics of a recording.
    pub(crate) bag: Option<Bag>,
}

impl ImportSource<'_> {
    /// Reads the whole file: detects its format, parses every line, and checks that its values are
    /// plausible for the mapping.
    ///
    /// # Errors
    /// Returns the first invalid value, or the evidence against the mapping, with the option that
    /// resolves it.
    pub fn examine(
        &self,
        mapping: Mapping,
        assumptions: Assumptions,
    ) -> Result<Imported, ImportError> {
        let survey = Survey::read((self.open)()?)?;
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
            is_inferred: mapping.columns.is_empty(),
            mapping: Mapping { format: Some(format), ..mapping },
            assumptions: Assumptions { sha256: survey.sha256.clone(), ..assumptions },
            readings: 0,
            echoes: 0,
            has_poses: false,
            notes: Vec::new(),
            encoding,
            header: None,
            is_json: head.trim_start().starts_with(['{', '[']),
            devices: SelectedDevices::default(),
            bag: None,
        };
        if encoding != UTF_8 && !matches!(entry.kind, FormatKind::Recording) {
            found.notes.push(format!("the text is {}", encoding.name()));
        }
        match entry.kind {
            FormatKind::Rows => self.examine_rows(&survey, &head, &mut found)?,
            FormatKind::RosText => self.examine_ros_text(&mut found)?,
            FormatKind::Lines(read) => self.examine_lines(read, &survey, &mut found)?,
            FormatKind::Recording => self.examine_recording(&mut found)?,
        }
        Ok(found)
    }

    /// Returns the encoding and the beginning of a text; an empty text for a recording.
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
                    format!("unknown encoding `{label}`"),
                    "give utf-8, utf-16le, utf-16be or latin1",
                )
            })?;
            check_supported(encoding)?;
            return Ok((encoding, text::head(survey, encoding)));
        }
        // The mark of UTF-32 begins with that of UTF-16.
        let is_binary = format::unsupported(&survey.head, "").filter(|_| mapping.format.is_none());
        if let Some(error) = is_binary {
            return Err(error);
        }
        let Some(encoding) = survey.encoding() else {
            return Err(format::unsupported(&survey.head, "").unwrap_or_else(|| {
                ImportError::mapping(
                    "not a text file: it contains control characters",
                    "give a text file or a recording; if the encoding was not detected: --encoding NAME",
                )
            }));
        };
        check_supported(encoding)?;
        let head = text::head(survey, encoding);
        match format::unsupported(&survey.head, &head).filter(|_| mapping.format.is_none()) {
            Some(error) => Err(error),
            None => Ok((encoding, head)),
        }
    }

    fn examine_recording(&self, found: &mut Imported) -> Result<(), ImportError> {
        if found.assumptions.array.is_some() {
            return Err(ImportError::mapping(
                "a recording contains the positions of its rangers",
                "leave --array out",
            ));
        }
        let bag = Bag::survey(self.open, &found.mapping, &found.assumptions)?;
        found.is_inferred = false;
        found.has_poses = bag.has_poses;
        found.assumptions.array = bag.array(&found.assumptions.sensor);
        if let Some(array) = &found.assumptions.array {
            array.check().map_err(|error| {
                ImportError::mapping(
                    format!("rangers of the recording: {error}"),
                    "select some: --topic TOPIC",
                )
            })?;
        }
        let direction_kind = if found.assumptions.array.is_some() {
            DirectionKind::Rangers
        } else {
            DirectionKind::Angles
        };
        let units = UnitContext {
            mapping: &found.mapping,
            names: &[],
            has_columns: false,
            zero_is_no_echo: true,
        };
        let mut ranges = RangeStats::new(direction_kind);
        let notes = bag.examine(self.open, (&units, &found.assumptions), &mut ranges)?;
        found.notes.extend(notes);
        found.notes.extend(ranges.check(&units, &found.assumptions)?);
        (found.readings, found.echoes) = (ranges.readings, ranges.echoes);
        found.bag = Some(bag);
        Ok(())
    }
}

/// Computes the SHA-256 of a file, in hexadecimal digits.
///
/// # Errors
/// Returns an error if reading fails.
pub fn sha256_hex(mut source: impl Read) -> io::Result<String> {
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

/// Records of one scan.
pub(crate) type ScanRecords = Result<Vec<Record>, ImportError>;

impl Imported {
    /// Decodes the text of the file to UTF-8.
    pub(crate) fn decoded<'a>(&self, source: impl Read + 'a) -> Box<dyn Read + 'a> {
        Box::new(encoding::decoded(source, self.encoding))
    }

    /// Returns the records of each scan in turn; `source` is the examined file, opened again.
    ///
    /// # Errors
    /// Returns an error if reading fails, or if the file has changed since it was examined.
    pub fn scans<'a>(
        &'a self,
        source: impl Read + 'a,
    ) -> Result<Box<dyn Iterator<Item = ScanRecords> + 'a>, ImportError> {
        match self.format.entry().kind {
            FormatKind::Rows if self.is_of_array() => self.rounds_of_rows(source),
            FormatKind::Rows => self.scans_of_rows(source),
            FormatKind::RosText => self.scans_of_messages(source),
            FormatKind::Lines(read) => self.rounds_of_lines(read, source),
            FormatKind::Recording => match &self.bag {
                Some(bag) => Ok(Box::new(bag.scans(source, &self.mapping, &self.assumptions)?)),
                None => Ok(Box::new(std::iter::empty())),
            },
        }
    }
}

/// Rejects an encoding that this build does not decode.
fn check_supported(encoding: &'static Encoding) -> Result<(), ImportError> {
    if encoding::is_supported(encoding) {
        return Ok(());
    }
    Err(ImportError::mapping(
        format!("the text is {}, but this build reads only UTF-8", encoding.name()),
        "convert it with `sonard import`, or save it as UTF-8",
    ))
}

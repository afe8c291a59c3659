//! Tables of text: comma separated values and their kin.

use std::io::{BufRead, BufReader, Read};

use csv::{ReaderBuilder, StringRecord, Trim};

use crate::{Column, ImportError, Location, Mapping, Row};

/// A line longer than this is no row of readings, bytes.
const LONGEST_LINE: u64 = 1 << 20;

/// What stands between the values of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Between {
    Byte(u8),
    Blanks,
}

/// The first line of a table that is not a comment: column names, if it has any, and what is between them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Header {
    between: Between,
    /// Its values.
    pub(crate) cells: Vec<String>,
    /// Whether these are names and not numbers.
    pub(crate) has_names: bool,
}

impl Header {
    /// Reads it from the beginning of a file.
    ///
    /// # Errors
    /// There is no line but comments.
    pub(crate) fn of(head: &str) -> Result<Self, ImportError> {
        let mut lines = head.lines().filter(|line| !is_comment(line));
        let first = lines.next().ok_or_else(|| {
            ImportError::mapping("the file holds no line of values", "give a table of readings")
        })?;
        let between = [b',', b';', b'\t']
            .into_iter()
            .find(|byte| first.as_bytes().contains(byte))
            .map_or(Between::Blanks, Between::Byte);
        let cells: Vec<String> = match between {
            Between::Blanks => first.split_whitespace().map(str::to_owned).collect(),
            Between::Byte(byte) => {
                let mut record = StringRecord::new();
                reader(byte, first.as_bytes()).read_record(&mut record).map_err(|error| {
                    ImportError::at(Location::Line(1), error.to_string(), "correct the first line")
                })?;
                record.iter().map(str::to_owned).collect()
            }
        };
        // A line with a number in it is a reading, which must not be lost.
        let is_number = |cell: &String| cell.parse::<f64>().is_ok();
        let has_names = !cells.iter().any(is_number) && cells.iter().any(|cell| !cell.is_empty());
        Ok(Self { between, cells, has_names })
    }

    /// The place of a column, from 0.
    fn find(&self, column: &Column) -> Result<usize, ImportError> {
        let count = self.cells.len();
        match column {
            Column::Number(number) if *number <= count => Ok(number - 1),
            Column::Number(number) => Err(ImportError::mapping(
                format!("there is no column {number}: the first line has {count}"),
                "columns count from 1",
            )),
            Column::Name(name) if !self.has_names => Err(ImportError::mapping(
                format!("there is no column `{name}`: the first line has no names"),
                "give the number of the column, from 1",
            )),
            Column::Name(name) => {
                self.cells.iter().position(|cell| cell == name).ok_or_else(|| {
                    ImportError::mapping(
                        format!("there is no column `{name}`"),
                        format!("the columns are {}", self.cells.join(", ")),
                    )
                })
            }
        }
    }
}

fn is_comment(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || line.starts_with('#') || line.starts_with("//")
}

fn reader<R: Read>(delimiter: u8, source: R) -> csv::Reader<R> {
    ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .trim(Trim::All)
        .from_reader(source)
}

/// The rows of a table, with the values of the mapping's columns in its order.
///
/// # Errors
/// The header has not the mapping's columns; later, a line that can't be read.
pub(crate) fn rows<'a>(
    source: impl Read + 'a,
    header: &Header,
    mapping: &Mapping,
) -> Result<impl Iterator<Item = Result<Row, ImportError>> + 'a, ImportError> {
    let places: Vec<_> =
        mapping.columns.values().map(|column| header.find(column)).collect::<Result<_, _>>()?;
    let (between, mut names) = (header.between, header.has_names);
    let lines = Lines::of(source);
    Ok(lines.filter_map(move |line| {
        let (number, line) = match line {
            Ok(line) => line,
            Err(error) => return Some(Err(error)),
        };
        if is_comment(&line) {
            return None;
        }
        if std::mem::take(&mut names) {
            return None;
        }
        let place = Location::Line(number);
        Some(cells(between, &line, place).map(|cells| {
            let cell = |&at: &usize| cells.get(at).filter(|cell| !cell.is_empty()).cloned();
            Row { place, cells: places.iter().map(cell).collect() }
        }))
    }))
}

fn cells(between: Between, line: &str, place: Location) -> Result<Vec<String>, ImportError> {
    match between {
        Between::Blanks => Ok(line.split_whitespace().map(str::to_owned).collect()),
        Between::Byte(byte) => {
            let mut record = StringRecord::new();
            reader(byte, line.as_bytes())
                .read_record(&mut record)
                .map_err(|error| ImportError::at(place, error.to_string(), "correct that line"))?;
            Ok(record.iter().map(str::to_owned).collect())
        }
    }
}

/// Lines with their numbers, none of them longer than [`LONGEST_LINE`].
pub(crate) struct Lines<R> {
    source: BufReader<R>,
    count: u64,
}

impl<R: Read> Lines<R> {
    pub(crate) fn of(source: R) -> Self {
        Self { source: BufReader::new(source), count: 0 }
    }

    fn read(&mut self) -> Result<Option<(u64, String)>, ImportError> {
        let mut line = Vec::new();
        let length = (&mut self.source).take(LONGEST_LINE).read_until(b'\n', &mut line)? as u64;
        if length == 0 {
            return Ok(None);
        }
        self.count += 1;
        let place = Location::Line(self.count);
        if length == LONGEST_LINE {
            let what = format!("longer than {LONGEST_LINE} bytes");
            return Err(ImportError::at(place, what, "give a file with a reading a line"));
        }
        let line = String::from_utf8(line).map_err(|_| {
            ImportError::at(place, "no UTF-8 text", "give a text file: is it compressed?")
        })?;
        let line = line.trim_start_matches('\u{feff}').trim_end_matches(['\n', '\r']).to_owned();
        Ok(Some((self.count, line)))
    }
}

impl<R: Read> Iterator for Lines<R> {
    type Item = Result<(u64, String), ImportError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read().transpose()
    }
}

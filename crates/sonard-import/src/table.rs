//! Tables of text: comma separated values and their kin (RFC 4180 and what programs make of it).

use std::io::Read;

use csv::{ReaderBuilder, StringRecord, Trim};

use crate::{
    Column, ImportError, Location, Mapping, Row,
    layout::{Between, Header},
    lines::{Ends, Line, Lines},
};

/// Rows of a table, and what was found wrong with it on the way.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Raggedness {
    /// Rows that lack columns which the mapping does not use.
    pub(crate) short: u64,
    /// The last row, which has no end and lacks a column.
    pub(crate) cut: Option<Location>,
}

/// The rows of a table, with the values of the mapping's columns in its order.
pub(crate) struct Rows<R> {
    lines: Lines<R>,
    header: Header,
    /// Places of the mapping's columns, from 0, in its order.
    places: Vec<Vec<usize>>,
    is_behind_names: bool,
    to_skip: u64,
    pub(crate) raggedness: Raggedness,
}

impl<R: Read> Rows<R> {
    /// # Errors
    /// The header has not the mapping's columns.
    pub(crate) fn of(source: R, header: &Header, mapping: &Mapping) -> Result<Self, ImportError> {
        let places = mapping.columns.values().map(|column| match column {
            Column::Several(numbers) => {
                numbers.iter().map(|number| header.find(&Column::Number(*number))).collect()
            }
            one => header.find(one).map(|place| vec![place]),
        });
        Ok(Self {
            lines: Lines::of(source, header.ends),
            places: places.collect::<Result<_, _>>()?,
            header: header.clone(),
            is_behind_names: !header.has_names || header.is_comment,
            to_skip: u64::from(header.has_separator_line),
            raggedness: Raggedness::default(),
        })
    }

    fn row(&mut self, line: &Line) -> Result<Option<Row>, ImportError> {
        let place = line.place();
        let text = without_comment(&line.text);
        let cells = split(self.header.between, text)
            .map_err(|what| ImportError::at(place, what, "correct that line"))?;
        let columns = self.header.cells.len();
        let used = cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
        if used > columns {
            let what = format!("{used} values, and the table has {columns} columns");
            let comma = match self.header.between {
                Between::Byte(b',') => {
                    "; decimal commas need another separator, such as semicolons"
                }
                _ => "",
            };
            let help = format!("are line ends missing? Give a file with a reading a line{comma}");
            return Err(ImportError::at(place, what, help));
        }
        let lacks = self.places.iter().flatten().any(|place| *place >= cells.len());
        // A capture of a stream may begin within a record, too.
        let is_first = self.header.ends == Ends::Stops && line.number == 1;
        let is_without = cells.first().is_some_and(String::is_empty);
        if (lacks && (!line.is_ended || is_first)) || (is_without && is_first) {
            self.raggedness.cut = Some(place);
            return Ok(None);
        }
        if lacks {
            let what = format!("{} values, and the table has {columns} columns", cells.len());
            return Err(ImportError::at(
                place,
                what,
                "complete that line, or remove it; an empty value is written as two separators",
            ));
        }
        self.raggedness.short += u64::from(cells.len() < columns);
        let cell = |at: &usize| cells.get(*at).filter(|cell| !cell.is_empty()).cloned();
        let cells = self.places.iter().map(|places| places.iter().map(cell).collect());
        Ok(Some(Row { place, cells: cells.collect() }))
    }
}

impl<R: Read> Iterator for Rows<R> {
    type Item = Result<Row, ImportError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let line = match self.lines.next()? {
                Ok(line) => line,
                Err(error) => return Some(Err(error)),
            };
            if is_comment(&line.text) {
                continue;
            }
            if self.to_skip > 0 {
                self.to_skip -= 1;
                continue;
            }
            if !std::mem::replace(&mut self.is_behind_names, true) {
                continue;
            }
            if let Some(row) = self.row(&line).transpose() {
                return Some(row);
            }
        }
    }
}

/// Signs that begin a comment: of shells and Octave, of MATLAB, of C.
const COMMENTS: [&str; 3] = ["#", "%", "//"];

pub(crate) fn is_comment(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || COMMENTS.iter().any(|sign| line.starts_with(sign))
}

/// The text of a comment line, without its sign.
pub(crate) fn comment(line: &str) -> Option<&str> {
    let line = line.trim();
    let sign = COMMENTS.iter().find(|sign| line.starts_with(**sign))?;
    Some(line.trim_start_matches(*sign).trim())
}

/// A row without the comment behind it.
fn without_comment(line: &str) -> &str {
    let is_start = |at: &usize| {
        let before = line[..*at].chars().next_back();
        before.is_some_and(char::is_whitespace) && !line[..*at].contains('"')
    };
    let begins = line.match_indices(['#', '%']).map(|(at, _)| at);
    line.get(..begins.into_iter().find(is_start).unwrap_or(line.len())).unwrap_or(line)
}

/// The values of a line.
pub(crate) fn split(between: Between, line: &str) -> Result<Vec<String>, String> {
    match between {
        Between::Blanks => Ok(line.split_whitespace().map(str::to_owned).collect()),
        // Most lines have no quotes, and need no parser of them.
        Between::Byte(byte) if !line.contains('"') => {
            Ok(line.split(char::from(byte)).map(|cell| cell.trim().to_owned()).collect())
        }
        Between::Byte(byte) => {
            let mut record = StringRecord::new();
            let mut reader = ReaderBuilder::new()
                .delimiter(byte)
                .has_headers(false)
                .flexible(true)
                .trim(Trim::All)
                .from_reader(line.as_bytes());
            reader.read_record(&mut record).map_err(|error| error.to_string())?;
            Ok(record.iter().map(str::to_owned).collect())
        }
    }
}

//! Text tables: comma separated values (RFC 4180) and the variants that programs write.

use std::io::Read;

use csv::{ReaderBuilder, StringRecord, Trim};

use crate::{
    Column, FileLocation, ImportError, Mapping, Row,
    layout::{Separator, TableLayout},
    lines::{LineEnding, LineReader, TextLine},
};

/// Irregular rows of a table.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RowFaults {
    /// Number of rows that lack columns which the mapping does not use.
    pub(crate) short: u64,
    /// First row of a capture, and unterminated last row, that lack a mapped column.
    pub(crate) cut: [Option<FileLocation>; 2],
}

/// Iterator over the rows of a table, with the cells of the mapped columns in mapping order.
pub(crate) struct TableRows<R> {
    lines: LineReader<R>,
    layout: TableLayout,
    /// Indices of the mapped columns, from 0, in mapping order.
    places: Vec<Vec<usize>>,
    has_passed_names: bool,
    /// Text of the row of names, which files joined from several repeat.
    name_row: Option<String>,
    to_skip: u64,
    is_first: bool,
    pub(crate) faults: RowFaults,
}

impl<R: Read> TableRows<R> {
    /// # Errors
    /// Returns an error if the table lacks a mapped column.
    pub(crate) fn new(
        source: R,
        layout: &TableLayout,
        mapping: &Mapping,
    ) -> Result<Self, ImportError> {
        let places = mapping.columns.values().map(|column| match column {
            Column::Several(numbers) => {
                numbers.iter().map(|number| layout.find(&Column::Number(*number))).collect()
            }
            column => layout.find(column).map(|index| vec![index]),
        });
        Ok(Self {
            lines: LineReader::new(source, layout.ends),
            places: places.collect::<Result<_, _>>()?,
            layout: layout.clone(),
            has_passed_names: !layout.has_name_row,
            name_row: None,
            to_skip: u64::from(layout.has_separator_line),
            is_first: true,
            faults: RowFaults::default(),
        })
    }

    fn row(&mut self, line: &TextLine) -> Result<Option<Row>, ImportError> {
        let place = line.place();
        let text = without_comment(&line.text);
        let is_first = std::mem::take(&mut self.is_first);
        let cells = self
            .layout
            .split(text)
            .map_err(|what| ImportError::at(place, what, "correct that line"))?;
        let columns = self.layout.cells.len();
        let used = cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
        if used > columns {
            let what = format!("{used} values, but the table has {columns} columns");
            let comma = match self.layout.separator {
                Separator::Byte(b',') => {
                    "; decimal commas need another separator, such as semicolons"
                }
                _ => "",
            };
            let help = format!("are line ends missing? Give one reading per line{comma}");
            return Err(ImportError::at(place, what, help));
        }
        let lacks = self.places.iter().flatten().any(|place| *place >= cells.len());
        // A captured stream may also begin within a record.
        let is_first =
            is_first && (self.layout.ends == LineEnding::Stops || self.layout.is_first_cut);
        let is_without = cells.first().is_some_and(String::is_empty);
        if (lacks && (!line.is_ended || is_first)) || (is_without && is_first) {
            self.faults.cut[usize::from(!is_first)] = Some(place);
            return Ok(None);
        }
        if lacks {
            let what = format!("{} values, but the table has {columns} columns", cells.len());
            return Err(ImportError::at(
                place,
                what,
                "complete that line, or remove it; an empty value is written as two separators",
            ));
        }
        self.faults.short += u64::from(cells.len() < columns);
        let cell = |at: &usize| cells.get(*at).filter(|cell| !cell.is_empty()).cloned();
        let cells = self.places.iter().map(|places| places.iter().map(cell).collect());
        Ok(Some(Row { place, cells: cells.collect() }))
    }
}

impl<R: Read> Iterator for TableRows<R> {
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
            if !std::mem::replace(&mut self.has_passed_names, true) {
                self.to_skip = u64::from(self.layout.has_unit_row);
                self.name_row = Some(line.text);
                continue;
            }
            if self.name_row.as_ref() == Some(&line.text) {
                self.to_skip = u64::from(self.layout.has_unit_row);
                continue;
            }
            if let Some(row) = self.row(&line).transpose() {
                return Some(row);
            }
        }
    }
}

/// Comment signs of shells and Octave, MATLAB, and C.
const COMMENTS: [&str; 3] = ["#", "%", "//"];

pub(crate) fn is_comment(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || COMMENTS.iter().any(|sign| line.starts_with(sign))
}

/// Returns the text of a comment line, without its sign.
pub(crate) fn comment(line: &str) -> Option<&str> {
    let line = line.trim();
    let sign = COMMENTS.iter().find(|sign| line.starts_with(**sign))?;
    Some(line.trim_start_matches(*sign).trim())
}

/// Removes a trailing comment from a row.
fn without_comment(line: &str) -> &str {
    let is_start = |at: &usize| {
        let before = line[..*at].chars().next_back();
        before.is_some_and(char::is_whitespace) && !line[..*at].contains('"')
    };
    let signs = COMMENTS.iter().flat_map(|sign| line.match_indices(sign).map(|(at, _)| at));
    let begin = signs.filter(is_start).min().unwrap_or(line.len());
    line.get(..begin).unwrap_or(line)
}

/// Splits a line into its values.
pub(crate) fn split(separator: Separator, line: &str) -> Result<Vec<String>, String> {
    match separator {
        Separator::Blanks => Ok(line.split_whitespace().map(str::to_owned).collect()),
        // Lines without quotes need no CSV parser.
        Separator::Byte(byte) if !line.contains('"') => {
            Ok(line.split(char::from(byte)).map(|cell| cell.trim().to_owned()).collect())
        }
        Separator::Byte(byte) => {
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

//! Layout of a table: separator, decimal sign and column names.

use crate::{
    Column, ImportError, Mapping,
    column_names::{self, NameMeaning},
    lines::LineEnding,
    mapping::Decimal,
    number::{self, DecimalEvidence},
    table::{comment, is_comment, split},
};

/// Separator of the values in a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Separator {
    Byte(u8),
    Blanks,
}

/// Candidate separators, the least ambiguous first: commas and blanks may also occur within values.
const SEPARATORS: [Separator; 5] = [
    Separator::Byte(b'\t'),
    Separator::Byte(b';'),
    Separator::Byte(b'|'),
    Separator::Byte(b','),
    Separator::Blanks,
];

/// Number of rows examined to detect the layout.
const EXAMINED_ROWS: usize = 200;

/// Layout of a table, detected from the beginning of the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TableLayout {
    pub(crate) separator: Separator,
    pub(crate) ends: LineEnding,
    pub(crate) decimal: Decimal,
    /// Column names, or the values of the first row.
    pub(crate) cells: Vec<String>,
    /// True if `cells` are names.
    pub(crate) has_names: bool,
    /// True if the names come from a comment line.
    pub(crate) is_comment: bool,
    /// True if the first line is `sep=;`, as written by Excel.
    pub(crate) has_separator_line: bool,
    /// Notes on the layout, for the user.
    pub(crate) notes: Vec<String>,
}

impl TableLayout {
    /// Detects the layout from the beginning of a file.
    ///
    /// # Errors
    /// Returns an error if there are only comments, or if commas in numbers are ambiguous.
    pub(crate) fn detect(head: &str, mapping: &Mapping) -> Result<Self, ImportError> {
        let mut notes = Vec::new();
        let ends = if is_stream(head) { LineEnding::Stops } else { LineEnding::Lines };
        if ends == LineEnding::Stops {
            notes.push(
                "records end with a full stop instead of a line end: angle,distance.".to_owned(),
            );
        }
        let is_end = |c: char| matches!(c, '\n' | '\r') || (ends == LineEnding::Stops && c == '.');
        let lines: Vec<&str> = head.split(is_end).collect();
        let mut rows =
            lines.iter().copied().enumerate().filter(|(_, line)| !is_comment(line)).peekable();
        let stated = rows.peek().and_then(|(_, line)| separator_line(line));
        if let Some(byte) = stated {
            rows.next();
            notes.push(format!("separator taken from the line `sep={}`", char::from(byte)));
        }
        let rows: Vec<(usize, &str)> = rows.take(EXAMINED_ROWS).collect();
        let Some(&(first_at, first)) = rows.first() else {
            return Err(ImportError::mapping(
                "the file has no line of values",
                "give a table of readings",
            ));
        };
        let texts: Vec<&str> = rows.iter().map(|(_, line)| *line).collect();
        let separator = stated.map_or_else(|| detect_separator(&texts), Separator::Byte);
        let cells = split(separator, first).unwrap_or_default();
        // A first line with a number is a reading, which must not be lost as a header.
        let is_number = |cell: &String| is_number(cell);
        let has_names = !cells.iter().any(is_number) && cells.iter().any(|cell| !cell.is_empty());
        let mut header = Self {
            separator,
            ends,
            decimal: detect_decimal(&texts[usize::from(has_names)..], separator, mapping)?,
            cells,
            has_names,
            is_comment: false,
            has_separator_line: stated.is_some(),
            notes,
        };
        if header.decimal == Decimal::Comma && mapping.decimal.is_none() {
            header.notes.push("numbers have a decimal comma".to_owned());
        }
        if ends == LineEnding::Stops {
            (header.cells, header.has_names) = (vec!["1".to_owned(), "2".to_owned()], false);
        } else if !has_names {
            header.take_names(lines[..first_at].iter().rev().find_map(|line| comment(line)));
        }
        let named =
            header.cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
        header.cells.truncate(named.max(1));
        Ok(header)
    }

    /// Takes column names from the comment above the first row, if it has one name per value.
    fn take_names(&mut self, comment: Option<&str>) {
        let Some(comment) = comment else { return };
        let candidates = [self.separator, Separator::Byte(b','), Separator::Blanks];
        let names = candidates.into_iter().find_map(|separator| {
            let names = split(separator, comment).ok()?;
            let are_names = names.iter().all(|name| !name.is_empty() && !is_number(name));
            let is_known = names.iter().any(|name| match column_names::meaning(name) {
                NameMeaning::Field(field) => field.quantity().is_measurement(),
                NameMeaning::Quantity(quantity) => quantity.is_measurement(),
                _ => false,
            });
            (names.len() == self.cells.len() && names.len() > 1 && are_names && is_known)
                .then_some(names)
        });
        if let Some(names) = names {
            self.notes.push(format!("column names taken from the comment `{comment}`"));
            (self.cells, self.has_names, self.is_comment) = (names, true, true);
        }
    }

    /// Returns the index of a column, from 0.
    pub(crate) fn find(&self, column: &Column) -> Result<usize, ImportError> {
        let count = self.cells.len();
        match column {
            Column::Number(number) if (1..=count).contains(number) => Ok(number - 1),
            Column::Number(number) => Err(ImportError::mapping(
                format!("there is no column {number}: the first line has {count} columns"),
                "columns count from 1",
            )),
            Column::Several(_) => Err(ImportError::mapping(
                "several columns of ranges need an array",
                "give the array: --array NAME or FILE",
            )),
            Column::Name(name) if !self.has_names => Err(ImportError::mapping(
                format!("there is no column `{name}`: the first line has no column names"),
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

fn is_number(cell: &str) -> bool {
    number::parse(cell, Decimal::Point).is_some() || number::parse(cell, Decimal::Comma).is_some()
}

/// Parses Excel's separator line.
fn separator_line(line: &str) -> Option<u8> {
    let line = line.trim().trim_matches('"');
    let separator = line
        .get(..4)
        .filter(|start| start.eq_ignore_ascii_case("sep="))
        .map(|_| &line.as_bytes()[4..])?;
    match separator {
        [] => Some(b'\t'),
        [one] if one.is_ascii() => Some(*one),
        _ => None,
    }
}

/// Chooses the separator that gives the most numbers and splits every row.
fn detect_separator(rows: &[&str]) -> Separator {
    let values = if rows.len() > 1 { &rows[1..] } else { rows };
    let share = |separator: &Separator| {
        let rows = values.iter().map(|row| split(*separator, row).unwrap_or_default());
        let rows: Vec<Vec<String>> = rows.collect();
        let min_values = rows.iter().map(Vec::len).min().unwrap_or(0);
        let is_split =
            min_values > 1 || split(*separator, rows_first(values)).is_ok_and(|row| row.len() > 1);
        let cells = || rows.iter().flatten().filter(|cell| !cell.is_empty());
        let numbers = cells().filter(|cell| is_number(cell)).count();
        let share = numbers as f64 / cells().count().max(1) as f64;
        is_split.then_some(share)
    };
    let mut best: Option<(Separator, f64)> = None;
    for separator in SEPARATORS {
        if let Some(share) = share(&separator)
            && best.is_none_or(|(_, known)| share > known + 1e-9)
        {
            best = Some((separator, share));
        }
    }
    let by_first = || {
        let first = rows_first(rows);
        SEPARATORS.into_iter().find(
            |separator| matches!(separator, Separator::Byte(byte) if first.as_bytes().contains(byte)),
        )
    };
    best.map(|(separator, _)| separator).or_else(by_first).unwrap_or(Separator::Blanks)
}

fn rows_first<'a>(rows: &[&'a str]) -> &'a str {
    rows.first().copied().unwrap_or_default()
}

/// Detects the decimal sign from the rows.
fn detect_decimal(
    rows: &[&str],
    separator: Separator,
    mapping: &Mapping,
) -> Result<Decimal, ImportError> {
    if let Some(decimal) = mapping.decimal {
        return Ok(decimal);
    }
    let mut either = None;
    for row in rows {
        for cell in split(separator, row).unwrap_or_default() {
            match number::decimal_evidence(&cell) {
                DecimalEvidence::Comma => return Ok(Decimal::Comma),
                DecimalEvidence::Point => return Ok(Decimal::Point),
                DecimalEvidence::Either => either = either.or(Some(cell)),
                DecimalEvidence::Unknown => {}
            }
        }
    }
    match either {
        Some(cell) => Err(ImportError::mapping(
            format!("`{cell}` may have a decimal comma or a thousands separator"),
            "choose: --decimal comma or --decimal point",
        )),
        None => Ok(Decimal::Point),
    }
}

/// Returns `true` for a stream of `angle,distance.` without line ends, as sent by the "radar"
/// sketches for Arduino. The first and the last record may be incomplete.
fn is_stream(head: &str) -> bool {
    let is_whole =
        |word: &str| (1..8).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_digit());
    let records: Vec<&str> = head.split('.').collect();
    let [_, whole @ .., _] = &records[..] else { return false };
    let angles = whole.iter().map(|record| match record.split_once(',') {
        Some((angle, distance)) if is_whole(angle) && is_whole(distance) => Some(angle),
        _ => None,
    });
    let Some(angles) = angles.collect::<Option<Vec<&str>>>() else { return false };
    // Decimal numbers with one digit after the point look alike, but their first number does not
    // change.
    let is_turning = angles.windows(2).any(|pair| pair[0] != pair[1]);
    angles.len() > 2 && is_turning
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> TableLayout {
        TableLayout::detect(text, &Mapping::default()).expect("a table")
    }

    #[test]
    fn finds_separator_and_decimal_sign() {
        use Separator::{Blanks, Byte};
        for (text, separator, decimal) in [
            ("a,b\n1,2\n", Byte(b','), Decimal::Point),
            ("a;b\n15,5;31,5\n", Byte(b';'), Decimal::Comma),
            ("15,5;31,5\n16,5;32,5\n", Byte(b';'), Decimal::Comma),
            ("a\tb\n15,5\t31,5\n", Byte(b'\t'), Decimal::Comma),
            ("a|b\n1|2\n", Byte(b'|'), Decimal::Point),
            ("10 100,5\n20 101,5\n", Blanks, Decimal::Comma),
            ("\"a\",\"b\"\n\"15,5\",\"31,5\"\n", Byte(b','), Decimal::Comma),
            ("a, b\n1, 2\n", Byte(b','), Decimal::Point),
            ("angle (deg, ccw);d\n1;2\n", Byte(b';'), Decimal::Point),
            ("t,a\n2026-01-31 12:00:00,5\n2026-01-31 12:00:01,6\n", Byte(b','), Decimal::Point),
            ("1\n2\n", Blanks, Decimal::Point),
        ] {
            let found = header(text);
            assert_eq!((found.separator, found.decimal), (separator, decimal), "{text}");
        }
    }

    #[test]
    fn rejects_ambiguous_commas() {
        let text = "a;b\n10;1,500\n20;1,750\n";
        let error = TableLayout::detect(text, &Mapping::default()).expect_err("either");
        assert!(
            error.to_string().contains("decimal comma") && error.help().contains("--decimal comma")
        );
        for decimal in [Decimal::Comma, Decimal::Point] {
            let mapping = Mapping { decimal: Some(decimal), ..Mapping::default() };
            assert_eq!(TableLayout::detect(text, &mapping).expect("stated").decimal, decimal);
        }
        // One unambiguous value is enough.
        assert_eq!(header("a;b\n10;1,500\n20;1,75\n").decimal, Decimal::Comma);
    }

    #[test]
    fn takes_names_from_a_comment() {
        for text in [
            "% angle_deg distance_cm\n0 100\n",
            "# angle_deg, distance_cm\n0,100\n",
            "%a\n% angle_deg range_cm\n\n0 100\n",
        ] {
            let found = header(text);
            assert!(found.has_names && found.is_comment && found.cells.len() == 2, "{text}");
        }
        for text in ["# by hand today\n0 100\n", "# first sweep\n0 100 5\n", "# by hand\n0 100\n"] {
            assert!(!header(text).has_names, "{text}");
        }
    }

    #[test]
    fn detects_excel_line_and_streams() {
        let found = header("sep=;\na;b\n1;2\n");
        assert!(
            found.has_separator_line
                && found.cells == ["a", "b"]
                && found.notes[0].contains("sep=;")
        );
        let stream = "5,31.16,36.17,34.18,32.19,37.20,3";
        assert_eq!(header(stream).ends, LineEnding::Stops);
        assert_eq!(header("15.5,31.5,16.5,32.5\n").ends, LineEnding::Lines);
        assert_eq!(header("15,31.1\n16,32.2\n17,33.1\n").ends, LineEnding::Lines);
    }
}

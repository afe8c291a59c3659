//! Layout of a table: what separates its values, how its numbers are written, and the names of its columns.

use crate::{
    Column, ImportError, Mapping,
    lines::Ends,
    mapping::Decimal,
    number::{self, Shows},
    table::{comment, is_comment, split},
    words::{self, Name},
};

/// Separator of the values of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Between {
    Byte(u8),
    Blanks,
}

/// Separators, the less ambiguous first: only the last may stand within numbers.
const SEPARATORS: [Between; 5] = [
    Between::Byte(b'\t'),
    Between::Byte(b';'),
    Between::Byte(b'|'),
    Between::Byte(b','),
    Between::Blanks,
];

/// Rows that are looked at to find the layout.
const LOOKED_AT: usize = 200;

/// The layout of a table, from its beginning.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Header {
    pub(crate) between: Between,
    pub(crate) ends: Ends,
    pub(crate) decimal: Decimal,
    /// Names of the columns, or the values of the first row.
    pub(crate) cells: Vec<String>,
    /// True if `cells` are names and not values.
    pub(crate) has_names: bool,
    /// True if the names stand in a comment.
    pub(crate) is_comment: bool,
    /// A first line `sep=;`, as Excel writes it.
    pub(crate) has_separator_line: bool,
    /// Notes on the layout.
    pub(crate) notes: Vec<String>,
}

impl Header {
    /// Finds the layout at the beginning of a file.
    ///
    /// # Errors
    /// There is no line but comments, or commas in numbers may mean two things.
    pub(crate) fn of(head: &str, mapping: &Mapping) -> Result<Self, ImportError> {
        let mut notes = Vec::new();
        let ends = if is_stream(head) { Ends::Stops } else { Ends::Lines };
        if ends == Ends::Stops {
            notes.push(
                "records end with a full stop, not with the line: angle,distance.".to_owned(),
            );
        }
        let is_end = |c: char| matches!(c, '\n' | '\r') || (ends == Ends::Stops && c == '.');
        let lines: Vec<&str> = head.split(is_end).collect();
        let mut rows =
            lines.iter().copied().enumerate().filter(|(_, line)| !is_comment(line)).peekable();
        let said = rows.peek().and_then(|(_, line)| separator_line(line));
        if let Some(separator) = said {
            rows.next();
            notes.push(format!(
                "the line `sep={}` is taken as the separator",
                char::from(separator)
            ));
        }
        let rows: Vec<(usize, &str)> = rows.take(LOOKED_AT).collect();
        let Some(&(first_at, first)) = rows.first() else {
            return Err(ImportError::mapping(
                "the file holds no line of values",
                "give a table of readings",
            ));
        };
        let texts: Vec<&str> = rows.iter().map(|(_, line)| *line).collect();
        let between = said.map_or_else(|| separator(&texts), Between::Byte);
        let cells = split(between, first).unwrap_or_default();
        // A line with a number in it is a reading, which must not be lost.
        let is_number = |cell: &String| is_number(cell);
        let has_names = !cells.iter().any(is_number) && cells.iter().any(|cell| !cell.is_empty());
        let mut header = Self {
            between,
            ends,
            decimal: decimal(&texts[usize::from(has_names)..], between, mapping)?,
            cells,
            has_names,
            is_comment: false,
            has_separator_line: said.is_some(),
            notes,
        };
        if header.decimal == Decimal::Comma && mapping.decimal.is_none() {
            header.notes.push("numbers have a decimal comma".to_owned());
        }
        if ends == Ends::Stops {
            (header.cells, header.has_names) = (vec!["1".to_owned(), "2".to_owned()], false);
        } else if !has_names {
            header.take_names(lines[..first_at].iter().rev().find_map(|line| comment(line)));
        }
        let named =
            header.cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
        header.cells.truncate(named.max(1));
        Ok(header)
    }

    /// Takes names from the comment above the first row, if it has as many as the row has values.
    fn take_names(&mut self, comment: Option<&str>) {
        let Some(comment) = comment else { return };
        let ways = [self.between, Between::Byte(b','), Between::Blanks];
        let names = ways.into_iter().find_map(|between| {
            let names = split(between, comment).ok()?;
            let are_names = names.iter().all(|name| !name.is_empty() && !is_number(name));
            let is_known = names.iter().any(|name| match words::meaning(name) {
                Name::Field(field) => field.quantity().is_of_reading(),
                Name::Quantity(quantity) => quantity.is_of_reading(),
                _ => false,
            });
            (names.len() == self.cells.len() && names.len() > 1 && are_names && is_known)
                .then_some(names)
        });
        if let Some(names) = names {
            self.notes.push(format!("names of columns are taken from the comment `{comment}`"));
            (self.cells, self.has_names, self.is_comment) = (names, true, true);
        }
    }

    /// The place of a column, from 0.
    pub(crate) fn find(&self, column: &Column) -> Result<usize, ImportError> {
        let count = self.cells.len();
        match column {
            Column::Number(number) if (1..=count).contains(number) => Ok(number - 1),
            Column::Number(number) => Err(ImportError::mapping(
                format!("there is no column {number}: the first line has {count}"),
                "columns count from 1",
            )),
            Column::Several(_) => Err(ImportError::mapping(
                "several columns of ranges need an array",
                "name it: --array NAME or FILE",
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

fn is_number(cell: &str) -> bool {
    number::parse(cell, Decimal::Point).is_some() || number::parse(cell, Decimal::Comma).is_some()
}

/// The separator that Excel's first line states.
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

/// The separator by which most values are numbers, and every row has as many of them.
fn separator(rows: &[&str]) -> Between {
    let values = if rows.len() > 1 { &rows[1..] } else { rows };
    let share = |between: &Between| {
        let rows = values.iter().map(|row| split(*between, row).unwrap_or_default());
        let rows: Vec<Vec<String>> = rows.collect();
        let least = rows.iter().map(Vec::len).min().unwrap_or(0);
        let is_split =
            least > 1 || split(*between, rows_first(values)).is_ok_and(|row| row.len() > 1);
        let cells = || rows.iter().flatten().filter(|cell| !cell.is_empty());
        let numbers = cells().filter(|cell| is_number(cell)).count();
        let share = numbers as f64 / cells().count().max(1) as f64;
        is_split.then_some(share)
    };
    let mut best: Option<(Between, f64)> = None;
    for between in SEPARATORS {
        if let Some(share) = share(&between)
            && best.is_none_or(|(_, known)| share > known + 1e-9)
        {
            best = Some((between, share));
        }
    }
    let by_first = || {
        let first = rows_first(rows);
        SEPARATORS.into_iter().find(
            |between| matches!(between, Between::Byte(byte) if first.as_bytes().contains(byte)),
        )
    };
    best.map(|(between, _)| between).or_else(by_first).unwrap_or(Between::Blanks)
}

fn rows_first<'a>(rows: &[&'a str]) -> &'a str {
    rows.first().copied().unwrap_or_default()
}

/// The sign before fractions, as the rows show it.
fn decimal(rows: &[&str], between: Between, mapping: &Mapping) -> Result<Decimal, ImportError> {
    if let Some(decimal) = mapping.decimal {
        return Ok(decimal);
    }
    let mut either = None;
    for row in rows {
        for cell in split(between, row).unwrap_or_default() {
            match number::shows(&cell) {
                Shows::Comma => return Ok(Decimal::Comma),
                Shows::Point => return Ok(Decimal::Point),
                Shows::Either => either = either.or(Some(cell)),
                Shows::Nothing => {}
            }
        }
    }
    match either {
        Some(cell) => Err(ImportError::mapping(
            format!("`{cell}` may have a decimal comma, or a comma between thousands"),
            "choose: --decimal comma or --decimal point",
        )),
        None => Ok(Decimal::Point),
    }
}

/// Checks whether a text is a stream of `angle,distance.` without line ends, as the "radar" sketches send it. Its beginning and
/// its end may be cut.
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
    // Numbers with a digit behind their points look so, too; of these the first would be the same.
    let is_turning = angles.windows(2).any(|pair| pair[0] != pair[1]);
    angles.len() > 2 && is_turning
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Header {
        Header::of(text, &Mapping::default()).expect("a table")
    }

    #[test]
    fn separators_and_decimal_signs_are_found() {
        use Between::{Blanks, Byte};
        for (text, between, decimal) in [
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
            assert_eq!((found.between, found.decimal), (between, decimal), "{text}");
        }
    }

    #[test]
    fn commas_that_may_mean_two_things_are_asked_about() {
        let text = "a;b\n10;1,500\n20;1,750\n";
        let error = Header::of(text, &Mapping::default()).expect_err("either");
        assert!(
            error.to_string().contains("decimal comma") && error.help().contains("--decimal comma")
        );
        for decimal in [Decimal::Comma, Decimal::Point] {
            let mapping = Mapping { decimal: Some(decimal), ..Mapping::default() };
            assert_eq!(Header::of(text, &mapping).expect("said").decimal, decimal);
        }
        // One value settles the others.
        assert_eq!(header("a;b\n10;1,500\n20;1,75\n").decimal, Decimal::Comma);
    }

    #[test]
    fn names_are_taken_from_the_comment_above_that_has_as_many() {
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
    fn the_line_of_excel_and_streams_without_line_ends_are_known() {
        let found = header("sep=;\na;b\n1;2\n");
        assert!(
            found.has_separator_line
                && found.cells == ["a", "b"]
                && found.notes[0].contains("sep=;")
        );
        let stream = "5,31.16,36.17,34.18,32.19,37.20,3";
        assert_eq!(header(stream).ends, Ends::Stops);
        assert_eq!(header("15.5,31.5,16.5,32.5\n").ends, Ends::Lines);
        assert_eq!(header("15,31.1\n16,32.2\n17,33.1\n").ends, Ends::Lines);
    }
}

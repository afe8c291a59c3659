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
    /// True if the first row holds the names, as opposed to a comment or the rows themselves.
    pub(crate) has_name_row: bool,
    /// True if a row of units follows the names.
    pub(crate) has_unit_row: bool,
    /// True if the first row lacks columns, as in a capture that begins within a row.
    pub(crate) is_first_cut: bool,
    /// Label of each cell, as in `angle:15,distance:31`; empty without labels.
    labels: Vec<String>,
    /// True if a terminal program put the time before each row: `12:00:15.015 -> 15,31`.
    has_arrow: bool,
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
        let has_arrow = rows.iter().all(|(_, line)| stamped(line).is_some());
        if has_arrow {
            notes.push("the time before `->` in each line is column 1".to_owned());
        }
        let texts = rows.iter().map(|(_, line)| match stamped(line) {
            Some((_, row)) if has_arrow => row,
            _ => *line,
        });
        let texts: Vec<&str> = texts.collect();
        let mut layout = Self {
            separator: stated
                .map(Separator::Byte)
                .or_else(|| labelled_separator(&texts))
                .unwrap_or_else(|| detect_separator(&texts)),
            ends,
            decimal: Decimal::Point,
            cells: Vec::new(),
            has_names: false,
            has_name_row: false,
            has_unit_row: false,
            is_first_cut: false,
            labels: Vec::new(),
            has_arrow,
            has_separator_line: stated.is_some(),
            notes,
        };
        layout.cells = layout.split(first).unwrap_or_default();
        layout.find_names(&rows, &lines[..first_at]);
        let values = &texts[usize::from(layout.has_name_row)..];
        layout.decimal = detect_decimal(values, layout.separator, mapping)?;
        if layout.decimal == Decimal::Comma && mapping.decimal.is_none() {
            layout.notes.push("numbers have a decimal comma".to_owned());
        }
        let named =
            layout.cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
        layout.cells.truncate(named.max(1));
        Ok(layout)
    }

    /// Finds the names of the columns: in the first row, in each cell, or in the comment above.
    fn find_names(&mut self, rows: &[(usize, &str)], above: &[&str]) {
        if self.ends == LineEnding::Stops {
            self.cells = vec!["1".to_owned(), "2".to_owned()];
            return;
        }
        let second = rows.get(1).and_then(|(_, line)| self.split(line).ok()).unwrap_or_default();
        if let Some(labels) = labels(&self.cells, &second) {
            self.notes.push("column names taken from the labels of the values".to_owned());
            let names = labels.iter().map(|label| match label.is_empty() {
                true => "time".to_owned(),
                false => label.trim_end_matches([':', '=']).to_owned(),
            });
            (self.cells, self.has_names, self.labels) = (names.collect(), true, labels);
            return;
        }
        // A first line with a number is a reading, which must not be lost as a header.
        let own = usize::from(self.has_arrow);
        let is_number = |cell: &String| is_number(cell);
        let first = self.cells.get(own..).unwrap_or_default();
        if !first.iter().any(is_number) && first.iter().any(|cell| !cell.is_empty()) {
            (self.has_names, self.has_name_row) = (true, true);
            self.take_units(&second);
            if self.has_arrow {
                "time".clone_into(&mut self.cells[0]);
            }
            return;
        }
        if second.len() > self.cells.len() {
            // A capture that begins within a row; the others must agree.
            let others = rows.iter().skip(1).map(|(_, line)| self.split(line).unwrap_or_default());
            let is_usual = |cells: &Vec<String>| cells.len() == second.len();
            let usual = others.clone().filter(is_usual).count();
            if usual > 1 && 5 * usual >= 4 * (rows.len() - 1) {
                (self.cells, self.is_first_cut) = (second, true);
            }
        }
        self.take_names(above.iter().rev().find_map(|line| comment(line)));
    }

    /// Joins a row of units below the names with them: `angle`, `[deg]` becomes `angle [deg]`.
    fn take_units(&mut self, second: &[String]) {
        let unit = |cell: &String| {
            let unit = cell.trim_matches(['[', ']', '(', ')']);
            (unit.is_empty() || column_names::is_unit(unit)).then(|| unit.to_owned())
        };
        let units: Option<Vec<String>> = second.iter().map(unit).collect();
        let Some(units) = units.filter(|units| units.iter().any(|unit| !unit.is_empty())) else {
            return;
        };
        self.notes.push("units taken from the row below the column names".to_owned());
        self.has_unit_row = true;
        for (name, unit) in self.cells.iter_mut().zip(&units).filter(|(_, unit)| !unit.is_empty()) {
            *name = format!("{name} [{unit}]");
        }
    }

    /// Splits a line into its values, without their labels.
    pub(crate) fn split(&self, line: &str) -> Result<Vec<String>, String> {
        let parted = stamped(line).filter(|_| self.has_arrow);
        let mut cells = split(self.separator, parted.map_or(line, |(_, row)| row))?;
        if self.has_arrow {
            cells.insert(0, parted.map_or_else(String::new, |(time, _)| time.to_owned()));
        }
        for (cell, label) in cells.iter_mut().zip(&self.labels) {
            if let Some((_, value)) = labelled(cell).filter(|(found, _)| found == label) {
                let value = value.trim_end_matches(|c: char| c.is_alphabetic()).trim();
                *cell = value.to_owned();
            }
        }
        Ok(cells)
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
                NameMeaning::FieldQuantity(quantity) => quantity.is_measurement(),
                _ => false,
            });
            (names.len() == self.cells.len() && names.len() > 1 && are_names && is_known)
                .then_some(names)
        });
        if let Some(names) = names {
            self.notes.push(format!("column names taken from the comment `{comment}`"));
            (self.cells, self.has_names) = (names, true);
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

/// Separates the time that a terminal program puts before a line: `12:00:15.015 -> 15,31`.
fn stamped(line: &str) -> Option<(&str, &str)> {
    let (time, row) = line.split_once(" -> ")?;
    let is_time = time.len() >= 8
        && time.matches(':').count() == 2
        && time.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b':' | b'.'));
    is_time.then_some((time, row))
}

/// Returns the labels of the cells of two rows, as sent to plotters (`angle:15,distance:31 cm`):
/// alike in both, and followed by numbers. The label of a cell of the time is empty.
fn labels(first: &[String], second: &[String]) -> Option<Vec<String>> {
    if first.is_empty() || first.len() != second.len() {
        return None;
    }
    let label = |(a, b): (&String, &String)| {
        if a.contains(':') && a.starts_with(|c: char| c.is_ascii_digit()) {
            return Some(String::new());
        }
        let (label, value) = labelled(a)?;
        let unit = value.trim_start_matches(|c: char| !c.is_alphabetic());
        let number = value.trim_end_matches(|c: char| c.is_alphabetic()).trim();
        let is_same = labelled(b).is_some_and(|(other, _)| other == label);
        let is_known = unit.is_empty() || column_names::is_unit(unit);
        (is_same && is_known && is_number(number)).then_some(label)
    };
    let labels: Vec<String> = first.iter().zip(second).map(label).collect::<Option<_>>()?;
    labels.iter().any(|label| !label.is_empty()).then_some(labels)
}

/// Separates the label of a value, with its unit if the value has one: `dist: 31 cm` is labelled
/// `dist cm:`.
fn labelled(cell: &str) -> Option<(String, &str)> {
    let at = cell.find([':', '='])?;
    let (name, value) = (cell[..at].trim(), cell[at + 1..].trim());
    // A word in place of a number is no unit.
    let has_number = value.contains(|c: char| c.is_ascii_digit());
    let unit = value.trim_start_matches(|c: char| !c.is_alphabetic());
    let unit = if has_number { unit } else { "" };
    let is_name = name.starts_with(char::is_alphabetic);
    let label = match unit.is_empty() {
        true => format!("{name}:"),
        false => format!("{name} {unit}:"),
    };
    is_name.then_some((label, value))
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

/// Returns the separator of labelled values, which may have blanks within them.
fn labelled_separator(rows: &[&str]) -> Option<Separator> {
    let [first, second, ..] = rows else { return None };
    SEPARATORS.into_iter().find(|separator| {
        let rows = [first, second].map(|row| split(*separator, row).unwrap_or_default());
        labels(&rows[0], &rows[1]).is_some()
    })
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
            assert!(found.has_names && !found.has_name_row && found.cells.len() == 2, "{text}");
        }
        for text in ["# by hand today\n0 100\n", "# first sweep\n0 100 5\n", "# by hand\n0 100\n"] {
            assert!(!header(text).has_names, "{text}");
        }
    }

    #[test]
    fn takes_labels_units_and_times() {
        let names = |text: &str| header(text).cells;
        for text in ["angle:15,dist:31\nangle:16,dist:32\n", "angle=15;dist=31\nangle=16;dist=32\n"]
        {
            let found = header(text);
            assert_eq!(found.cells, ["angle", "dist"], "{text}");
            let row = text.lines().next().expect("a row");
            assert_eq!(found.split(row).expect("a row"), ["15", "31"]);
        }
        let text = "Angle: 15 deg, Distance: 31 cm\nAngle: 16 deg, Distance: 32 cm\n";
        assert_eq!(names(text), ["Angle deg", "Distance cm"]);
        assert_eq!(names("a,d\n[deg],[cm]\n1,2\n"), ["a [deg]", "d [cm]"]);
        assert_eq!(names("a,d\nx,y\n1,2\n"), ["a", "d"]);
        let found = header("12:00:15.015 -> a,d\n12:00:15.115 -> 16,32\n");
        assert_eq!(found.cells, ["time", "a", "d"]);
        let row = found.split("12:00:15.115 -> 16,32").expect("a row");
        assert_eq!(row, ["12:00:15.115", "16", "32"]);
        assert!(header("1\n0,100\n5,101\n").is_first_cut);
        assert!(!header("0 100\n5 101 10 102\n15 103\n").is_first_cut);
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

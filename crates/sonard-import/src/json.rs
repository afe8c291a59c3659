//! JSON readings: objects with one reading or with lists of readings, and lists of numbers.

use std::{borrow::Cow, io::Read};

use serde_json::Value;

use crate::{
    Column, FileLocation, ImportError, Mapping, Row,
    lines::{LineEnding, LineReader, TextLine},
};

/// Maximum size of a document that is not JSON Lines.
const MAX_DOCUMENT_BYTES: usize = 64 << 20;

/// Returns the rows of a JSON file: of a list of objects or lists, of a single object, or of one
/// object per line. Lists in mapped members give one row per element, with scalar members repeated.
/// With `of_array`, lists are rounds of an array and give one row each.
///
/// # Errors
/// Returns an error for invalid JSON. Rows are errors if an object lacks a member or its lists
/// differ in length.
pub(crate) fn rows<'a>(
    source: impl Read + 'a,
    mapping: &'a Mapping,
    of_array: bool,
) -> Result<Box<dyn Iterator<Item = Result<Row, ImportError>> + 'a>, ImportError> {
    let objects = objects(source)?;
    Ok(Box::new((1..).zip(objects).flat_map(move |(number, object)| {
        match object.and_then(|object| rows_of(number, &object, mapping, of_array)) {
            Ok(rows) => rows.into_iter().map(Ok).collect::<Vec<_>>(),
            Err(error) => vec![Err(error)],
        }
    })))
}

/// Parsed object of a file.
type Object = Result<Value, ImportError>;

/// Returns the objects of a JSON or JSON Lines file.
pub(crate) fn objects<'a>(
    source: impl Read + 'a,
) -> Result<Box<dyn Iterator<Item = Object> + 'a>, ImportError> {
    let mut lines = LineReader::new(source, LineEnding::Lines);
    // A single line, or the beginning of a longer document.
    let mut text = String::new();
    let mut is_first = true;
    for line in lines.by_ref() {
        let TextLine { text: line, .. } = line?;
        text.push_str(&line);
        text.push('\n');
        if text.len() > MAX_DOCUMENT_BYTES {
            return Err(ImportError::mapping(
                format!(
                    "JSON document of more than {} MB, which is the limit without JSON Lines",
                    MAX_DOCUMENT_BYTES >> 20
                ),
                "write one object per line: `jq -c '.[]' FILE > LINES`",
            ));
        }
        if line.trim().is_empty() {
            continue;
        }
        let is_whole = std::mem::take(&mut is_first)
            && read(&line).is_ok_and(|value| value.is_object() || is_scalar_row(&value));
        if is_whole {
            let first = std::iter::once(parse(1, &text));
            let rest =
                lines.filter(|line| !line.as_ref().is_ok_and(|line| line.text.trim().is_empty()));
            return Ok(Box::new(first.chain(rest.map(|line| {
                let line = line?;
                parse(line.number, &line.text)
            }))));
        }
    }
    let values = match parse(1, &text)? {
        value if is_scalar_row(&value) => vec![value],
        Value::Array(values) => values,
        value => vec![value],
    };
    Ok(Box::new(values.into_iter().map(Ok)))
}

/// Returns `true` for a list of at least two scalars, a row of numbers.
fn is_scalar_row(value: &Value) -> bool {
    let is_cell = |cell: &Value| !cell.is_object() && !cell.is_array();
    value.as_array().is_some_and(|cells| cells.len() > 1 && cells.iter().all(is_cell))
}

pub(crate) fn parse(first_line: u64, text: &str) -> Object {
    read(text).map_err(|error| {
        let line = first_line + (error.line() as u64).saturating_sub(1);
        ImportError::at(
            FileLocation::Line(line),
            format!("invalid JSON: {error}"),
            "correct the file",
        )
    })
}

fn read(text: &str) -> serde_json::Result<Value> {
    serde_json::from_str(&replace_non_finite(text))
}

/// Replaces `NaN`, `Infinity` and `-Infinity`, as written by Python, by `null`: no echo.
fn replace_non_finite(text: &str) -> Cow<'_, str> {
    const NON_FINITE: [&str; 4] = ["-Infinity", "Infinity", "NaN", "nan"];
    if !NON_FINITE.iter().any(|name| text.contains(name)) {
        return Cow::Borrowed(text);
    }
    let mut plain = String::with_capacity(text.len());
    let (mut rest, mut is_string) = (text, false);
    while let Some(next) = rest.chars().next() {
        let name = NON_FINITE.iter().find(|name| !is_string && rest.starts_with(**name));
        let consumed = match (name, next) {
            (Some(name), _) => {
                plain.push_str("null");
                name.len()
            }
            (None, '\\') if is_string => {
                let escaped = 1 + rest[1..].chars().next().map_or(0, char::len_utf8);
                plain.push_str(&rest[..escaped]);
                escaped
            }
            (None, next) => {
                is_string ^= next == '"';
                plain.push(next);
                next.len_utf8()
            }
        };
        rest = &rest[consumed..];
    }
    Cow::Owned(plain)
}

fn rows_of(
    number: u64,
    object: &Value,
    mapping: &Mapping,
    of_array: bool,
) -> Result<Vec<Row>, ImportError> {
    let whole = FileLocation::Entry { object: number, number: None };
    let members = mapping
        .columns
        .values()
        .map(|column| member(whole, object, column))
        .collect::<Result<Vec<_>, _>>()?;
    if of_array {
        let cells = members.iter().map(|of_column| match of_column[..] {
            [Value::Array(values)] => values.iter().map(cell).collect(),
            ref values => values.iter().map(|value| cell(value)).collect(),
        });
        return Ok(vec![Row { place: whole, cells: cells.collect() }]);
    }
    let members: Vec<&Value> = members.into_iter().flatten().collect();
    let lists =
        members.iter().zip(&mapping.columns).filter_map(|(member, (field, _))| match member {
            Value::Array(values) => Some((field, values.len())),
            _ => None,
        });
    let mut length = None;
    for (field, count) in lists {
        match length {
            Some((other, known)) if known != count => {
                let what = format!("{count} numbers of {field} but {known} of {other}");
                return Err(ImportError::at(
                    whole,
                    what,
                    "the lists of an object must have equal lengths",
                ));
            }
            _ => length = Some((field, count)),
        }
    }
    let Some((_, length)) = length else {
        let cells = members.into_iter().map(|member| vec![cell(member)]);
        return Ok(vec![Row { place: whole, cells: cells.collect() }]);
    };
    let row = |at: usize| Row {
        place: FileLocation::Entry { object: number, number: Some(at as u64 + 1) },
        cells: members
            .iter()
            .map(|member| vec![cell(member.as_array().map_or(*member, |values| &values[at]))])
            .collect(),
    };
    Ok((0..length).map(row).collect())
}

/// Returns the values of a column: a member by its path, or elements of a list by their numbers.
fn member<'a>(
    whole: FileLocation,
    object: &'a Value,
    column: &Column,
) -> Result<Vec<&'a Value>, ImportError> {
    let numbers = match column {
        Column::Name(path) => return named(whole, object, path).map(|value| vec![value]),
        Column::Number(number) => std::slice::from_ref(number),
        Column::Several(numbers) => numbers,
    };
    let Value::Array(values) = object else {
        return Err(ImportError::mapping(
            format!("{column}: members of a JSON object are mapped by name"),
            "write FIELD=MEMBER: --columns azimuth_deg=angle,range_m=range",
        ));
    };
    let value = |number: &usize| {
        let place = number.checked_sub(1).and_then(|place| values.get(place));
        place.ok_or_else(|| {
            let what = format!("no element {number}: the list has {}", values.len());
            ImportError::at(whole, what, "complete that list")
        })
    };
    numbers.iter().map(value).collect()
}

fn named<'a>(whole: FileLocation, object: &'a Value, path: &str) -> Result<&'a Value, ImportError> {
    let step = |value: &'a Value, name: &str| match value {
        Value::Object(members) => members.get(name),
        Value::Array(values) => values.get(name.parse::<usize>().ok()?),
        _ => None,
    };
    let found = object.get(path).or_else(|| path.split('.').try_fold(object, step));
    found.ok_or_else(|| {
        let what = format!("no member `{path}`");
        let help = match object {
            Value::Object(members) => {
                format!("the object has {}", members.keys().cloned().collect::<Vec<_>>().join(", "))
            }
            Value::Array(_) => {
                "the entries are lists: map the elements by number, --columns azimuth_deg=1,range_m=2".to_owned()
            }
            _ => "give a list of objects".to_owned(),
        };
        ImportError::at(whole, what, help)
    })
}

fn cell(value: &Value) -> Option<String> {
    match value {
        Value::Null => None,
        Value::String(text) => Some(text.clone()).filter(|text| !text.is_empty()),
        other => Some(other.to_string()),
    }
}

/// Kind of the first entry of a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum FirstEntry {
    /// Object, with the names of its members.
    Names(Vec<String>),
    /// List of numbers, with its length.
    List(usize),
    Other,
}

impl FirstEntry {
    /// Classifies the first value of a file, or the first element of a list of objects.
    pub(crate) fn from_value(value: &Value) -> Self {
        let first = match value {
            Value::Array(values) if !is_scalar_row(value) => values.first().unwrap_or(&Value::Null),
            value => value,
        };
        match first {
            Value::Object(members) => Self::Names(members.keys().cloned().collect()),
            Value::Array(values) => Self::List(values.len()),
            _ => Self::Other,
        }
    }

    /// Classifies the first value of a head; `None` if the value is incomplete.
    pub(crate) fn from_head(head: &str) -> Option<Self> {
        let text = replace_non_finite(head);
        let first = serde_json::Deserializer::from_str(&text).into_iter::<Value>().next();
        first.and_then(Result::ok).map(|value| Self::from_value(&value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn non_finite_numbers_become_null() {
        for (text, plain) in [
            ("[NaN, -Infinity, Infinity]", "[null, null, null]"),
            ("{\"NaN\": NaN, \"a\\\"NaN\": 1}", "{\"NaN\": null, \"a\\\"NaN\": 1}"),
            ("{\"NaN\\\\\": NaN}", "{\"NaN\\\\\": null}"),
            ("[1, 2]", "[1, 2]"),
        ] {
            assert_eq!(replace_non_finite(text), plain);
        }
    }

    #[test]
    fn first_entry_is_object_or_list() {
        for (text, entry) in [
            ("[{\"a\": 1}]", FirstEntry::Names(vec!["a".to_owned()])),
            ("{\"a\": 1}\n{\"a\": 2}", FirstEntry::Names(vec!["a".to_owned()])),
            ("[[0, 1.0], [1, 2]]", FirstEntry::List(2)),
            ("[0, 1.0]\n[1, 2.0]", FirstEntry::List(2)),
            ("3", FirstEntry::Other),
        ] {
            assert_eq!(FirstEntry::from_head(text), Some(entry), "{text}");
        }
        assert_eq!(FirstEntry::from_head("[{\"a\": 1"), None);
    }
}

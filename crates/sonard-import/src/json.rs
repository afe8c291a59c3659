//! Numbers in JSON: objects with a reading each or with lists of them, and lists of numbers.

use std::{borrow::Cow, io::Read};

use serde_json::Value;

use crate::{
    Column, ImportError, Location, Mapping, Row,
    lines::{Ends, Line, Lines},
};

/// The longest document that is not an object a line, bytes.
const MAX_DOCUMENT_BYTES: usize = 64 << 20;

/// The rows of a file that holds a list of objects or lists, an object, or an object a line. Where a member of the
/// mapping is a list there is a row for each of its numbers, with what is no list repeated; with `of_array` the lists
/// are rounds of an array, a row each.
///
/// # Errors
/// No JSON; of the rows, an object that lacks a member or whose lists are not equally long.
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

/// An object of the file, or why there is none.
type Object = Result<Value, ImportError>;

/// The objects of a file of JSON or JSON Lines.
pub(crate) fn objects<'a>(
    source: impl Read + 'a,
) -> Result<Box<dyn Iterator<Item = Object> + 'a>, ImportError> {
    let mut lines = Lines::of(source, Ends::Lines);
    // A line by itself, or the beginning of something longer.
    let mut text = String::new();
    let mut is_first = true;
    for line in lines.by_ref() {
        let Line { text: line, .. } = line?;
        text.push_str(&line);
        text.push('\n');
        if text.len() > MAX_DOCUMENT_BYTES {
            return Err(ImportError::mapping(
                format!(
                    "a JSON document of more than {} MB is held in memory as a whole",
                    MAX_DOCUMENT_BYTES >> 20
                ),
                "write an object a line: `jq -c '.[]' FILE > LINES`",
            ));
        }
        if line.trim().is_empty() {
            continue;
        }
        let is_whole = std::mem::take(&mut is_first)
            && read(&line).is_ok_and(|value| value.is_object() || is_pair(&value));
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
        value if is_pair(&value) => vec![value],
        Value::Array(values) => values,
        value => vec![value],
    };
    Ok(Box::new(values.into_iter().map(Ok)))
}

/// Checks whether a list is a row of numbers.
fn is_pair(value: &Value) -> bool {
    let is_cell = |cell: &Value| !cell.is_object() && !cell.is_array();
    value.as_array().is_some_and(|cells| cells.len() > 1 && cells.iter().all(is_cell))
}

pub(crate) fn parse(first_line: u64, text: &str) -> Object {
    read(text).map_err(|error| {
        let line = first_line + (error.line() as u64).saturating_sub(1);
        ImportError::at(Location::Line(line), format!("no JSON: {error}"), "correct the file")
    })
}

fn read(text: &str) -> serde_json::Result<Value> {
    serde_json::from_str(&without_signs_of_python(text))
}

/// JSON with `null` for the `NaN`, `Infinity` and `-Infinity` that Python writes; they are no number and no echo.
fn without_signs_of_python(text: &str) -> Cow<'_, str> {
    const SIGNS: [&str; 4] = ["-Infinity", "Infinity", "NaN", "nan"];
    if !SIGNS.iter().any(|sign| text.contains(sign)) {
        return Cow::Borrowed(text);
    }
    let mut plain = String::with_capacity(text.len());
    let (mut rest, mut is_text) = (text, false);
    while let Some(next) = rest.chars().next() {
        let sign = SIGNS.iter().find(|sign| !is_text && rest.starts_with(**sign));
        let taken = match (sign, next) {
            (Some(sign), _) => {
                plain.push_str("null");
                sign.len()
            }
            (None, '\\') if is_text => {
                let escaped = 1 + rest[1..].chars().next().map_or(0, char::len_utf8);
                plain.push_str(&rest[..escaped]);
                escaped
            }
            (None, next) => {
                is_text ^= next == '"';
                plain.push(next);
                next.len_utf8()
            }
        };
        rest = &rest[taken..];
    }
    Cow::Owned(plain)
}

fn rows_of(
    number: u64,
    object: &Value,
    mapping: &Mapping,
    of_array: bool,
) -> Result<Vec<Row>, ImportError> {
    let whole = Location::Entry { object: number, number: None };
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
                let what = format!("{count} numbers of {field} and {known} of {other}");
                return Err(ImportError::at(whole, what, "lists of one object are equally long"));
            }
            _ => length = Some((field, count)),
        }
    }
    let Some((_, length)) = length else {
        let cells = members.into_iter().map(|member| vec![cell(member)]);
        return Ok(vec![Row { place: whole, cells: cells.collect() }]);
    };
    let row = |at: usize| Row {
        place: Location::Entry { object: number, number: Some(at as u64 + 1) },
        cells: members
            .iter()
            .map(|member| vec![cell(member.as_array().map_or(*member, |values| &values[at]))])
            .collect(),
    };
    Ok((0..length).map(row).collect())
}

/// A member, by names and places with dots between, or by its place in a list.
fn member<'a>(
    whole: Location,
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
            format!("{column}: the members of a JSON object have names"),
            "write FIELD=MEMBER: --columns azimuth_deg=angle,range_m=range",
        ));
    };
    let value = |number: &usize| {
        let place = number.checked_sub(1).and_then(|place| values.get(place));
        place.ok_or_else(|| {
            let what = format!("there is no number {number}: the list has {}", values.len());
            ImportError::at(whole, what, "complete that list")
        })
    };
    numbers.iter().map(value).collect()
}

fn named<'a>(whole: Location, object: &'a Value, path: &str) -> Result<&'a Value, ImportError> {
    let step = |value: &'a Value, name: &str| match value {
        Value::Object(members) => members.get(name),
        Value::Array(values) => values.get(name.parse::<usize>().ok()?),
        _ => None,
    };
    let found = object.get(path).or_else(|| path.split('.').try_fold(object, step));
    found.ok_or_else(|| {
        let what = format!("there is no `{path}`");
        let help = match object {
            Value::Object(members) => {
                format!("the object has {}", members.keys().cloned().collect::<Vec<_>>().join(", "))
            }
            Value::Array(_) => {
                "these are lists: give the places of the numbers in them, --columns azimuth_deg=1,range_m=2".to_owned()
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
pub(crate) enum Entry {
    /// Names of the members of an object.
    Names(Vec<String>),
    /// Length of a list of numbers.
    List(usize),
    Other,
}

impl Entry {
    /// By the first value of a file, and what is in it if that is a list.
    pub(crate) fn of(value: &Value) -> Self {
        let first = match value {
            Value::Array(values) if !is_pair(value) => values.first().unwrap_or(&Value::Null),
            value => value,
        };
        match first {
            Value::Object(members) => Self::Names(members.keys().cloned().collect()),
            Value::Array(values) => Self::List(values.len()),
            _ => Self::Other,
        }
    }

    /// By the beginning of a file; `None` where that is cut.
    pub(crate) fn of_head(head: &str) -> Option<Self> {
        let text = without_signs_of_python(head);
        let first = serde_json::Deserializer::from_str(&text).into_iter::<Value>().next();
        first.and_then(Result::ok).map(|value| Self::of(&value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_of_python_are_null_but_not_within_texts() {
        for (text, plain) in [
            ("[NaN, -Infinity, Infinity]", "[null, null, null]"),
            ("{\"NaN\": NaN, \"a\\\"NaN\": 1}", "{\"NaN\": null, \"a\\\"NaN\": 1}"),
            ("{\"NaN\\\\\": NaN}", "{\"NaN\\\\\": null}"),
            ("[1, 2]", "[1, 2]"),
        ] {
            assert_eq!(without_signs_of_python(text), plain);
        }
    }

    #[test]
    fn entries_are_objects_or_lists() {
        for (text, entry) in [
            ("[{\"a\": 1}]", Entry::Names(vec!["a".to_owned()])),
            ("{\"a\": 1}\n{\"a\": 2}", Entry::Names(vec!["a".to_owned()])),
            ("[[0, 1.0], [1, 2]]", Entry::List(2)),
            ("[0, 1.0]\n[1, 2.0]", Entry::List(2)),
            ("3", Entry::Other),
        ] {
            assert_eq!(Entry::of_head(text), Some(entry), "{text}");
        }
        assert_eq!(Entry::of_head("[{\"a\": 1"), None);
    }
}

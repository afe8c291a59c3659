//! JSON readings: objects with one reading or with lists of readings, and lists of numbers.

use std::{borrow::Cow, io::Read};

use serde_json::Value;

use crate::{
    Column, FileLocation, ImportError, Mapping, Row,
    lines::{LineEnding, LineReader, MaxLine, TextLine},
};

/// Maximum size of a document that is not JSON Lines.
const MAX_DOCUMENT_BYTES: usize = 16 << 20;

/// Advice for a longer document.
const SPLIT_HELP: &str = "write one object per line: `jq -c '.[]' FILE > LINES`";

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
    // Programs write a document without line ends.
    let max = MaxLine { bytes: MAX_DOCUMENT_BYTES, help: SPLIT_HELP };
    let mut lines = LineReader::with_max(source, LineEnding::Lines, max);
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
                SPLIT_HELP,
            ));
        }
        if line.trim().is_empty() {
            continue;
        }
        let first = if std::mem::take(&mut is_first) { whole_line(&line) } else { None };
        if let Some(first) = first {
            let first = std::iter::once(Ok(first));
            let rest =
                lines.filter(|line| !line.as_ref().is_ok_and(|line| line.text.trim().is_empty()));
            let objects = first.chain(rest.map(|line| {
                let line = line?;
                parse(line.number, &line.text)
            }));
            return Ok(Box::new(objects.flat_map(|object| match object {
                Ok(object) => entries_of_object(object).into_iter().map(Ok).collect::<Vec<_>>(),
                Err(error) => vec![Err(error)],
            })));
        }
    }
    let plain = quote_non_finite(text.trim_end());
    let documents = serde_json::Deserializer::from_str(&plain).into_iter::<Value>();
    let documents = documents.map(|document| document.map_err(|error| invalid(1, &error, &text)));
    let documents = documents.collect::<Result<Vec<Value>, _>>()?;
    let values = documents.into_iter().flat_map(|value| match value {
        value if is_scalar_row(&value) => vec![value],
        Value::Array(values) => values,
        value => entries_of_object(value),
    });
    Ok(Box::new(values.map(Ok)))
}

/// Returns the objects of the only list of objects in an object, or the object itself. Documents
/// often wrap their readings: `{"data": [{...}, {...}]}`.
fn entries_of_object(value: Value) -> Vec<Value> {
    match wrapped_list(&value, MAX_WRAPPERS) {
        Some(entries) => entries.clone(),
        None => vec![value],
    }
}

/// Maximum number of objects around a list of readings.
const MAX_WRAPPERS: u32 = 3;

fn wrapped_list(value: &Value, depth: u32) -> Option<&Vec<Value>> {
    let members = value.as_object()?;
    let is_list = |value: &Value| value.as_array().is_some_and(|list| !list.is_empty());
    let lists: Vec<&Vec<Value>> =
        members.values().filter(|value| is_list(value)).filter_map(Value::as_array).collect();
    match lists[..] {
        [entries] => entries.iter().all(Value::is_object).then_some(entries),
        [] if depth > 0 => {
            let mut inner = members.values().filter_map(|value| wrapped_list(value, depth - 1));
            inner.next().filter(|_| inner.next().is_none())
        }
        _ => None,
    }
}

/// Parses a line that is an object or a row of numbers, as all lines of JSON Lines are.
fn whole_line(line: &str) -> Option<Value> {
    // A document in one line may be long; its list of lists or objects is no row.
    let list = line.trim_start().strip_prefix('[').map(str::trim_start);
    if list.is_some_and(|entries| entries.starts_with(['[', '{'])) {
        return None;
    }
    read(line).ok().filter(|value| value.is_object() || is_scalar_row(value))
}

/// Returns `true` for a list of at least two scalars, a row of numbers.
fn is_scalar_row(value: &Value) -> bool {
    let is_cell = |cell: &Value| !cell.is_object() && !cell.is_array();
    value.as_array().is_some_and(|cells| cells.len() > 1 && cells.iter().all(is_cell))
}

pub(crate) fn parse(first_line: u64, text: &str) -> Object {
    read(text).map_err(|error| invalid(first_line, &error, text))
}

fn invalid(first_line: u64, error: &serde_json::Error, text: &str) -> ImportError {
    let line = first_line + (error.line() as u64).saturating_sub(1);
    let help = match error.is_eof() {
        true => "the file is cut off: complete or remove its last entry",
        false if text.contains("{'") || text.contains("['") => {
            "strings need double quotes: write Python objects with `json.dumps`, not with `print`"
        }
        false => "correct the file",
    };
    ImportError::at(FileLocation::Line(line), format!("invalid JSON: {error}"), help)
}

fn read(text: &str) -> serde_json::Result<Value> {
    serde_json::from_str(&quote_non_finite(text.trim_end()))
}

/// Quotes `NaN`, `Infinity` and `-Infinity`, as written by Python, which JSON does not have.
fn quote_non_finite(text: &str) -> Cow<'_, str> {
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
                plain.extend(["\"", name, "\""]);
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
            Value::Array(values) if !is_scalar_row(value) => values.first(),
            value => wrapped_list(value, MAX_WRAPPERS).map_or(Some(value), |list| list.first()),
        };
        match first.unwrap_or(&Value::Null) {
            Value::Object(members) => Self::Names(members.keys().cloned().collect()),
            Value::Array(values) => Self::List(values.len()),
            _ => Self::Other,
        }
    }

    /// Classifies the first value of a head; `None` if the value is incomplete.
    pub(crate) fn from_head(head: &str) -> Option<Self> {
        let text = quote_non_finite(head);
        let first = serde_json::Deserializer::from_str(&text).into_iter::<Value>().next();
        first.and_then(Result::ok).map(|value| Self::from_value(&value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn non_finite_numbers_are_quoted() {
        for (text, plain) in [
            ("[NaN, -Infinity, Infinity]", "[\"NaN\", \"-Infinity\", \"Infinity\"]"),
            ("{\"NaN\": NaN, \"a\\\"NaN\": 1}", "{\"NaN\": \"NaN\", \"a\\\"NaN\": 1}"),
            ("{\"NaN\\\\\": NaN}", "{\"NaN\\\\\": \"NaN\"}"),
            ("[1, 2]", "[1, 2]"),
        ] {
            assert_eq!(quote_non_finite(text), plain);
        }
    }

    #[test]
    fn wrapped_and_joined_documents() {
        let entry = "{\"a\": 1, \"b\": [2]}";
        for text in [
            format!("{{\"data\": [{entry}, {entry}]}}"),
            format!("{{\"meta\": {{\"v\": 1}},\n\"scan\": {{\"of\": [{entry}, {entry}]}}}}"),
            format!("{entry}{entry}"),
            format!("{{\n\"a\": 1,\n\"b\": [2]}}\n{entry}"),
            format!("[{entry}, {entry}]"),
        ] {
            let objects = objects(text.as_bytes()).expect("JSON");
            let objects: Vec<Value> = objects.map(|object| object.expect("an object")).collect();
            assert_eq!(objects, vec![parse(1, entry).expect("JSON"); 2], "{text}");
        }
        // Two lists, or a list of columns, are not wrappers.
        for text in ["{\"a\": [{}], \"b\": [{}]}", "{\"a\": [1, 2], \"b\": [3, 4]}"] {
            assert_eq!(objects(text.as_bytes()).expect("JSON").count(), 1, "{text}");
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

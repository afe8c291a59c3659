//! Numbers in JSON: objects with a reading each, or with lists of them.

use std::io::Read;

use serde_json::Value;

use crate::{Column, ImportError, Location, Mapping, Row, table::Lines};

/// The rows of a file that holds a list of objects, an object, or an object a line. Where a member of the
/// mapping is a list there is a row for each of its numbers, with what is no list repeated.
///
/// # Errors
/// No JSON; of the rows, an object that lacks a member or whose lists are not equally long.
pub(crate) fn rows<'a>(
    source: impl Read + 'a,
    mapping: &'a Mapping,
) -> Result<Box<dyn Iterator<Item = Result<Row, ImportError>> + 'a>, ImportError> {
    let objects = objects(source)?;
    Ok(Box::new((1..).zip(objects).flat_map(move |(number, object)| {
        match object.and_then(|object| rows_of(number, &object, mapping)) {
            Ok(rows) => rows.into_iter().map(Ok).collect::<Vec<_>>(),
            Err(error) => vec![Err(error)],
        }
    })))
}

/// An object of the file, or why there is none.
type Object = Result<Value, ImportError>;

fn objects<'a>(
    source: impl Read + 'a,
) -> Result<Box<dyn Iterator<Item = Object> + 'a>, ImportError> {
    let mut lines = Lines::of(source);
    // A line by itself, or the beginning of something longer.
    let mut text = String::new();
    for line in lines.by_ref() {
        let (number, line) = line?;
        text.push_str(&line);
        text.push('\n');
        if number == 1 && serde_json::from_str::<Value>(&line).is_ok_and(|value| value.is_object())
        {
            let first = std::iter::once(parse(1, &text));
            let rest =
                lines.filter(|line| !line.as_ref().is_ok_and(|(_, line)| line.trim().is_empty()));
            return Ok(Box::new(first.chain(rest.map(|line| {
                let (number, line) = line?;
                parse(number, &line)
            }))));
        }
    }
    let values = match parse(1, &text)? {
        Value::Array(values) => values,
        value => vec![value],
    };
    Ok(Box::new(values.into_iter().map(Ok)))
}

fn parse(first_line: u64, text: &str) -> Object {
    serde_json::from_str(text).map_err(|error| {
        let line = first_line + (error.line() as u64).saturating_sub(1);
        ImportError::at(Location::Line(line), format!("no JSON: {error}"), "correct the file")
    })
}

fn rows_of(number: u64, object: &Value, mapping: &Mapping) -> Result<Vec<Row>, ImportError> {
    let whole = Location::Entry { object: number, number: None };
    let members = mapping
        .columns
        .values()
        .map(|column| member(whole, object, column))
        .collect::<Result<Vec<_>, _>>()?;
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
        return Ok(vec![Row { place: whole, cells: members.into_iter().map(cell).collect() }]);
    };
    let row = |at: usize| Row {
        place: Location::Entry { object: number, number: Some(at as u64 + 1) },
        cells: members
            .iter()
            .map(|member| cell(member.as_array().map_or(*member, |values| &values[at])))
            .collect(),
    };
    Ok((0..length).map(row).collect())
}

/// A member, by names and places with dots between.
fn member<'a>(
    whole: Location,
    object: &'a Value,
    column: &Column,
) -> Result<&'a Value, ImportError> {
    let Column::Name(path) = column else {
        return Err(ImportError::mapping(
            format!("{column}: the members of a JSON object have names"),
            "write FIELD=MEMBER: --columns azimuth_deg=angle,range_m=range",
        ));
    };
    let step = |value: &'a Value, name: &str| match value {
        Value::Object(members) => members.get(name),
        Value::Array(values) => values.get(name.parse::<usize>().ok()?),
        _ => None,
    };
    let found = object.get(path).or_else(|| path.split('.').try_fold(object, step));
    found.ok_or_else(|| {
        let known = object.as_object().map(|members| members.keys().cloned().collect::<Vec<_>>());
        let what = format!("there is no `{path}`");
        ImportError::at(
            whole,
            what,
            match known {
                Some(known) => format!("the object has {}", known.join(", ")),
                None => "give a list of objects".to_owned(),
            },
        )
    })
}

fn cell(value: &Value) -> Option<String> {
    match value {
        Value::Null => None,
        Value::String(text) => Some(text.clone()).filter(|text| !text.is_empty()),
        other => Some(other.to_string()),
    }
}

/// The names of the members of the first object, for guessing.
pub(crate) fn names(head: &Value) -> Vec<String> {
    let first = match head {
        Value::Array(values) => values.first(),
        value => Some(value),
    };
    first
        .and_then(Value::as_object)
        .map(|members| members.keys().cloned().collect())
        .unwrap_or_default()
}

//! Source positions of values in the text of a JSON document.

use std::{
    collections::HashSet,
    fmt,
    ops::{Deref, Range},
};

use jsonc_parser::{
    CollectOptions, ParseOptions,
    ast::{Object, ObjectPropName, Value},
    common::Ranged,
};
use serde_path_to_error::Segment;

/// Path to a value: `walls[2].to[0]`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct JsonPath(Vec<PathStep>);

#[derive(Debug, Clone, PartialEq, Eq)]
enum PathStep {
    Key(String),
    Index(usize),
}

impl JsonPath {
    pub(super) fn root() -> Self {
        Self::default()
    }

    /// Path to the member `key` of this object.
    pub(super) fn key(&self, key: &str) -> Self {
        self.with(PathStep::Key(key.to_owned()))
    }

    /// Path to the element `index` of this array.
    pub(super) fn index(&self, index: usize) -> Self {
        self.with(PathStep::Index(index))
    }

    /// Name of the last member on the path.
    pub(super) fn last_key(&self) -> Option<&str> {
        match self.0.last() {
            Some(PathStep::Key(key)) => Some(key),
            _ => None,
        }
    }

    fn with(&self, step: PathStep) -> Self {
        let mut steps = self.0.clone();
        steps.push(step);
        Self(steps)
    }
}

impl From<&serde_path_to_error::Path> for JsonPath {
    fn from(path: &serde_path_to_error::Path) -> Self {
        Self(
            path.iter()
                .filter_map(|segment| match segment {
                    Segment::Seq { index } => Some(PathStep::Index(*index)),
                    Segment::Map { key } => Some(PathStep::Key(key.clone())),
                    Segment::Enum { .. } | Segment::Unknown => None,
                })
                .collect(),
        )
    }
}

impl fmt::Display for JsonPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, step) in self.0.iter().enumerate() {
            match step {
                PathStep::Index(index) => write!(f, "[{index}]")?,
                PathStep::Key(key) if at == 0 => write!(f, "{}", key.escape_debug())?,
                PathStep::Key(key) => write!(f, ".{}", key.escape_debug())?,
            }
        }
        Ok(())
    }
}

/// Part of an object member.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MemberPart {
    Value,
    Key,
}

/// Parsed document with the source position of each value.
pub(super) struct LocatedDocument<'a>(Value<'a>);

impl<'a> LocatedDocument<'a> {
    /// Returns `None` if the text is not JSON.
    pub(super) fn new(text: &'a str) -> Option<Self> {
        let options = ParseOptions { allow_comments: false, ..ParseOptions::default() };
        jsonc_parser::parse_to_ast(text, &CollectOptions::default(), &options).ok()?.value.map(Self)
    }

    /// Byte range of the value at `path` (or of its name), or of the innermost existing value on
    /// the path.
    pub(super) fn find(&self, path: &JsonPath, part: MemberPart) -> Range<usize> {
        let mut value = &self.0;
        for (at, step) in path.0.iter().enumerate() {
            match (step, value) {
                (PathStep::Index(index), Value::Array(array)) if *index < array.elements.len() => {
                    value = &array.elements[*index];
                }
                (PathStep::Key(key), Value::Object(object)) => {
                    let Some(member) = object.properties.iter().rfind(|p| name_of(&p.name) == key)
                    else {
                        break;
                    };
                    if part == MemberPart::Key && at + 1 == path.0.len() {
                        return bytes(&member.name);
                    }
                    value = &member.value;
                }
                _ => break,
            }
        }
        bytes(value)
    }

    /// First array in a position where an object is required.
    ///
    /// Serde's derived code accepts an array for a struct, in the order of the fields. Such a scene
    /// file would be unreadable, and its schema rejects it.
    pub(super) fn array_for_object(&self) -> Option<(JsonPath, Range<usize>)> {
        let root = JsonPath::root();
        let Value::Object(scene) = &self.0 else { return reject_array(&self.0, &root) };
        scene.properties.iter().find_map(|member| {
            let name = name_of(&member.name);
            let path = root.key(name);
            match (name, &member.value) {
                ("walls" | "cylinders", Value::Array(array)) => array
                    .elements
                    .iter()
                    .enumerate()
                    .find_map(|(index, element)| reject_array(element, &path.index(index))),
                ("materials" | "poses", Value::Object(named)) => {
                    named.properties.iter().find_map(|member| {
                        reject_array(&member.value, &path.key(name_of(&member.name)))
                    })
                }
                ("robot", Value::Object(robot)) => robot
                    .properties
                    .iter()
                    .filter(|member| name_of(&member.name) == "circle")
                    .find_map(|member| reject_array(&member.value, &path.key("circle"))),
                ("materials" | "poses" | "robot", value) => reject_array(value, &path),
                _ => None,
            }
        })
    }

    /// First duplicate member name of an object: the path and the byte range of the name.
    pub(super) fn duplicate_key(&self) -> Option<(JsonPath, Range<usize>)> {
        duplicate_in(&self.0, &JsonPath::root())
    }
}

fn reject_array(value: &Value<'_>, path: &JsonPath) -> Option<(JsonPath, Range<usize>)> {
    matches!(value, Value::Array(_)).then(|| (path.clone(), bytes(value)))
}

fn duplicate_in(value: &Value<'_>, path: &JsonPath) -> Option<(JsonPath, Range<usize>)> {
    match value {
        Value::Array(array) => array
            .elements
            .iter()
            .enumerate()
            .find_map(|(index, element)| duplicate_in(element, &path.index(index))),
        Value::Object(object) => duplicate_among(object, path),
        _ => None,
    }
}

fn duplicate_among(object: &Object<'_>, path: &JsonPath) -> Option<(JsonPath, Range<usize>)> {
    let mut names = HashSet::new();
    object.properties.iter().find_map(|property| {
        let name = name_of(&property.name);
        let path = path.key(name);
        if names.insert(name) {
            duplicate_in(&property.value, &path)
        } else {
            Some((path, bytes(&property.name)))
        }
    })
}

fn name_of<'n>(name: &'n ObjectPropName<'_>) -> &'n str {
    match name {
        ObjectPropName::String(text) => text.value.deref(),
        ObjectPropName::Word(word) => word.value,
    }
}

fn bytes(ranged: &impl Ranged) -> Range<usize> {
    ranged.start()..ranged.end()
}

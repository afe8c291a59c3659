//! Where in the text of a JSON document a value stands.

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

/// The way to a value: `walls[2].to[0]`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct JsonPath(Vec<Step>);

#[derive(Debug, Clone, PartialEq, Eq)]
enum Step {
    Key(String),
    Index(usize),
}

impl JsonPath {
    pub(super) fn root() -> Self {
        Self::default()
    }

    /// The member `key` of this object.
    pub(super) fn key(&self, key: &str) -> Self {
        self.with(Step::Key(key.to_owned()))
    }

    /// The element `index` of this array.
    pub(super) fn index(&self, index: usize) -> Self {
        self.with(Step::Index(index))
    }

    /// The name of the member it ends at.
    pub(super) fn last_key(&self) -> Option<&str> {
        match self.0.last() {
            Some(Step::Key(key)) => Some(key),
            _ => None,
        }
    }

    fn with(&self, step: Step) -> Self {
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
                    Segment::Seq { index } => Some(Step::Index(*index)),
                    Segment::Map { key } => Some(Step::Key(key.clone())),
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
                Step::Index(index) => write!(f, "[{index}]")?,
                Step::Key(key) if at == 0 => write!(f, "{}", key.escape_debug())?,
                Step::Key(key) => write!(f, ".{}", key.escape_debug())?,
            }
        }
        Ok(())
    }
}

/// Which part of a member is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// Its value.
    Value,
    /// Its name.
    Key,
}

/// A parsed document that knows the place of each value.
pub(super) struct Located<'a>(Value<'a>);

impl<'a> Located<'a> {
    /// `None` if the text is not JSON.
    pub(super) fn new(text: &'a str) -> Option<Self> {
        let options = ParseOptions { allow_comments: false, ..ParseOptions::default() };
        jsonc_parser::parse_to_ast(text, &CollectOptions::default(), &options).ok()?.value.map(Self)
    }

    /// Bytes of the value at `path` (or of its name), or of the innermost value on the way to it
    /// that exists.
    pub(super) fn find(&self, path: &JsonPath, part: Part) -> Range<usize> {
        let mut value = &self.0;
        for (at, step) in path.0.iter().enumerate() {
            match (step, value) {
                (Step::Index(index), Value::Array(array)) if *index < array.elements.len() => {
                    value = &array.elements[*index];
                }
                (Step::Key(key), Value::Object(object)) => {
                    let Some(member) = object.properties.iter().rfind(|p| name_of(&p.name) == key)
                    else {
                        break;
                    };
                    if part == Part::Key && at + 1 == path.0.len() {
                        return bytes(&member.name);
                    }
                    value = &member.value;
                }
                _ => break,
            }
        }
        bytes(value)
    }

    /// The first value at one of the places where an object belongs that is an array instead.
    ///
    /// Serde's derived code takes an array for a struct, by the order of the fields; a scene
    /// file written so could not be read by a person, and its schema refuses it.
    pub(super) fn array_for_object(&self) -> Option<(JsonPath, Range<usize>)> {
        let root = JsonPath::root();
        let Value::Object(scene) = &self.0 else { return refuse_array(&self.0, &root) };
        scene.properties.iter().find_map(|member| {
            let name = name_of(&member.name);
            let path = root.key(name);
            match (name, &member.value) {
                ("walls" | "cylinders", Value::Array(array)) => array
                    .elements
                    .iter()
                    .enumerate()
                    .find_map(|(index, element)| refuse_array(element, &path.index(index))),
                ("materials" | "poses", Value::Object(named)) => {
                    named.properties.iter().find_map(|member| {
                        refuse_array(&member.value, &path.key(name_of(&member.name)))
                    })
                }
                ("robot", Value::Object(robot)) => robot
                    .properties
                    .iter()
                    .filter(|member| name_of(&member.name) == "circle")
                    .find_map(|member| refuse_array(&member.value, &path.key("circle"))),
                ("materials" | "poses" | "robot", value) => refuse_array(value, &path),
                _ => None,
            }
        })
    }

    /// The first member that repeats a name of its object: the path and the bytes of its name.
    pub(super) fn duplicate_key(&self) -> Option<(JsonPath, Range<usize>)> {
        duplicate_in(&self.0, &JsonPath::root())
    }
}

fn refuse_array(value: &Value<'_>, path: &JsonPath) -> Option<(JsonPath, Range<usize>)> {
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

//! What can be wrong with an array or with where it stands.

use thiserror::Error;

use crate::scene::{PoseError, suggest};

/// An error in an array's data.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ArrayError {
    /// Not JSON, or not of an array's form.
    #[error("line {line}, column {column}: {field}: {message}")]
    Form {
        /// Line in the text, from 1.
        line: usize,
        /// Column in the line, from 1.
        column: usize,
        /// Which field, as far as it was understood.
        field: String,
        /// What is wrong.
        message: String,
    },
    /// A figure out of range.
    #[error("{field} is {value}: it must be from {least} to {most}")]
    Figure {
        /// Which field.
        field: String,
        /// What it holds.
        value: f64,
        /// Least that would be right.
        least: f64,
        /// Most that would be right.
        most: f64,
    },
    /// No ranger, or too many of them.
    #[error("{field} has {count} entries: it must have 1 to {most}")]
    Count {
        /// Which list.
        field: &'static str,
        /// How many entries it has.
        count: usize,
        /// Most that it may have.
        most: usize,
    },
    /// A ranger without a name.
    #[error("{field} is empty: every ranger needs a name")]
    NoId {
        /// Which field.
        field: String,
    },
    /// Two rangers with one name.
    #[error("{field} is \"{id}\", as rangers[{first}].id is: every ranger needs a name of its own")]
    SameId {
        /// The second one.
        field: String,
        /// Their name.
        id: String,
        /// Index of the first one.
        first: usize,
    },
    /// A name in the firing order that no ranger has.
    #[error("{field} is \"{id}\": no ranger has that id")]
    NoSuchRanger {
        /// Which field.
        field: String,
        /// The name.
        id: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// A turn in which nobody fires.
    #[error("{field} is an empty list: it must have the id of at least one ranger")]
    EmptyTurn {
        /// Which field.
        field: String,
    },
    /// A ranger that is to fire twice at once.
    #[error("{field} has \"{id}\" twice: a ranger fires once in a turn")]
    FiredTwice {
        /// Which field.
        field: String,
        /// The ranger's id.
        id: String,
    },
    /// No preset of that name.
    #[error("there is no array preset \"{name}\"")]
    UnknownPreset {
        /// What was asked for.
        name: String,
        /// Every preset's name.
        known: Vec<String>,
    },
}

impl ArrayError {
    pub(super) fn form(field: String, error: &serde_json::Error) -> Self {
        let message = error.to_string();
        // serde_json appends the place, which is reported apart.
        let message = message.split(" at line ").next().unwrap_or_default().to_owned();
        Self::Form { line: error.line(), column: error.column(), field, message }
    }

    /// What would be right.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Form { .. } => "start from a preset in the folder arrays/ of the source".into(),
            Self::Figure { .. }
            | Self::Count { .. }
            | Self::NoId { .. }
            | Self::SameId { .. }
            | Self::EmptyTurn { .. }
            | Self::FiredTwice { .. } => "correct that in the array's file".into(),
            Self::NoSuchRanger { id, known, .. } => suggest(id, known, "rangers"),
            Self::UnknownPreset { name, known } => suggest(name, known, "presets"),
        }
    }
}

/// An error in the pose of an array.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrayPoseError {
    /// The ranger that can't be there; `None` for the robot itself.
    pub ranger: Option<String>,
    /// What is in the way.
    pub error: PoseError,
}

impl std::fmt::Display for ArrayPoseError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.ranger {
            Some(id) => write!(f, "ranger {id} of the array: {}", self.error),
            None => self.error.fmt(f),
        }
    }
}

impl std::error::Error for ArrayPoseError {}

impl ArrayPoseError {
    /// What would be right.
    #[must_use]
    pub fn help(&self) -> String {
        match self.ranger {
            Some(_) => format!("move or turn the robot; {}", self.error.help()),
            None => self.error.help(),
        }
    }
}

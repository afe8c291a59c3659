//! Errors in an array's data or pose.

use thiserror::Error;

use crate::scene::{PoseError, suggest};

/// Error in an array's data.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ArrayError {
    /// Invalid JSON, or not an array's structure.
    #[error("line {line}, column {column}: {field}: {message}")]
    Malformed {
        /// Line in the text, from 1.
        line: usize,
        /// Column in the line, from 1.
        column: usize,
        /// Path of the field, as far as it was parsed.
        field: String,
        /// Description of the error.
        message: String,
    },
    /// Value out of range.
    #[error("{field} is {value}: it must be from {min} to {max}")]
    OutOfRange {
        /// Path of the field.
        field: String,
        /// Value outside the range.
        value: f64,
        /// Lower end of the allowed range.
        min: f64,
        /// Upper end of the allowed range.
        max: f64,
    },
    /// Empty list, or too many entries.
    #[error("{field} has {count} entries: it must have 1 to {max}")]
    Count {
        /// Name of the list.
        field: &'static str,
        /// Actual number of entries.
        count: usize,
        /// Maximum number of entries.
        max: usize,
    },
    /// Ranger without an id.
    #[error("{field} is empty: every ranger needs an id")]
    MissingId {
        /// Path of the field.
        field: String,
    },
    /// Two rangers with the same id.
    #[error("{field} is \"{id}\", the id of rangers[{first}]: every ranger needs a unique id")]
    DuplicateId {
        /// Path of the second id.
        field: String,
        /// Id that both rangers have.
        id: String,
        /// Index of the first ranger with the id.
        first: usize,
    },
    /// Id in the firing order that no ranger has.
    #[error("{field} is \"{id}\": no ranger has that id")]
    UnknownRanger {
        /// Path of the field.
        field: String,
        /// Id that no ranger has.
        id: String,
        /// Ids of the array's rangers.
        known: Vec<String>,
    },
    /// Empty list of simultaneous firings.
    #[error("{field} is an empty list: it must have the id of at least one ranger")]
    EmptySlot {
        /// Path of the field.
        field: String,
    },
    /// Ranger listed twice in one slot.
    #[error("{field} has \"{id}\" twice: a ranger fires once per slot")]
    FiredTwice {
        /// Path of the field.
        field: String,
        /// Id of the ranger.
        id: String,
    },
    /// Request of a preset that does not exist.
    #[error("there is no array preset \"{name}\"")]
    UnknownPreset {
        /// Name of the requested preset.
        name: String,
        /// Names of all presets.
        known: Vec<String>,
    },
}

impl ArrayError {
    pub(super) fn form(field: String, error: &serde_json::Error) -> Self {
        let message = error.to_string();
        // serde_json appends the position, which is reported separately.
        let message = message.split(" at line ").next().unwrap_or_default().to_owned();
        Self::Malformed { line: error.line(), column: error.column(), field, message }
    }

    /// Hint for correcting the error.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Malformed { .. } => {
                "start from a preset in the folder arrays/ of the source".into()
            }
            Self::OutOfRange { .. }
            | Self::Count { .. }
            | Self::MissingId { .. }
            | Self::DuplicateId { .. }
            | Self::EmptySlot { .. }
            | Self::FiredTwice { .. } => "correct it in the array's file".into(),
            Self::UnknownRanger { id, known, .. } => suggest(id, known, "rangers"),
            Self::UnknownPreset { name, known } => suggest(name, known, "presets"),
        }
    }
}

/// Error in the pose of an array.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrayPoseError {
    /// Ranger that does not fit; `None` for the robot itself.
    pub ranger: Option<String>,
    /// Obstruction of the pose.
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
    /// Hint for correcting the pose.
    #[must_use]
    pub fn help(&self) -> String {
        match self.ranger {
            Some(_) => format!("move or turn the robot; {}", self.error.help()),
            None => self.error.help(),
        }
    }
}

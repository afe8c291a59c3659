//! Why a request can't be answered.

use serde::Serialize;
use sonard_import::ImportError;
use sonard_model::{
    acoustics::{AirError, SensorError},
    model::{ModelError, TooCostly},
    plan::PlanError,
    scene::{PoseError, SceneError},
};

/// What is wrong, and what would be right.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refusal {
    /// What is wrong.
    pub message: String,
    /// What to do about it; empty where the message says it.
    pub help: String,
    /// Where in a scene's text, counted from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
}

impl Refusal {
    pub(crate) fn new(message: &(impl ToString + ?Sized), help: impl Into<String>) -> Self {
        Self { message: message.to_string(), help: help.into(), line: None }
    }
}

impl From<SceneError> for Refusal {
    fn from(error: SceneError) -> Self {
        Self { line: Some(error.line), ..Self::new(&error, error.help()) }
    }
}

impl From<PoseError> for Refusal {
    fn from(error: PoseError) -> Self {
        Self::new(&error, error.help())
    }
}

impl From<ImportError> for Refusal {
    fn from(error: ImportError) -> Self {
        Self::new(&error, error.help())
    }
}

impl From<TooCostly> for Refusal {
    fn from(error: TooCostly) -> Self {
        Self::new(&error, "listen less far, or take another engine")
    }
}

/// Those whose message says what would be right.
macro_rules! plain {
    ($($error:ty),*) => {
        $(impl From<$error> for Refusal {
            fn from(error: $error) -> Self {
                Self::new(&error, "")
            }
        })*
    };
}

plain!(AirError, SensorError, ModelError, PlanError, std::io::Error);

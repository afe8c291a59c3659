//! Errors of requests.

use serde::Serialize;
use sonard_model::{
    acoustics::{AirError, SensorError},
    model::{ModelError, TooCostly},
    scan_plan::PlanError,
    scene::{PoseError, SceneError},
};

/// Error response to a request.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RequestError {
    /// Cause of the error.
    pub message: String,
    /// Advice how to correct the request; empty if the message contains it.
    pub help: String,
    /// Line of the scene file, counted from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
}

impl RequestError {
    /// Creates an error with its advice.
    pub fn new(message: &(impl ToString + ?Sized), help: impl Into<String>) -> Self {
        Self { message: message.to_string(), help: help.into(), line: None }
    }
}

impl From<SceneError> for RequestError {
    fn from(error: SceneError) -> Self {
        Self { line: Some(error.line), ..Self::new(&error, error.help()) }
    }
}

impl From<PoseError> for RequestError {
    fn from(error: PoseError) -> Self {
        Self::new(&error, error.help())
    }
}

impl From<TooCostly> for RequestError {
    fn from(error: TooCostly) -> Self {
        Self::new(&error, "reduce the maximum range, or choose another engine")
    }
}

/// Conversions of errors whose messages contain the advice.
macro_rules! without_help {
    ($($error:ty),*) => {
        $(impl From<$error> for RequestError {
            fn from(error: $error) -> Self {
                Self::new(&error, "")
            }
        })*
    };
}

without_help!(AirError, SensorError, ModelError, PlanError, std::io::Error);

//! Errors of rejected orders.

use thiserror::Error;

/// Rejection of an order, with its reason and a hint.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct OrderError {
    /// Category of the rejection.
    pub kind: OrderErrorKind,
    /// Description of the problem.
    pub message: String,
    /// Hint for the correction.
    pub help: String,
    /// Setting at fault, such as `sensor.blanking_us` or `pose`, if it is a single one.
    pub field: Option<String>,
}

impl OrderError {
    /// Rejection without a setting at fault.
    #[must_use]
    pub fn new(kind: OrderErrorKind, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { kind, message: message.into(), help: help.into(), field: None }
    }

    /// Rejection for the value of a setting.
    #[must_use]
    pub fn at(self, field: impl Into<String>) -> Self {
        Self { field: Some(field.into()), ..self }
    }
}

/// Category of a rejection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrderErrorKind {
    /// The order is invalid at any time.
    Invalid,
    /// The order conflicts with the current state: scene, motor, queued requests.
    Conflict,
    /// The order refers to an object that does not exist, or no longer exists.
    NotFound,
    /// The daemon is stopping.
    Stopping,
}

//! Errors of rejected orders.

use thiserror::Error;

/// Rejection of an order, with its reason and a hint.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct Refusal {
    /// Category of the rejection.
    pub kind: RefusalKind,
    /// Description of the problem.
    pub message: String,
    /// Hint for the correction.
    pub help: String,
    /// Setting at fault, such as `sensor.blanking_us` or `pose`, if it is a single one.
    pub field: Option<String>,
}

impl Refusal {
    /// Rejection without a setting at fault.
    #[must_use]
    pub fn new(kind: RefusalKind, message: impl Into<String>, help: impl Into<String>) -> Self {
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
pub enum RefusalKind {
    /// The order is invalid at any time.
    Wrong,
    /// The order conflicts with the current state: scene, motor, queued requests.
    Conflict,
    /// The order refers to an object that does not exist, or no longer exists.
    Unknown,
    /// The daemon is stopping.
    Stopping,
}

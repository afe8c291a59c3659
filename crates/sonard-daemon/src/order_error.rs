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

//! Orders that are refused.

use thiserror::Error;

/// The reason why an order is refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct Refusal {
    /// Whether it is wrong at all times.
    pub kind: RefusalKind,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: String,
}

/// The kind of a refusal: wrong at all times, or now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RefusalKind {
    /// It is wrong in itself.
    Wrong,
    /// It does not go together with what is in force: scene, motor, requests that wait.
    Conflict,
    /// It is about something that there is not, or no more.
    Unknown,
    /// The daemon is stopping.
    Stopping,
}

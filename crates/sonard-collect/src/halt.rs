//! Why a collection does not go on.

use sonard_api::client::{ClientError, ScansError};
use sonard_device::ranger::{PrepareError, ScanError};
use sonard_log::StoreError;
use sonard_records::SinkError;
use thiserror::Error;

use super::FolderError;

/// The reason why a collection stopped, and the remedy.
#[derive(Debug, Error)]
pub enum Halt {
    /// Somebody wanted it so, or the plan did.
    #[error("{0}")]
    Stopped(String),
    /// What was asked for can't be done.
    #[error("{message}")]
    Wrong {
        /// What is wrong.
        message: String,
        /// What would be right.
        help: String,
    },
    /// The ranger, the line to it or a disk gave up.
    #[error("{message}")]
    Failed {
        /// What happened.
        message: String,
        /// What to do.
        help: String,
    },
}

impl Halt {
    /// What was asked for can't be done.
    pub fn wrong(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self::Wrong { message: message.to_string(), help: help.to_string() }
    }

    /// The ranger, the line to it or a disk gave up.
    pub fn failed(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self::Failed { message: message.to_string(), help: help.to_string() }
    }

    /// A signal.
    #[must_use]
    pub fn on_request() -> Self {
        Self::Stopped("stopped on request".into())
    }
}

impl From<FolderError> for Halt {
    fn from(error: FolderError) -> Self {
        Self::failed(&error, error.help())
    }
}

impl From<StoreError> for Halt {
    fn from(error: StoreError) -> Self {
        Self::failed(&error, error.help())
    }
}

impl From<SinkError> for Halt {
    fn from(error: SinkError) -> Self {
        Self::failed(&error, error.help())
    }
}

impl From<ClientError> for Halt {
    fn from(error: ClientError) -> Self {
        Self::failed(&error, error.help())
    }
}

impl From<ScansError> for Halt {
    fn from(error: ScansError) -> Self {
        match error {
            ScansError::Forgotten(_) => Self::Stopped(error.to_string()),
            other => Self::failed(&other, other.help()),
        }
    }
}

impl From<PrepareError> for Halt {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::Deaf(deaf) => Self::wrong(deaf, deaf.help()),
            PrepareError::Model(error) => {
                Self::wrong(error, "correct [sensor] of the plan, or the sensor's data")
            }
        }
    }
}

impl From<ScanError> for Halt {
    fn from(error: ScanError) -> Self {
        match error {
            ScanError::Plan(error) => {
                Self::wrong(error, "give plan.from_deg and plan.step_deg on the motor's steps")
            }
            ScanError::Device(error) => Self::failed(error, error.help()),
            ScanError::Sink(error) => error.into(),
        }
    }
}

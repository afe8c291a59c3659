//! Reasons for which a collection ends before its last scan.

use sonard_api::client::{ClientError, ScansError};
use sonard_device::ranger::{PrepareError, ScanError};
use sonard_log::StoreError;
use sonard_records::SinkError;
use thiserror::Error;

use super::FolderError;

/// Remedy for a scan plan whose azimuths are not multiples of the motor step.
pub(super) const MOTOR_STEP_HELP: &str =
    "give plan.from_deg and plan.step_deg on the motor's steps";

/// Reason for which a collection stopped, with its remedy.
#[derive(Debug, Error)]
pub enum CollectError {
    /// Stopped by the operator or by a rule of the plan.
    #[error("{0}")]
    Stopped(String),
    /// Request that cannot be carried out.
    #[error("{message}")]
    Invalid {
        /// Description of the fault.
        message: String,
        /// Suggested correction for the user.
        help: String,
    },
    /// Failure of the ranger, its serial link or a disk.
    #[error("{message}")]
    Failed {
        /// Description of the failure.
        message: String,
        /// Suggested remedy for the user.
        help: String,
    },
}

impl CollectError {
    /// Creates the error of a request that cannot be carried out.
    pub fn invalid(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self::Invalid { message: message.to_string(), help: help.to_string() }
    }

    /// Creates the error of a failed ranger, serial link or disk.
    pub fn failed(message: impl std::fmt::Display, help: impl std::fmt::Display) -> Self {
        Self::Failed { message: message.to_string(), help: help.to_string() }
    }

    /// Creates the error of a collection stopped by a signal.
    #[must_use]
    pub fn interrupted() -> Self {
        Self::Stopped("stopped on request".into())
    }
}

impl From<FolderError> for CollectError {
    fn from(error: FolderError) -> Self {
        Self::failed(&error, error.help())
    }
}

impl From<StoreError> for CollectError {
    fn from(error: StoreError) -> Self {
        Self::failed(&error, error.help())
    }
}

impl From<SinkError> for CollectError {
    fn from(error: SinkError) -> Self {
        Self::failed(&error, error.help())
    }
}

impl From<ClientError> for CollectError {
    fn from(error: ClientError) -> Self {
        Self::failed(&error, error.help())
    }
}

impl From<ScansError> for CollectError {
    fn from(error: ScansError) -> Self {
        match error {
            ScansError::Cancelled(_) => Self::Stopped(error.to_string()),
            other => Self::failed(&other, other.help()),
        }
    }
}

impl From<PrepareError> for CollectError {
    fn from(error: PrepareError) -> Self {
        match error {
            PrepareError::WindowTooShort(error) => Self::invalid(error, error.help()),
            PrepareError::Model(error) => {
                Self::invalid(error, "correct [sensor] in the plan, or the sensor's data")
            }
        }
    }
}

impl From<ScanError> for CollectError {
    fn from(error: ScanError) -> Self {
        match error {
            ScanError::Plan(error) => Self::invalid(error, MOTOR_STEP_HELP),
            ScanError::Device(error) => Self::failed(error, error.help()),
            ScanError::Sink(error) => error.into(),
        }
    }
}

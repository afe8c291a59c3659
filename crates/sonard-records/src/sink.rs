//! Output of records during a scan.

use std::{error::Error, io};

use thiserror::Error;

use crate::Record;

/// Consumer of records as they are produced: a log, a live stream, a buffer.
pub trait Sink: Send {
    /// Stores or forwards a record.
    ///
    /// # Errors
    /// If the record cannot be stored.
    fn record(&mut self, record: &Record) -> Result<(), SinkError>;
}

/// Error of a record that could not be stored.
#[derive(Debug, Error)]
#[error("{cause}")]
pub struct SinkError {
    cause: Box<dyn Error + Send + Sync>,
    help: String,
}

impl SinkError {
    /// Creates an error from its cause and a hint for the user.
    pub fn new(cause: impl Into<Box<dyn Error + Send + Sync>>, help: impl Into<String>) -> Self {
        Self { cause: cause.into(), help: help.into() }
    }

    /// Hint for the user.
    #[must_use]
    pub fn help(&self) -> &str {
        &self.help
    }

    /// Returns `true` if the reader of a pipe closed it, which is no failure of the writer.
    #[must_use]
    pub fn is_broken_pipe(&self) -> bool {
        let mut cause: Option<&(dyn Error + 'static)> = Some(&*self.cause);
        while let Some(error) = cause {
            if error
                .downcast_ref::<io::Error>()
                .is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
            {
                return true;
            }
            cause = error.source();
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Error)]
    #[error("cannot write")]
    struct Outer(#[source] io::Error);

    #[test]
    fn finds_nested_broken_pipe() {
        let nested = |kind: io::ErrorKind| SinkError::new(Outer(kind.into()), "");
        assert!(nested(io::ErrorKind::BrokenPipe).is_broken_pipe());
        assert!(!nested(io::ErrorKind::StorageFull).is_broken_pipe());
    }
}

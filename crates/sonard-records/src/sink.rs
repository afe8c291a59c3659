//! Where records go while a scan is taken.

use std::{error::Error, io};

use thiserror::Error;

use crate::Record;

/// Takes records as they are made: a log, a live stream, a memory.
pub trait Sink: Send {
    /// Takes a record in.
    ///
    /// # Errors
    /// When it can't be kept.
    fn record(&mut self, record: &Record) -> Result<(), SinkError>;
}

/// A record could not be stored.
#[derive(Debug, Error)]
#[error("{cause}")]
pub struct SinkError {
    cause: Box<dyn Error + Send + Sync>,
    help: String,
}

impl SinkError {
    /// What went wrong, and what a person can do about it.
    pub fn new(cause: impl Into<Box<dyn Error + Send + Sync>>, help: impl Into<String>) -> Self {
        Self { cause: cause.into(), help: help.into() }
    }

    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> &str {
        &self.help
    }

    /// Whether the reader of a pipe went away, which is no failure of whoever writes.
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
    fn a_reader_that_left_is_found_behind_other_causes() {
        let behind = |kind: io::ErrorKind| SinkError::new(Outer(kind.into()), "");
        assert!(behind(io::ErrorKind::BrokenPipe).is_broken_pipe());
        assert!(!behind(io::ErrorKind::StorageFull).is_broken_pipe());
    }
}

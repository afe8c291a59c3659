//! Recordings of ROS 2 where they can't be read.

use std::{
    io::{self, Read},
    iter,
};

use sonard_model::array::RangerArray;
use sonard_records::Record;

use crate::{
    ImportError, Mapping, Taken,
    doubt::{Ranges, Ways},
};

/// How every such file begins.
pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Stands for the recording, of which there is none.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bag {
    pub(crate) has_poses: bool,
}

impl Bag {
    /// # Errors
    /// Always.
    pub(crate) fn look(
        _open: &dyn Fn() -> io::Result<Box<dyn Read>>,
        _mapping: &Mapping,
        _taken: &Taken,
    ) -> Result<Self, ImportError> {
        Err(ImportError::mapping(
            "recordings can't be read here",
            "`sonard import` makes a log of them",
        ))
    }

    pub(crate) const fn array(&self, _sensor: &str) -> Option<RangerArray> {
        None
    }

    pub(crate) fn examine(
        &self,
        _open: &dyn Fn() -> io::Result<Box<dyn Read>>,
        _ways: (&Ways, &Taken),
        _ranges: &mut Ranges,
    ) -> Result<Vec<String>, ImportError> {
        Ok(Vec::new())
    }

    pub(crate) fn scans(
        &self,
        _source: impl Read,
        _mapping: &Mapping,
        _taken: &Taken,
    ) -> Result<iter::Empty<Result<Vec<Record>, ImportError>>, ImportError> {
        Ok(iter::empty())
    }
}

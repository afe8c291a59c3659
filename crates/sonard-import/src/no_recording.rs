//! Replacement of the recording reader in builds without the feature `recordings`.

use std::{
    io::{self, Read},
    iter,
};

use sonard_model::array::RangerArray;
use sonard_records::Record;

use crate::{
    Assumptions, ImportError, Mapping,
    unit_check::{RangeStats, UnitContext},
};

/// Magic bytes of an MCAP file.
pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Placeholder that is never constructed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bag {
    pub(crate) has_poses: bool,
}

impl Bag {
    /// Rejects every recording.
    pub(crate) fn survey(
        _open: &dyn Fn() -> io::Result<Box<dyn Read>>,
        _mapping: &Mapping,
        _taken: &Assumptions,
    ) -> Result<Self, ImportError> {
        Err(ImportError::mapping(
            "this build cannot read recordings",
            "convert it to a log with `sonard import`",
        ))
    }

    pub(crate) const fn array(&self, _sensor: &str) -> Option<RangerArray> {
        None
    }

    pub(crate) fn examine(
        &self,
        _open: &dyn Fn() -> io::Result<Box<dyn Read>>,
        _units: (&UnitContext, &Assumptions),
        _ranges: &mut RangeStats,
    ) -> Result<Vec<String>, ImportError> {
        Ok(Vec::new())
    }

    pub(crate) fn scans(
        &self,
        _source: impl Read,
        _mapping: &Mapping,
        _taken: &Assumptions,
    ) -> Result<iter::Empty<Result<Vec<Record>, ImportError>>, ImportError> {
        Ok(iter::empty())
    }
}

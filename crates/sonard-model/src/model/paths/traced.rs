//! The rays and connections that a search keeps, from which paths are told.

use super::{
    cylinders::Connection,
    diffraction::{double::DoubleDiffraction, level::LevelDiffraction},
    rays::Rays,
    scattering::Patch,
};
use crate::geometry::DVec2;

/// The rays of an observation point, or of transmitter and receiver, and what mechanisms made of them. The variants of
/// [`Via`](super::echo::Via) number its parts.
#[derive(Debug)]
pub(super) struct Traced {
    /// Transmitter and receiver.
    pub(super) ends: [DVec2; 2],
    /// From the transmitter.
    pub(super) out: Rays,
    /// From the receiver, if it is somewhere else.
    pub(super) back: Option<Rays>,
    pub(super) connections: Vec<Connection>,
    pub(super) patches: Vec<Patch>,
    pub(super) double: Vec<DoubleDiffraction>,
    pub(super) level: Vec<LevelDiffraction>,
}

impl Traced {
    /// From the receiver.
    pub(super) fn back(&self) -> &Rays {
        self.back.as_ref().unwrap_or(&self.out)
    }
}

//! Rays and connections that a search keeps, from which paths are reconstructed.

use super::{
    cylinders::MiddleContact,
    diffraction::{double::DoubleDiffraction, level::LevelDiffraction},
    echo::PathEcho,
    height::VerticalImage,
    rays::Rays,
    scattering::Patch,
};
use crate::geometry::DVec2;

/// Rays of an observation point, or of transmitter and receiver, and the records of the mechanisms.
/// The variants of [`Via`](super::echo::Via) number its parts.
#[derive(Debug)]
pub(super) struct Traced {
    /// Positions of transmitter and receiver (world, metres).
    pub(super) ends: [DVec2; 2],
    /// Rays from the transmitter.
    pub(super) out: Rays,
    /// Rays from the receiver, if it is at a different point.
    pub(super) back: Option<Rays>,
    pub(super) connections: Vec<MiddleContact>,
    pub(super) patches: Vec<Patch>,
    pub(super) double: Vec<DoubleDiffraction>,
    pub(super) level: Vec<LevelDiffraction>,
}

impl Traced {
    /// Returns `true` if the slopes of an echo's rays admit an image by floor and ceiling. Seen
    /// from its end a path falls as it climbed, except for an odd number of reflections at floor
    /// and ceiling.
    pub(super) fn can_climb(&self, echo: &PathEcho, image: &VerticalImage) -> bool {
        let climb_m = image.rise_m;
        let back_m = if image.bounces.is_multiple_of(2) { -climb_m } else { climb_m };
        let [out, back] = [&self.out, self.back()].map(|rays| &rays.beams.slopes);
        out.holds(echo.slopes[0], climb_m, echo.length_m)
            && back.holds(echo.slopes[1], back_m, echo.length_m)
    }

    /// Rays from the receiver.
    pub(super) fn back(&self) -> &Rays {
        self.back.as_ref().unwrap_or(&self.out)
    }
}

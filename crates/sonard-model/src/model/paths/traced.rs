//! The rays and connections that a search keeps, from which paths are told.

use super::{
    cylinders::Connection,
    diffraction::{double::DoubleDiffraction, level::LevelDiffraction},
    echo::Echo,
    height::VerticalImage,
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
    /// Whether an echo of the plan can run by way of an image, as far as the slopes of its rays tell. Seen from its
    /// end it falls as it climbed, but for an odd number of reflections at floor and ceiling.
    pub(super) fn can_climb(&self, echo: &Echo, image: &VerticalImage) -> bool {
        let climb_m = image.rise_m;
        let back_m = if image.bounces.is_multiple_of(2) { -climb_m } else { climb_m };
        let [out, back] = [&self.out, self.back()].map(|rays| &rays.beams.slopes);
        out.holds(echo.slopes[0], climb_m, echo.length_m)
            && back.holds(echo.slopes[1], back_m, echo.length_m)
    }

    /// From the receiver.
    pub(super) fn back(&self) -> &Rays {
        self.back.as_ref().unwrap_or(&self.out)
    }
}

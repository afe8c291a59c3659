//! Surfaces that beams illuminate.

use super::beam::RayBeam;
use crate::model::paths::floor::AngleSpan;

/// A beam, all of which hits one cylinder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LitCylinder {
    pub(crate) cylinder: u32,
    /// Illuminated part of the surface, radians.
    pub(crate) span: AngleSpan,
    pub(crate) beam: RayBeam,
}

/// A beam that hits a wall, and the part of the wall that it illuminates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LitWall {
    pub(crate) beam: RayBeam,
    pub(crate) wall: u32,
    /// Interval along the wall's line, metres.
    pub(crate) span_m: [f64; 2],
}

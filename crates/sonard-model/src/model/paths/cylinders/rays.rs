//! Stored rays by way of cylinders.

use smallvec::SmallVec;

use crate::model::{
    Reflector,
    paths::beams::{RayLeg, UnfoldedRay},
};

/// Link of a tube that has touched its first cylinder only.
pub(crate) const FIRST: u32 = u32::MAX;

/// Rays from one start by way of cylinders.
#[derive(Debug, Default)]
pub(crate) struct CylinderRays {
    /// Surfaces of tubes after their first cylinders, as linked lists from the last one back.
    pub(crate) links: Vec<SurfaceLink>,
    /// Rays that end at an edge or at the cylinder in the middle of an echo path.
    pub(crate) rays: Vec<CylinderRay>,
    /// The subset of `rays` that ends at edges.
    pub(crate) to_edges: Vec<SpreadRay>,
}

/// Surfaces in the order in which a ray hits them, after its first cylinder.
pub(crate) type Surfaces = SmallVec<[Reflector; 8]>;

/// A surface that tubes hit after their first cylinder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceLink {
    pub(crate) surface: Reflector,
    pub(crate) before: u32,
}

/// A ray by way of cylinders, identified by its contact with the first one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CylinderRay {
    /// Initial beam, in [`Beams::to_cylinders`](crate::model::paths::beams::Beams::to_cylinders).
    pub(crate) view: u32,
    /// Last of the surfaces after the first cylinder, in [`CylinderRays::links`].
    pub(crate) link: u32,
    /// Angle of the first contact around the cylinder's centre, radians.
    pub(crate) contact_rad: f64,
}

/// A ray to an edge by way of a cylinder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpreadRay {
    pub(crate) point: u32,
    /// The ray: `run` is the last leg's direction times the whole length; `node` is the index in
    /// [`CylinderRays::rays`].
    pub(crate) ray: UnfoldedRay,
    pub(crate) width_m: f64,
    /// Radius of curvature of the wave front, metres.
    pub(crate) radius_m: f64,
}

/// A ray from the start: over walls alone, or by way of cylinders.
#[derive(Debug, Clone, Copy)]
pub(crate) enum OneWay {
    Walls(RayLeg),
    /// Index in [`CylinderRays::rays`].
    Cylinders(u32),
}

/// Returns the surfaces up to a link, in the order in which a ray hits them.
pub(crate) fn surfaces_to(links: &[SurfaceLink], mut link: u32) -> Surfaces {
    let mut surfaces = Surfaces::new();
    while let Some(hit) = links.get(link as usize) {
        surfaces.push(hit.surface);
        link = hit.before;
    }
    surfaces.reverse();
    surfaces
}

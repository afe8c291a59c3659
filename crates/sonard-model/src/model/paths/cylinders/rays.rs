//! Rays by way of cylinders, as they are kept.

use smallvec::SmallVec;

use crate::model::{
    Reflector,
    paths::beams::{Leg, Ray},
};

/// Marks a tube that has met its first cylinder only.
pub(crate) const FIRST: u32 = u32::MAX;

/// Rays from one start by way of cylinders.
#[derive(Debug, Default)]
pub(crate) struct CylinderRays {
    /// Surfaces that tubes have met after their first cylinders, as linked lists from the last one back.
    pub(crate) links: Vec<Link>,
    /// Rays that end at an edge or at the cylinder in the middle of an echo path.
    pub(crate) rays: Vec<CylinderRay>,
    /// Of these, the ones to edges.
    pub(crate) to_edges: Vec<SpreadRay>,
}

/// Surfaces in the order in which a ray meets them, after its first cylinder.
pub(crate) type Surfaces = SmallVec<[Reflector; 8]>;

/// A surface that tubes have met after their first cylinder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Link {
    pub(crate) surface: Reflector,
    pub(crate) before: u32,
}

/// A ray that met a cylinder, by where it met the first one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CylinderRay {
    /// The beam before, in [`Beams::to_cylinders`](crate::model::paths::beams::Beams::to_cylinders).
    pub(crate) view: u32,
    /// Last of the surfaces after, in [`CylinderRays::links`].
    pub(crate) link: u32,
    /// Angle of the first contact around the cylinder's centre, radians.
    pub(crate) contact_rad: f64,
}

/// A ray to an edge by way of a cylinder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpreadRay {
    pub(crate) point: u32,
    /// `run` is the last leg's direction times the whole length; `node` says which of
    /// [`CylinderRays::rays`] it is.
    pub(crate) ray: Ray,
    pub(crate) width_m: f64,
    /// Radius of curvature of the wave front, metres.
    pub(crate) radius_m: f64,
}

/// A ray from the start: over walls alone, or by way of cylinders.
#[derive(Debug, Clone, Copy)]
pub(crate) enum OneWay {
    Walls(Leg),
    /// By its index in [`CylinderRays::rays`].
    Cylinders(u32),
}

/// The surfaces up to a link, in the order in which they are met.
pub(crate) fn surfaces_to(links: &[Link], mut link: u32) -> Surfaces {
    let mut surfaces = Surfaces::new();
    while let Some(met) = links.get(link as usize) {
        surfaces.push(met.surface);
        link = met.before;
    }
    surfaces.reverse();
    surfaces
}

//! Beams (all rays from an image of the start that were reflected by the same walls) and their
//! tree.
//!
//! A beam walks the mesh from triangle to triangle. At the far corner of a triangle it splits in
//! two, at a wall it continues from the next image. The tree keeps a beam or ray that ends at the
//! receiver, at an edge, at a cylinder or on a wall that other mechanisms use.

mod beam;
mod grow;
mod lit;
mod shade;
mod slopes;
mod tree;

pub(crate) use beam::{RayBeam, RayLeg, UnfoldedRay};
pub(crate) use lit::{LitCylinder, LitWall};
pub(crate) use tree::Beams;

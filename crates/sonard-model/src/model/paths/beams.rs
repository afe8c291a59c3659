//! Beams: all rays from an image of the start that met the same walls, and the tree of them.
//!
//! A beam walks the mesh from triangle to triangle. At the far corner of a triangle it splits in two, at a
//! wall it becomes a beam from the next image, and where it ends at the receiver, at an edge, at a cylinder
//! or on a wall that other mechanisms ask about, the tree keeps it.

mod beam;
mod grow;
mod lit;
mod shade;
mod slopes;
mod tree;

pub(crate) use beam::{Beam, Leg, Ray};
pub(crate) use lit::{LitSpan, View};
pub(crate) use tree::Beams;

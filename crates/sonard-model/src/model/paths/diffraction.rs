//! Diffraction at edges.
//!
//! Sound is diffracted by free ends of walls and by corners other than `pi / m`. By reciprocity the
//! paths back from an edge are the paths to it. The one-way rays to each edge therefore give all
//! echoes with one diffraction and any reflections before and after: every ray out with every ray
//! back ([`single`]). On request rays are also followed from one upright edge to another
//! ([`double`]). Walls that end below the ceiling or above the floor have level edges ([`level`]).
//! The strength is that of [`crate::acoustics::edge`].

pub(super) mod double;
mod edge_ray;
mod edge_to_edge;
pub(super) mod level;
pub(super) mod single;

pub(super) use edge_to_edge::EdgeToEdge;

//! Surfaces that beams light.

use super::beam::Beam;
use crate::model::paths::plan::Span;

/// A beam that meets a cylinder, all of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    pub(crate) cylinder: u32,
    /// The part of the surface that it lights, radians.
    pub(crate) span: Span,
    pub(crate) beam: Beam,
}

/// A beam that meets a wall, and the part of the wall that it lights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LitSpan {
    pub(crate) beam: Beam,
    pub(crate) wall: u32,
    /// From and to where along the wall's line, metres.
    pub(crate) span_m: [f64; 2],
}

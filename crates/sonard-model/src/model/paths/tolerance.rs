//! Tolerances: what counts as the same.

/// Rays this close to a corner pass through it, metres: on either side of it and over it. Above
/// rounding (1e-14 over tens of metres), below anything that sound could tell.
pub(crate) const TIE_M: f64 = 1e-9;

/// Echoes that agree in length and both directions to within this are one, metres and radians.
pub(crate) const SAME_M: f64 = 1e-8;
pub(crate) const SAME_RAD: f64 = 1e-9;

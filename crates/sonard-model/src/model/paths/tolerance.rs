//! Tolerances within which values count as equal.

/// Distance, metres, within which a ray passes through a corner: on either side of it and over it.
/// Larger than rounding errors (1e-14 over tens of metres), smaller than anything that sound could
/// resolve.
pub(crate) const TIE_M: f64 = 1e-9;

/// Echoes that agree in length and both directions to within this are one, metres and radians.
pub(crate) const SAME_M: f64 = 1e-8;
pub(crate) const SAME_RAD: f64 = 1e-9;

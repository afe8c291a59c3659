//! Heights: paths added by floor and ceiling, and paths removed by walls and cylinders that end
//! above or below.
//!
//! All walls are upright, so a path's shape in the plan and its heights are independent of each
//! other.

mod clearance;
mod images;
mod limits;

pub(crate) use clearance::PathEnds;
pub(crate) use images::VerticalImage;
pub(crate) use limits::Heights;

//! Heights: what floor and ceiling add to the paths of the plan, and what walls and cylinders that end
//! below or above take away.
//!
//! All walls are upright, so a path's shape in the plan and its heights do not depend on each other.

mod clearance;
mod images;
mod limits;

pub(crate) use clearance::Ends;
pub(crate) use images::VerticalImage;
pub(crate) use limits::Heights;

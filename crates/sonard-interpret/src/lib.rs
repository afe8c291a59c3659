//! What scans say: [`compare`] sets readings beside predictions, [`interpret`] finds planes, corners and
//! edges and makes maps, [`explore`] lets a robot map a scene.
//!
//! Nothing here knows a clock, a file or a socket; random numbers are passed in.

pub mod compare;
pub mod explore;
pub mod interpret;

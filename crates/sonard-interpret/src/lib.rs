//! What scans say: [`compare`] sets readings beside predictions, [`interpret`] finds planes, corners and
//! edges and makes maps, [`explore`] lets a robot map a scene.
//!
//! Nothing here knows a clock, a file or a socket; random numbers are passed in.

// Modules are `foo.rs` beside `foo/`.
#![warn(clippy::mod_module_files)]

pub mod compare;
pub mod explore;
pub mod interpret;

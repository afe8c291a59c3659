//! Interpretation of scans: [`compare`] compares readings with predictions, [`interpret`] finds planes, corners and
//! edges and makes maps.
//!
//! The crate uses no clock, file or socket; random numbers are passed in.

// Modules are `foo.rs` beside `foo/`.
#![warn(clippy::mod_module_files)]

pub mod compare;
pub mod interpret;

//! Interpretation of scans: [`compare`] compares readings with predictions, [`interpret`]
//! classifies planes, corners and edges and builds maps.
//!
//! The crate uses no clock, file or socket; random numbers are passed in.

// Modules are `foo.rs` next to `foo/`.
#![warn(clippy::mod_module_files)]

pub mod compare;
pub mod interpret;

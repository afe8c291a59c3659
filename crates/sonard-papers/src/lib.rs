//! Experiments of the papers on sonar mapping and exploration, in simulated rooms.
//!
//! - [`trial`]: courses through shipped and random rooms, mapped without and with Feature
//!   Prediction (O'Sullivan and
//!   others);
//! - [`calibration`]: calibration of the probabilities of planes, corners and edges (Bozma and
//!   Kuc);
//! - [`explore`]: a simulated robot that maps a room with sonar, laser, or just-in-time sensing
//!   (Dudek, Freedman and
//!   Rekleitis), or by the next views of surveys;
//! - [`pictures`]: explorations and reliability diagrams.
//!
//! The program `sonard-papers` runs them and prints the tables of the documentation. Programs that
//! interpret scans need `sonard-interpret` instead. The library uses no clock, file or socket;
//! random numbers are passed in.

// Modules are `foo.rs` next to `foo/`.
#![warn(clippy::mod_module_files)]

pub mod calibration;
pub mod explore;
pub mod pictures;
pub mod trial;

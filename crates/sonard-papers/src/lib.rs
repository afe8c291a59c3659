//! Experiments of the papers on sonar mapping and exploration, on rooms simulated by the model.
//!
//! - [`trial`]: courses through shipped and random rooms, mapped without and with Feature Prediction (O'Sullivan and
//!   others);
//! - [`calibration`]: how often the probabilities of planes, corners and edges (Bozma and Kuc) come true;
//! - [`explore`]: a simulated robot that maps a room with sonar, laser, or a laser aimed just in time (Dudek, Freedman and
//!   Rekleitis);
//! - [`pictures`]: explorations and reliability diagrams.
//!
//! The program `sonard-papers` runs them and prints the tables of the documentation. Programs that interpret scans need
//! `sonard-interpret` instead. The library uses no clock, file or socket; random numbers are passed in.

// Modules are `foo.rs` beside `foo/`.
#![warn(clippy::mod_module_files)]

pub mod calibration;
pub mod explore;
pub mod pictures;
pub mod trial;

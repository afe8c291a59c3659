//! Physical model of an ultrasonic ranger on a stepper, or of several rangers on a robot.
//!
//! From a [`scene`] (walls and cylinders with materials) and the [`acoustics`] of air, transducer
//! and receiver, a [`model`] predicts the reading at each azimuth of a [`scan_plan`]. An
//! [`array`](mod@array) has several rangers at fixed bearings instead of one that rotates.
//!
//! A room in ten lines:
//!
//! ```
//! use sonard_model::{acoustics::*, geometry::Pose, model::*, scan_plan::ScanPlan, scene::Scene};
//!
//! let room = Scene::builder("room")
//!     .material("plaster", 0.97)
//!     .room("wall", &[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]], "plaster")
//!     .build()?;
//! let sensor = Sensor::preset("senscomp-6500")?;
//! let simulator = Simulator::new(room.into(), sensor, Air::default(), Options::default())?;
//! let pose = Pose { x_m: 1.0, y_m: 1.0, heading_deg: 0.0 };
//! let readings = simulator.predict(&pose, &ScanPlan::default())?;
//! // The wall ahead is 3 m away; the echo crosses the threshold a little late.
//! let range_m = readings[0].range_m.ok_or("no echo")?;
//! assert!((3.0..3.005).contains(&range_m));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The crate uses no clock, file or socket; the caller passes in random numbers.

// Modules are `foo.rs` next to `foo/`.
#![warn(clippy::mod_module_files)]

pub mod acoustics;
pub mod array;
pub mod geometry;
pub mod model;
pub mod motion;
pub mod reading;
pub mod scan_plan;
pub mod scene;
pub mod viewpoint;

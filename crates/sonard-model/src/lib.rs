//! Physical model of an ultrasonic ranger on a stepper, or of several on a robot.
//!
//! A [`scene`] (walls and cylinders of some material) and the [`acoustics`] of air, transducer and receiver
//! go into a [`model`], which predicts what the ranger reads at each azimuth of a [`plan`]. An
//! [`array`](mod@array) is several rangers at fixed bearings in place of one that turns.
//!
//! Nothing here knows a clock, a file or a socket; random numbers are passed in.

pub mod acoustics;
pub mod array;
pub mod geometry;
pub mod model;
pub mod motion;
pub mod plan;
pub mod reading;
pub mod scene;
pub mod viewpoint;

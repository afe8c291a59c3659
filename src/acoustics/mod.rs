//! The physics of the sound: air, transducer, pulse and receiver.

pub mod edge;
mod sensor;

pub use sensor::{Aperture, Pulse, Sensor};

//! The physics of the sound: air, transducer, pulse and receiver.

mod sensor;

pub use sensor::{Aperture, Pulse, Sensor};

//! The physics of the sound: air, transducer, pulse and receiver.

mod air;
pub mod edge;
mod face;
mod receiver;
mod sensor;
mod transducer;

pub use air::{Air, AirError};
pub use face::{Disc, Face, FaceAspect};
pub use receiver::{Detection, Receiver, Sound, classify_tof};
pub use sensor::{Aperture, Mounting, Pulse, Sensor, SensorError};
pub use transducer::{BeamPattern, kuc_siegel_response, piston_directivity};

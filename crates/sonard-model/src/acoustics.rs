//! Physics of the sound: air, transducer, pulse and receiver.

mod air;
mod aperture;
pub mod edge;
mod face;
mod pulse;
mod receiver;
mod sensor;
mod tof_noise;
mod transducer;

pub use air::{Air, AirError};
pub use aperture::{ApertureResponse, Image, Incidence};
pub use face::{Disc, Face, FaceAspect};
pub use pulse::EchoShape;
pub use receiver::{
    Combining, Detection, DetectorBank, EchoRise, EchoTrace, EnvelopePeak, Incident, Latch,
    PulseArrival, Receiver, ReceiverNoise, TracePoint, classify_tof,
};
pub use sensor::{
    Aperture, BeamPoint, ChirpPart, Detector, EdgeLawKind, Gain, GainStep, Mounting, Pulse,
    Response, Sensor, SensorError,
};
pub use tof_noise::TofNoise;
pub use transducer::{BeamPattern, kuc_siegel_response, piston_directivity};

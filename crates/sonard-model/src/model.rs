//! The model: what a ranger at some observation point reads in some direction.
//!
//! An [`Engine`] finds the echoes that arrive at the transducer's face; the receiver decides which
//! of them is detected. [`Simulator`] joins the two.

mod array;
mod batch;
mod cone;
mod cost;
mod crosstalk;
mod engine;
mod fan;
mod image_sources;
mod lazy;
mod names;
mod observation;
mod options;
mod path;
pub mod paths;
mod prediction;
pub mod raycast;
mod simulator;
#[cfg(test)]
mod tests;

pub use array::{ArrayAtPose, ArrayModel};
pub use cone::Cone;
pub use cost::{SearchPart, TooCostly};
pub use engine::{Arrival, Arrivals, Engine};
pub use fan::{Fan, FanSettings};
pub use image_sources::{BoxRoom, ImageSourceError, ImageSources, image_sources};
pub use names::FACE_NAME;
pub use observation::{FiringArrivals, ObservationPoint};
pub use options::{
    ConeOptions, EngineKind, EngineOptions, FanOptions, ForeignOption, OptionKeys, Options,
    PathOptions,
};
pub use path::{Diffractor, Edge, Interaction, Mechanism, Path, Reflector};
pub use paths::{EchoChange, EchoSet};
pub use prediction::Prediction;
pub use simulator::{ModelError, Simulator, receiver, sensor_z_m};

pub use crate::acoustics::EdgeLawKind;

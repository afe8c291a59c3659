//! Configuration of the daemon: the keys, and the layers that give them values.
//!
//! [`Keys`] is what there is, with a doc comment, a range and a default each. From it come the
//! file that documents them ([`document`]), the check of every value with its place, and the
//! refusal of unknown keys ([`Layers`]).

mod document;
mod keys;
mod layers;
mod schema;

pub use document::document;
pub use keys::{
    AirKeys, DeviceKeys, GpioKeys, Keys, LinkKeys, LogKeys, Mode, ModelKeys, MotionKeys, PlaceKeys,
    PlanKeys, ScanningKeys, ServerKeys, SimulateKeys,
};
pub use layers::{ConfigError, Layers, Origin};
pub use schema::{Key, Kind, Section, sections};

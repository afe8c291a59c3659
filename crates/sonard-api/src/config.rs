//! Configuration: the daemon's keys, and what reads any file of sections and keys.
//!
//! [`Keys`] is what there is for `sonard run`, with a doc comment, a range and a default each. From
//! such a [`Form`] come the file that documents it ([`document`]), the check of every value with
//! its place, and the refusal of unknown keys ([`Layers`]).

mod air;
mod document;
mod fleet;
mod foxglove;
mod keys;
mod layers;
mod mqtt;
mod ros;
mod schema;

pub use air::{AirKeys, CollectionAirKeys};
pub use document::document;
pub use fleet::{FleetKeys, MAX_ROBOT_NAME, is_robot_name, robot_name_of_host};
pub use foxglove::FoxgloveKeys;
pub use keys::{
    DeviceKeys, GpioKeys, Keys, LinkKeys, LogKeys, Mode, ModelKeys, MotionKeys, PlaceKeys,
    PlanKeys, ScanningKeys, ServerKeys, SimulateKeys,
};
pub use layers::{ConfigError, Layers, Origin};
pub use mqtt::{Broker, MqttKeys};
pub use ros::{RosDistribution, RosKeys, RosProfile};
pub use schema::{Form, Key, Kind, Section, read_sections, sections};

/// A key of a section with what is wrong with it, and what would be right.
pub type Fault = (&'static str, String, String);

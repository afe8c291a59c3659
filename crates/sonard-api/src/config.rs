//! Configuration of the daemon: its keys, and a reader for any file of sections and keys.
//!
//! [`Keys`] defines the configuration of `sonard run`: each key has a doc comment, a range and a
//! default. The documented configuration file ([`document`]), validation with source positions and
//! rejection of unknown keys are derived from the type. Other programs define a type of their own.

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
pub use fleet::{FleetKeys, MAX_ROBOT_NAME_CHARS, is_robot_name, robot_name_from_host};
pub use foxglove::FoxgloveKeys;
pub use keys::{
    DeviceKeys, GpioKeys, Keys, LinkKeys, LogKeys, Mode, ModelKeys, MotionKeys, PlaceKeys,
    PlanKeys, ScanningKeys, ServerKeys, SimulateKeys,
};
pub use layers::{ConfigError, ConfigLayers, Origin};
pub use mqtt::{BrokerAddress, MqttKeys};
pub use ros::{RosDistribution, RosKeys, RosProfile};
pub use schema::{ConfigForm, Key, Section, ValueKind, read_sections, sections};

/// Invalid key of a section, with the error message and its remedy.
pub type Fault = (&'static str, String, String);

//! `sonard run` as its users meet it: a process, a socket, a log folder.

mod access;
mod api;
mod board;
mod clock;
mod configuration;
mod explained;
mod faults;
mod fleet;
mod foxglove;
mod kill;
mod load;
mod location;
mod model;
mod monitoring;
#[cfg(feature = "mqtt")]
mod mqtt;
mod requests;
mod schema;
mod sensor;
mod simulate;
mod soak;
mod strangers;
mod systemd;
mod viewpoint;

pub(crate) use sonard_test_support::{daemon::*, rig};

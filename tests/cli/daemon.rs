//! `sonard run` as its users meet it: a process, a socket, a log folder.

mod access;
mod api;
mod board;
mod chaos;
mod clock;
mod configuration;
mod descriptors;
mod disk;
mod explained;
mod faults;
mod fleet;
mod foxglove;
mod host;
mod kill;
mod listening;
mod load;
mod location;
mod log_file;
mod model;
mod monitoring;
#[cfg(feature = "mqtt")]
mod mqtt;
mod requests;
mod schema;
mod sensor;
mod signals;
mod silence;
mod simulate;
mod soak;
mod stderr;
mod strangers;
mod supervision;
mod survey;
mod systemd;
mod thermometer;
mod viewpoint;

pub(crate) use sonard_test_support::{daemon::*, rig};

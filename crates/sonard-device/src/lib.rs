//! Host side of the ranger: serial link, scan driver, pins of this computer, thermometer.
//!
//! [`link`] finds, opens and locks serial ports. [`ranger::Ranger`] takes scans with the protocol
//! state machine of `firmware-protocol`. [`pi`] (feature `pi`) runs the device itself on the pins
//! of a Raspberry Pi. A simulated device is in `sonard-mock`.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

pub mod host_gpio;
pub mod link;
#[cfg(feature = "pi")]
pub mod pi;
mod platform;
pub mod ranger;
pub mod thermometer;

//! HTTP API of the sonard daemon: request and response types, configuration keys, and a client.
//!
//! The types at the crate's root are those of `GET /v1/openapi.json`. [`config`] documents and
//! reads the daemon's configuration file, [`client`] connects to a daemon, and [`fleet`] polls
//! several of them. Programs that only read logs need `sonard-log` instead.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod api;
pub mod client;
pub mod config;
pub mod fleet;

pub use api::*;

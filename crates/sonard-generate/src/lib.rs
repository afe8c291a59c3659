//! Data sets of simulated readings for machine learning: scenes, poses, sensors, air and noise drawn from the
//! distributions of a specification.
//!
//! A set is divided into shards. A shard depends on the specification and its number only, so that any engine that
//! distributes numbers can make a set, and a killed run can continue: [`Generator::shard`] writes the tables of one shard
//! to any `Write`.
//!
//! ```
//! use sonard_generate::{Generator, Table};
//!
//! let specification = r#"
//!     [set]
//!     name = "two rooms"
//!     shards = 2
//!     scenes = 1
//!     poses = 3
//!     [plan]
//!     step_deg = 30
//!     [[scene]]
//!     shape = "rectangle"
//!     width_m = [3, 5]
//!     depth_m = [2, 4]
//! "#;
//! let none = |name: &str| Err(std::io::Error::other(format!("no file {name} here")));
//! let generator = Generator::from_toml("rooms.toml", specification, &none)?;
//! let made = generator.shard(1, &mut |_| Ok(Box::new(std::io::sink())), &|_| {})?;
//! assert_eq!(made.rows(Table::Readings), 3 * 12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The crate uses no clock, file or socket.

// Modules are `foo.rs` beside `foo/`.
#![warn(clippy::mod_module_files)]

mod draw;
mod labels;
mod manifest;
mod part;
mod seed;
mod shard;
mod spec;
mod spread;
mod summary;
mod table;
#[cfg(test)]
mod tests;

pub use draw::Redrawn;
pub use manifest::{FileFacts, Manifest, ManifestError, ShardFacts};
pub use part::{Part, PartError};
pub use shard::{Generator, Made, ShardError};
pub use spec::{Spec, SpecError};
pub use spread::Spread;
pub use table::Table;

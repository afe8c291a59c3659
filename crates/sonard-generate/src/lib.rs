//! Data sets of simulated readings for machine learning. Scenes, poses, sensors, air and noise are
//! drawn from the distributions of a specification.
//!
//! A set is divided into shards. A shard depends only on the specification and its number, so any
//! engine that distributes numbers can generate a set, and an interrupted run can be resumed.
//! [`Generator::shard`] writes the tables of one shard to any `Write`.
//!
//! ```
//! use sonard_generate::{Generator, ShardTable};
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
//! assert_eq!(made.rows(ShardTable::Readings), 3 * 12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The crate performs no I/O and reads no clock.

// Modules are in `foo.rs` next to the folder `foo/`.
#![warn(clippy::mod_module_files)]

mod distribution;
mod labels;
mod manifest;
mod partition;
mod sample;
mod seed;
mod shard;
mod spec;
mod summary;
mod table;
#[cfg(test)]
mod tests;

pub use distribution::NumberDistribution;
pub use manifest::{DataSetManifest, FileFacts, ManifestError, ShardFacts};
pub use partition::{SetPart, SetPartError};
pub use sample::RejectedDraws;
pub use shard::{Generator, ShardCounts, ShardError};
pub use spec::{Spec, SpecError};
pub use table::ShardTable;

//! Making sense of scans.
//!
//! [`interpret`] tells planes, corners and edges apart after O. Bozma and R. Kuc, "Building a
//! sonar map in a specular environment using a single mobile sensor", IEEE PAMI 13 (1991). Its
//! steps: a scan's beams ([`Sweep`]) fall into [`Region`]s of constant depth; a region's angular
//! extent against what the sensor allows ([`Extents`]) says edge or not; the same element seen
//! from a second place says plane or corner; [`UniformSum`] is the density of the errors, from
//! which every verdict has its probability.
//!
//! [`prediction`] gives each reading a confidence, and [`grid`] makes maps of readings with
//! poses and says how good they are.

mod arc;
mod belief;
mod density;
mod differentiate;
mod extent;
mod feature;
pub mod grid;
pub mod lines;
pub mod mapping;
mod next;
pub mod prediction;
mod region;
mod sweep;
#[cfg(test)]
mod tests;

pub use density::UniformSum;
pub use differentiate::interpret;
pub use extent::{ExtentError, Extents};
pub use feature::{Feature, FeatureKind, NextPosition, Noise, Probabilities, Reason, Settings};
pub use next::{least_corner_m, least_plane_m, least_translation_m};
pub use region::{Region, Side, regions};
pub use sweep::{Beam, Heard, Sweep, SweepError};

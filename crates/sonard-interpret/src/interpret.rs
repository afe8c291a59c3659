//! Interpretation of scans: features, maps and confidences.
//!
//! [`interpret`] classifies planes, corners and edges after O. Bozma and R. Kuc, "Building a
//! sonar map in a specular environment using a single mobile sensor", IEEE PAMI 13 (1991):
//!
//! 1. The beams of a scan ([`Sweep`]) are segmented into [`Region`]s of constant depth.
//! 2. The angular extent of a region, compared with the sensor's ([`Extents`]), separates edges
//!    from planes and corners.
//! 3. The same element observed from a second position separates planes from corners.
//!
//! [`UniformSum`] is the density of the errors, from which every class gets its probability.
//!
//! [`prediction`] assigns a confidence to each reading, and [`grid`] builds and scores maps of
//! readings with poses.

mod arc;
mod classify;
mod density;
mod extent;
mod feature;
pub mod grid;
pub mod lines;
pub mod mapping;
mod next_view;
mod posterior;
pub mod prediction;
mod region;
mod sweep;
#[cfg(test)]
mod tests;

pub use classify::interpret;
pub use density::UniformSum;
pub use extent::{ExtentError, Extents};
pub use feature::{
    Feature, FeatureKind, InterpretSettings, NextPosition, Noise, Probabilities, Reason,
};
pub use next_view::{min_corner_m, min_plane_m, min_translation_m};
pub use region::{Region, RegionBorder, regions};
pub use sweep::{BeamOutcome, Sweep, SweepBeam, SweepError};

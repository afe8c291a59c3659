//! Maps of line segments.
//!
//! After G. Dudek, P. Freedman and I. Rekleitis, "Just-in-time sensing: efficiently combining
//! sonar and laser range data for exploring unknown worlds", ICRA 1996: readings that can't be
//! right are left out, the rest fall into clusters by the sphere-of-influence graph, segments are
//! fitted to each, and segments of one wall are merged by what they were made of.

mod cluster;
mod fit;
mod map;
mod merge;
#[cfg(test)]
mod tests;

pub use cluster::clusters;
pub use fit::{FitSettings, Segment, fit};
pub use map::{LineMap, LineMapSettings};
pub use merge::{MergeSettings, merge};

use serde::Serialize;

use crate::geometry::DVec2;

/// What a line was made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LineKind {
    /// Sonar readings only.
    Sonar,
    /// Laser readings only.
    Laser,
    /// Both.
    Complex,
}

/// A line of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapLine {
    /// Its ends, metres.
    pub ends: [DVec2; 2],
    /// Which ends are confirmed: the wall does end there.
    pub terminal: [bool; 2],
    /// What it was made of.
    pub kind: LineKind,
    /// From 0 (a guess) to 1.
    pub confidence: f64,
}

impl MapLine {
    /// Length, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }
}

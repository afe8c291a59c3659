//! Maps of line segments.
//!
//! After G. Dudek, P. Freedman and I. Rekleitis, "Just-in-time sensing: efficiently combining
//! sonar and laser range data for exploring unknown worlds", ICRA 1996: readings that can't be
//! right are left out, the rest fall into clusters by the sphere-of-influence graph, segments are
//! fitted to each, and segments of one wall are merged by what they were made of.

mod cluster;
mod error;
mod fit;
mod laser;
mod map;
mod merge;
#[cfg(test)]
mod tests;

pub use cluster::clusters;
pub use error::{MOST_ERROR_M, MapError, map_error};
pub use fit::{FitSettings, Segment, fit};
pub use laser::{LaserReturn, LaserScan};
pub use map::{LineMap, LineMapSettings};
pub use merge::{MergeSettings, merge};

use serde::Serialize;

use sonard_model::geometry::{DVec2, distance_to_segment};

/// Source of a line.
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
    /// Where the robot was when it saw it, metres.
    pub seen_from: DVec2,
}

impl MapLine {
    /// Length, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }

    /// From its first end to its second, a unit vector; zero for a line without length.
    #[must_use]
    pub fn direction(&self) -> DVec2 {
        (self.ends[1] - self.ends[0]).normalize_or_zero()
    }

    /// Distance to the nearest point of it, metres.
    #[must_use]
    pub fn distance_m(&self, point: DVec2) -> f64 {
        distance_to_segment(point, self.ends[0], self.ends[1])
    }

    /// Where the lines through two segments cross, if their angle is at least `least_deg`.
    #[must_use]
    pub fn meets(&self, other: &Self, least_deg: f64) -> Option<DVec2> {
        let (along, across) = (self.direction(), other.direction());
        let sine = along.perp_dot(across);
        let place_m = (other.ends[0] - self.ends[0]).perp_dot(across) / sine;
        (sine.abs() >= least_deg.to_radians().sin()).then(|| self.ends[0] + place_m * along)
    }
}

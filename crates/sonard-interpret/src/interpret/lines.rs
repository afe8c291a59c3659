//! Maps of line segments from sonar and laser scans.
//!
//! After G. Dudek, P. Freedman and I. Rekleitis, "Just-in-time sensing: efficiently combining
//! sonar and laser range data for exploring unknown worlds", ICRA 1996. Implausible readings are
//! discarded and the rest clustered by the sphere-of-influence graph. Segments are fitted to each
//! cluster, and segments of one wall are merged according to their sources.

mod cluster;
mod error;
mod fit;
mod laser;
mod map;
mod merge;
#[cfg(test)]
mod tests;

pub use cluster::clusters;
pub use error::{MAX_ERROR_M, MapError, map_error};
pub use fit::{FitSettings, FittedSegment, fit};
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
    /// Sonar and laser readings.
    Complex,
}

/// Line segment of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapLine {
    /// End points, metres.
    pub ends: [DVec2; 2],
    /// Confirmed ends: the wall does end there.
    pub terminal: [bool; 2],
    /// Source of the readings.
    pub kind: LineKind,
    /// Confidence from 0 (a guess) to 1.
    pub confidence: f64,
    /// Position of the robot at the time of detection, metres.
    pub seen_from: DVec2,
}

impl MapLine {
    /// Length, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }

    /// Unit vector from the first end to the second; zero for a line without length.
    #[must_use]
    pub fn direction(&self) -> DVec2 {
        (self.ends[1] - self.ends[0]).normalize_or_zero()
    }

    /// Distance to the nearest point of the line, metres.
    #[must_use]
    pub fn distance_m(&self, point: DVec2) -> f64 {
        distance_to_segment(point, self.ends[0], self.ends[1])
    }

    /// Intersection of the lines through two segments, if their angle is at least `min_deg`.
    #[must_use]
    pub fn intersection(&self, other: &Self, min_deg: f64) -> Option<DVec2> {
        let (along, across) = (self.direction(), other.direction());
        let sine = along.perp_dot(across);
        let place_m = (other.ends[0] - self.ends[0]).perp_dot(across) / sine;
        (sine.abs() >= min_deg.to_radians().sin()).then(|| self.ends[0] + place_m * along)
    }
}

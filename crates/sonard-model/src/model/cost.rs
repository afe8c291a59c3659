//! Error of a search for echo paths that exceeds its effort limit.

use thiserror::Error;

/// Part of the search whose effort is counted separately.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchPart {
    /// Beams reflected by walls.
    Beams,
    /// Rays by way of cylinders.
    Cylinders,
    /// Paths by an upright edge.
    UprightEdges,
    /// Paths by a level edge.
    LevelEdges,
    /// Paths by two upright edges.
    TwoEdges,
    /// Paths of the plan by way of floor and ceiling, and patches of rough walls.
    Images,
}

impl SearchPart {
    pub(super) const ALL: [Self; 6] = [
        Self::Beams,
        Self::Cylinders,
        Self::UprightEdges,
        Self::LevelEdges,
        Self::TwoEdges,
        Self::Images,
    ];

    const fn description(self) -> &'static str {
        match self {
            Self::Beams => "reflections from wall to wall",
            Self::Cylinders => "paths by way of cylinders",
            Self::UprightEdges => "paths by upright edges",
            Self::LevelEdges => "paths by level edges of low or hanging walls",
            Self::TwoEdges => "paths by two edges",
            Self::Images => "paths by floor and ceiling",
        }
    }
}

/// Error of a search that exceeds its effort limit: there are too many paths.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "too many echo paths, most of them {}: reduce max-range (currently {} m), set or reduce max-order{}, \
     raise the threshold or min-amplitude, or remove objects that cannot matter",
    part.description(), max_path_m / 2.0,
    if *double_diffraction { ", disable double-diffraction" } else { "" }
)]
pub struct TooCostly {
    /// Part of the search with the largest effort.
    pub part: SearchPart,
    /// Longest requested path, there and back, metres.
    pub max_path_m: f64,
    /// `true` if paths by two edges were requested.
    pub double_diffraction: bool,
}

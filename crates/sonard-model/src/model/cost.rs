//! The refusal of a search for echo paths that would cost more than it may.

use thiserror::Error;

/// A part of the search, by which its effort is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchPart {
    /// Beams that walls return.
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

    const fn in_words(self) -> &'static str {
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

/// A search that would cost more than it may: there are too many paths.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "there are too many echo paths here to find them all, most of them {}: shorten max-range (it is {} m), \
     give max-order or a smaller one{}, raise the threshold or `weakest`, or leave out what can't matter",
    part.in_words(), max_path_m / 2.0,
    if *double_diffraction { ", leave out double-diffraction" } else { "" }
)]
pub struct TooCostly {
    /// What cost most.
    pub part: SearchPart,
    /// The longest path that was asked for, there and back, metres.
    pub max_path_m: f64,
    /// Whether paths by two edges were asked for.
    pub double_diffraction: bool,
}

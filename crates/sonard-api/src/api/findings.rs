//! What can be made of a scan: a map, lines and features.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_interpret::interpret::{FeatureKind, Reason};
use sonard_records::PlanPoint;

/// Features, lines and map found in a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Findings {
    /// Occupancy grid; `null` where nothing was heard near enough to be mapped.
    pub map: Option<MapCells>,
    /// Line segments fitted to the readings.
    pub lines: Vec<FoundLine>,
    /// Planes, corners and edges told apart.
    pub features: Vec<FoundFeature>,
    /// What could not be found and why, in words.
    pub lacks: Option<String>,
}

/// An occupancy grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MapCells {
    /// Lower left corner.
    pub origin: PlanPoint,
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Cells of a row.
    pub width: usize,
    /// How likely each cell is occupied, percent, -1 where nothing is known; row by row from the lower
    /// left, as in ROS's `OccupancyGrid`.
    pub cells: Vec<i8>,
}

/// A line segment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FoundLine {
    /// One end.
    pub from: PlanPoint,
    /// The other.
    pub to: PlanPoint,
    /// From 0 (a guess) to 1.
    pub confidence: f64,
}

/// A plane, corner or edge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FoundFeature {
    /// What it is.
    pub kind: FeatureKind,
    /// Middle of its arc.
    pub at: PlanPoint,
    /// Probability of the kind; for what is unresolved, of the likeliest one.
    pub confidence: f64,
    /// Why it is unresolved.
    pub reason: Option<Reason>,
    /// Indices of the first and last beam of its arc.
    pub beams: [u32; 2],
}

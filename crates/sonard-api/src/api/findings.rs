//! Interpretation of a scan: occupancy grid, lines and features.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_interpret::interpret::{FeatureKind, Reason};
use sonard_records::PlanPoint;

/// Features, lines and occupancy grid derived from a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Findings {
    /// Occupancy grid; `null` if no echo is near enough to be mapped.
    pub map: Option<MapCells>,
    /// Line segments fitted to the readings.
    pub lines: Vec<FoundLine>,
    /// Planes, corners and edges, classified by their arcs.
    pub features: Vec<FoundFeature>,
    /// Description of results that could not be computed, with the reason.
    pub unavailable_reason: Option<String>,
}

/// Occupancy grid of square cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MapCells {
    /// Lower left corner of the grid.
    pub origin: PlanPoint,
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Number of cells per row.
    pub width: usize,
    /// Occupancy probability of each cell, percent, or -1 if unknown; row by row from the lower
    /// left, as in ROS's `OccupancyGrid`.
    pub cells: Vec<i8>,
}

/// Line segment fitted to readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FoundLine {
    /// Start point of the segment.
    pub from: PlanPoint,
    /// End point of the segment.
    pub to: PlanPoint,
    /// Confidence, from 0 (a guess) to 1.
    pub confidence: f64,
}

/// Plane, corner or edge of the room.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FoundFeature {
    /// Kind of reflector.
    pub kind: FeatureKind,
    /// Midpoint of the feature's arc.
    pub at: PlanPoint,
    /// Probability of the kind; for an unresolved feature, that of its most probable kind.
    pub confidence: f64,
    /// Reason why the kind is unresolved.
    pub reason: Option<Reason>,
    /// Indices of the first and last beam of the feature's arc.
    pub beams: [u32; 2],
}

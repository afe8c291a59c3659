//! Features found by the interpretation, and its settings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Settings of the interpretation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InterpretSettings {
    /// Assumed scattering strength of edges, which sets the boundary. Bozma and Kuc measured 0.095
    /// for theirs.
    pub sigma_e: f64,
    /// Minimum and maximum scattering strength of an edge. Bozma and Kuc measured 0.035 to 0.10.
    pub sigma_e_range: [f64; 2],
    /// Minimum and maximum reflectance of planes and corners.
    pub reflectance_range: [f64; 2],
    /// Maximum deviation of a reading from the mean of its region, metres.
    pub depth_tolerance_m: f64,
    /// Maximum number of consecutive outliers bridged inside a region.
    pub max_holes: usize,
    /// Noise in addition to the quantization.
    pub noise: Noise,
    /// Minimum probability for a feature to be classified.
    pub min_confidence: f64,
    /// Factor by which a proposed translation exceeds the minimum that decides.
    pub translation_margin: f64,
}

impl Default for InterpretSettings {
    fn default() -> Self {
        Self {
            sigma_e: 0.095,
            sigma_e_range: [0.035, 0.10],
            reflectance_range: [0.7, 1.0],
            depth_tolerance_m: 0.010,
            max_holes: 1,
            noise: Noise::default(),
            min_confidence: 0.9,
            translation_margin: 1.2,
        }
    }
}

/// Standard deviations of the noise other than quantization; 0 each by default, as in the paper.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Noise {
    /// Standard deviation of an echo's amplitude, relative to a head-on perfect wall (0.01 for an
    /// SNR of 40 dB).
    pub amplitude: f64,
    /// Standard deviation of the azimuth of each beam, degrees.
    pub azimuth_deg: f64,
    /// Standard deviation of the heading change between two scans, degrees.
    pub heading_deg: f64,
}

/// Class of an element of the floor plan.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum FeatureKind {
    /// Flat wall.
    Plane,
    /// Concave right-angled corner of two walls.
    Corner,
    /// Convex corner of two walls, or the end of one.
    Edge,
    /// Undecided, for the given [`Reason`].
    Unresolved,
}

/// Reason why a feature is unresolved.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// Plane or corner, to be decided by a scan from a second position.
    SecondPosition,
    /// Second position too close to decide (25).
    Translation,
    /// Element not found again from the second position.
    Lost,
    /// Several matching arcs from the second position, or one that fits neither plane nor corner.
    Ambiguous,
    /// Arc partly covered by a nearer target.
    Interference,
    /// Arc cut off by the end of the scan, or of its valid readings.
    CutOff,
    /// Extent that matches neither an edge nor a plane or corner.
    Extent,
    /// Arc behind possible walls, or near enough to be the repeated echo of a wall within the
    /// blanking interval: a likely multiple reflection.
    Reflections,
    /// Target below the minimum range.
    MinRange,
}

/// Probabilities of the three classes and of other; all 0 for an arc without a range.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Probabilities {
    /// Probability of a plane.
    pub plane: f64,
    /// Probability of a corner.
    pub corner: f64,
    /// Probability of an edge.
    pub edge: f64,
    /// Probability of other: multiple reflections, echoes between a wall and the ranger, round
    /// bodies.
    pub other: f64,
}

impl Probabilities {
    /// Most probable of the three classes, with its probability.
    #[must_use]
    pub fn best(&self) -> (FeatureKind, f64) {
        [
            (FeatureKind::Plane, self.plane),
            (FeatureKind::Corner, self.corner),
            (FeatureKind::Edge, self.edge),
        ]
        .into_iter()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((FeatureKind::Unresolved, 0.0))
    }
}

/// Record of one element of the floor plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Feature {
    /// Class of the element.
    pub kind: FeatureKind,
    /// World x of the middle of the arc, metres; `None` where only the direction is known.
    pub x_m: Option<f64>,
    /// World y of the middle of the arc, metres.
    pub y_m: Option<f64>,
    /// Direction of the middle of the arc (`theta_N`), degrees counter-clockwise from the heading.
    pub bearing_deg: f64,
    /// Median range, metres.
    pub range_m: Option<f64>,
    /// Estimated angular extent of the arc, degrees (13).
    pub extent_deg: f64,
    /// Change of `theta_N` from the first to the second position (21), degrees, positive for a
    /// corner.
    pub beta_deg: Option<f64>,
    /// Probability of the class; for an unresolved feature, of the most probable one.
    pub confidence: f64,
    /// Indices in the plan of the first and last beam of the arc.
    pub beams: [u32; 2],
    /// Reason why the feature is unresolved.
    pub reason: Option<Reason>,
    /// Probabilities of all classes.
    pub probabilities: Probabilities,
    /// Expected extent of a plane or corner of reflectance 1, degrees (15).
    pub extent_plane_corner_deg: Option<f64>,
    /// Expected extent of an edge, degrees (16).
    pub extent_edge_deg: Option<f64>,
    /// Boundary `b(r)` between the two extents, degrees (17).
    pub boundary_deg: Option<f64>,
    /// Expected `beta_deg` of a corner (22a); that of a plane is 0.
    pub beta_corner_deg: Option<f64>,
    /// Proposed position of the scan that decides the class.
    pub next: Option<NextPosition>,
    /// Scan of the beams.
    pub scan: Uuid,
    /// Scan in which the element was found again.
    pub second_scan: Option<Uuid>,
}

/// Position from which the next scan decides between plane and corner.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NextPosition {
    /// World x, metres.
    pub x_m: f64,
    /// World y, metres.
    pub y_m: f64,
    /// Direction of travel, degrees counter-clockwise from the heading.
    pub direction_deg: f64,
    /// Length of travel, metres.
    pub delta_m: f64,
    /// Number of open features decided by a scan from there.
    pub decides: usize,
    /// Minimum width of a plane to be detected from both positions, metres (27).
    pub min_plane_m: f64,
    /// Minimum length of each side of a corner, metres (26), (28).
    pub min_corner_m: f64,
}

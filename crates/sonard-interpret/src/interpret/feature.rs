//! What an interpretation says, and by which settings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Settings of the interpretation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Scattering strength of edges, for which the boundary is drawn. Bozma and Kuc found 0.095
    /// for theirs.
    pub sigma_e: f64,
    /// Least and greatest scattering strength that an edge may have. They found 0.035 to 0.10.
    pub sigma_e_range: [f64; 2],
    /// Least and greatest reflectance of planes and corners.
    pub reflectance_range: [f64; 2],
    /// How far a reading may be from its region's mean, metres.
    pub depth_tolerance_m: f64,
    /// So many odd beams inside a region are passed over.
    pub most_holes: usize,
    /// Noise beside the quantisation.
    pub noise: Noise,
    /// A kind less probable than this is not named.
    pub min_confidence: f64,
    /// How much longer than the least that decides a proposed translation is.
    pub translation_margin: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            sigma_e: 0.095,
            sigma_e_range: [0.035, 0.10],
            reflectance_range: [0.7, 1.0],
            depth_tolerance_m: 0.010,
            most_holes: 1,
            noise: Noise::default(),
            min_confidence: 0.9,
            translation_margin: 1.2,
        }
    }
}

/// Standard deviations of what is not quantisation; 0 each by default, as in the paper.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Noise {
    /// Of an echo's amplitude, relative to a head-on, perfect wall (40 dB of SNR: 0.01).
    pub amplitude: f64,
    /// Of each beam's azimuth, degrees.
    pub azimuth_deg: f64,
    /// Of the heading between two scans, degrees.
    pub heading_deg: f64,
}

/// What an element of the floor plan is.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum FeatureKind {
    /// A flat wall.
    Plane,
    /// Two walls seen from inside, at a right angle.
    Corner,
    /// Two walls seen from outside, or the end of one.
    Edge,
    /// One of these, or none: [`Reason`] says why that is open.
    Unresolved,
}

/// Why a feature is unresolved.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// A plane or a corner: a scan from another place decides.
    SecondPosition,
    /// The other place is too near to decide (25).
    Translation,
    /// Not found again from the other place.
    Lost,
    /// From the other place several arcs may be it, or one that fits neither plane nor corner.
    Ambiguous,
    /// Something nearer covers a part of its arc.
    Interference,
    /// The scan, or what was measured of it, ends in its arc.
    CutOff,
    /// Its arc is as wide as that of neither an edge nor a plane or corner.
    Extent,
    /// It lies behind what may be walls, so the sound may have come by way of them.
    Reflections,
    /// Closer than can be measured.
    MinRange,
}

/// Probabilities of the three kinds and of something else; all 0 where the arc says nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Probabilities {
    /// Of a plane.
    pub plane: f64,
    /// Of a corner.
    pub corner: f64,
    /// Of an edge.
    pub edge: f64,
    /// Of something else: sound by way of several walls or between a wall and the ranger, a round body.
    pub other: f64,
}

impl Probabilities {
    /// The likeliest of the three kinds and its probability.
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

/// One element of the floor plan, as its record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Feature {
    /// What it is.
    pub kind: FeatureKind,
    /// World x of the middle of its arc, metres; `None` where only the direction is known.
    pub x_m: Option<f64>,
    /// World y of the middle of its arc, metres.
    pub y_m: Option<f64>,
    /// Direction of its arc's middle (`theta_N`), degrees counter-clockwise from the heading.
    pub bearing_deg: f64,
    /// Range, metres.
    pub range_m: Option<f64>,
    /// Estimated angular extent of its arc, degrees (13).
    pub extent_deg: f64,
    /// Change of `theta_N` from the place it was seen from to the other one (21), degrees,
    /// counted so that a corner's is positive.
    pub beta_deg: Option<f64>,
    /// Probability of the kind; for what is unresolved, of the likeliest one.
    pub confidence: f64,
    /// Indices in the plan of the first and last beam of its arc.
    pub beams: [u32; 2],
    /// Why it is unresolved.
    pub reason: Option<Reason>,
    /// What the confidence is chosen from.
    pub probabilities: Probabilities,
    /// The extent that a plane or corner of reflectance 1 would have, degrees (15).
    pub extent_plane_corner_deg: Option<f64>,
    /// The extent that an edge would have, degrees (16).
    pub extent_edge_deg: Option<f64>,
    /// The boundary `b(r)` between the two, degrees (17).
    pub boundary_deg: Option<f64>,
    /// What `beta_deg` would be for a corner (22a); for a plane it would be 0.
    pub beta_corner_deg: Option<f64>,
    /// Where to scan from next to decide it.
    pub next: Option<NextPosition>,
    /// The scan whose beams these are.
    pub scan: Uuid,
    /// The scan that it was found again in.
    pub second_scan: Option<Uuid>,
}

/// A place from which the next scan decides between plane and corner.
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
    /// How many open features a scan from there decides.
    pub decides: usize,
    /// Least width of the element, if a plane, to be seen from both places, metres (27).
    pub least_plane_m: f64,
    /// Least length of each side, if a corner, metres (26), (28).
    pub least_corner_m: f64,
}

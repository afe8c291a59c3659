//! Posterior probabilities of the classes, including "none of them".
//!
//! Bozma and Kuc assume planes, corners and edges, each in clear view. In a room most arcs are
//! none of these: multiple reflections, echoes between a wall and the transducer, round bodies.
//! A fourth hypothesis, other, therefore has its own prior and likelihood.
//!
//! The arcs themselves indicate the prior: a multiple reflection lies behind one of its walls, so
//! its arc is crossed by the plane of a nearer arc. A wall within the blanking interval returns no
//! reading, but its echo repeats, because the transducer reflects it back to the wall. The first
//! repeat after the blanking has the narrow arc of an edge, at up to 1.7 times the minimum range.
//!
//! Priors and fractions below are counts over 200 random rooms (boxes and partitions in rectangular
//! rooms, one scan in each from a random position, `senscomp-6500` with its full receiver, 2,275
//! complete arcs, ground truth from the model's paths); those of repeats over 2,000 rooms with
//! positions down to 8 cm from a wall (1,740 arcs within reach). `sonard-papers benchmark
//! interpret` measures their calibration on other rooms.

use super::{Probabilities, UniformSum};

/// Prior probability of other, by the number of nearer arcs that would hide the arc: 0 to 5.
const P_OTHER: [f64; 6] = [0.021, 0.32, 0.86, 0.945, 0.985, 0.993];

/// Prior probabilities of plane, corner and edge, given that the arc is one of these.
const P_KINDS: [f64; 3] = [0.58, 0.34, 0.08];

/// Prior probabilities of plane, corner and edge for an arc near enough to be a repeat. Edges are
/// too weak to be detected farther away.
const P_KINDS_NEAR: [f64; 3] = [0.70, 0.06, 0.24];

/// Prior probability that an arc near enough is the repeat of a wall within the blanking interval.
const P_REPEAT: f64 = 0.31;

/// Range of the farthest repeat, relative to the minimum range. The echo of a more distant wall
/// lasts until the blanking ends, and is detected itself.
const MAX_REPEAT_RANGE: f64 = 1.7;

/// Extents of repeats, relative to a plane's: two passes of the beam pattern narrow the arc.
const REPEAT_EXTENTS: [f64; 2] = [0.1, 0.46];

/// Probability that overlapping echoes change the extent of a plane or corner.
const P_ODD_EXTENT: f64 = 0.01;

/// Probability that the extent of an edge differs: `sigma_E` is measured by the paper's authors,
/// and other edges scatter by other laws.
const P_ODD_EDGE: f64 = 0.3;

/// Probability that other has the extent of a plane: the mirror image of a wall looks like a wall.
/// The rest may have any extent up to that.
const P_LIKE_PLANE: f64 = 0.65;

/// Probability that other turns between two positions like a plane or a corner; the rest turn by
/// any angle.
const P_KNOWN_TURN: f64 = 0.8;

/// Maximum turn of other, degrees.
const MAX_TURN_DEG: f64 = 60.0;

/// Maximum extent of overlapping echoes, relative to a plane's.
const MAX_EXTENT_RATIO: f64 = 1.5;

/// Likelihoods of the extent of an arc in one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ExtentLikelihood {
    /// Density of the extent for a plane or corner.
    pub(super) plane_corner: f64,
    /// Density of the extent for an edge.
    pub(super) edge: f64,
    /// Uniform density over extents up to a plane's, per degree.
    any: f64,
    /// Density of the extent for the repeat of a blanked wall; `None` for an arc too far away.
    repeat: Option<f64>,
}

impl ExtentLikelihood {
    /// Likelihoods from the densities for the paper's classes and the extent of a perfect plane,
    /// degrees.
    pub(super) fn new(plane_corner: f64, edge: f64, plane_extent_deg: f64) -> Self {
        let any = 1.0 / (MAX_EXTENT_RATIO * plane_extent_deg).max(1.0);
        Self { plane_corner, edge, any, repeat: None }
    }

    /// Adds the hypothesis of a repeat for an arc of an extent, degrees, at a range within reach.
    pub(super) fn with_repeat(
        self,
        seen_deg: f64,
        plane_extent_deg: f64,
        range_m: f64,
        min_range_m: f64,
    ) -> Self {
        let [low, high] = REPEAT_EXTENTS.map(|ratio| ratio * plane_extent_deg.max(1.0));
        let fits = (low..=high).contains(&seen_deg);
        let density = if fits { 1.0 / (high - low) } else { 0.0 };
        let is_near = range_m < MAX_REPEAT_RANGE * min_range_m;
        Self { repeat: is_near.then_some(density), ..self }
    }

    /// Returns `true` if the range and the extent are those of a repeat.
    pub(super) const fn may_be_repeat(&self) -> bool {
        matches!(self.repeat, Some(density) if density > 0.0)
    }

    /// Likelihoods of an arc without a range.
    pub(super) const NONE: Self = Self { plane_corner: 0.0, edge: 0.0, any: 0.0, repeat: None };
}

/// Densities of the turn to another position for a plane, and for a corner or edge.
pub(super) type TurnLikelihood = [f64; 2];

/// Posterior of an arc that `hidden_by` nearer arcs would hide if they were walls.
pub(super) fn probabilities(
    extent: &ExtentLikelihood,
    hidden_by: usize,
    turns: impl IntoIterator<Item = TurnLikelihood>,
) -> Probabilities {
    let prior_other = P_OTHER[hidden_by.min(P_OTHER.len() - 1)];
    let (prior_repeat, kinds) = match extent.repeat {
        Some(_) => ((1.0 - prior_other) * P_REPEAT, P_KINDS_NEAR),
        None => (0.0, P_KINDS),
    };
    let prior_kinds = 1.0 - prior_other - prior_repeat;
    let [of_plane, of_corner, of_edge] = kinds.map(|share| prior_kinds * share);
    let mixed = |density: f64, odd: f64| (1.0 - odd) * density + odd * extent.any;
    let plane_corner = mixed(extent.plane_corner, P_ODD_EXTENT);
    let [mut plane, mut corner] = [of_plane * plane_corner, of_corner * plane_corner];
    let mut edge = of_edge * mixed(extent.edge, P_ODD_EDGE);
    let mut other = prior_other * mixed(extent.plane_corner, 1.0 - P_LIKE_PLANE)
        + prior_repeat * extent.repeat.unwrap_or(0.0);
    for [as_plane, as_corner] in turns {
        plane *= as_plane;
        corner *= as_corner;
        edge *= as_corner;
        let known = (as_plane + as_corner) / 2.0;
        other *= P_KNOWN_TURN * known + (1.0 - P_KNOWN_TURN) / MAX_TURN_DEG;
    }
    let all = plane + corner + edge + other;
    if all > 0.0 && all.is_finite() {
        let [plane, corner, edge, other] = [plane, corner, edge, other].map(|part| part / all);
        Probabilities { plane, corner, edge, other }
    } else {
        Probabilities { other: 1.0, ..Probabilities::default() }
    }
}

/// Mean density of a measured extent over uniformly distributed strengths from `low` to `high`,
/// restricted to detectable ones: `min_strength` and above.
pub(super) fn mean_density(
    error: &UniformSum,
    seen_deg: f64,
    [low, high]: [f64; 2],
    min_strength: f64,
    true_deg: impl Fn(f64) -> f64,
) -> f64 {
    let from = low.max(min_strength);
    if from >= high {
        return 0.0;
    }
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..STRENGTHS {
        // The extent grows like a square root above the detection limit, so strengths are
        // sampled more densely there.
        let part = (i as f64 + 0.5) / STRENGTHS as f64;
        let extent_deg = true_deg(from + (high - from) * part * part);
        sum += part * error.density(seen_deg - extent_deg);
        weights += part;
    }
    sum / weights
}

/// Number of scattering strengths, or reflectances, over which the densities are averaged.
const STRENGTHS: usize = 16;

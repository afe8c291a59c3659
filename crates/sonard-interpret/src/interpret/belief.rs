//! How probable each kind is, something that is none of them among them.
//!
//! Bozma and Kuc know planes, corners and edges, each with a clear view of it. In a room most arcs
//! are none of these: sound that came by way of several walls, between a wall and the ranger's face,
//! from a round body. So a fourth hypothesis, something else, has a prior and a likelihood of its own.
//!
//! Where it is to be expected, the arcs themselves tell: a sound that came by way of walls lies behind
//! one of them, so its arc is crossed by the plane of a nearer arc. Priors and shares below
//! are counts over 200 made-up rooms (boxes and partitions in rectangular rooms, one scan in each from
//! a random place, `senscomp-6500` with its whole receiver, 2,275 whole arcs, the truth from the
//! model's paths). `sonard-papers benchmark interpret` measures on other rooms how far they can be believed.

use super::{Probabilities, UniformSum};

/// Share of arcs that are something else, by how many nearer arcs would hide them: none to five.
const OTHER: [f64; 6] = [0.021, 0.32, 0.86, 0.945, 0.985, 0.993];

/// Shares of planes, corners and edges among those that are one of these.
const KINDS: [f64; 3] = [0.58, 0.34, 0.08];

/// So many arcs of planes and corners have another extent than the sensor's figures say, because
/// sounds overlap.
const ODD_EXTENT: f64 = 0.01;

/// The same for edges: the paper's `sigma_E` is its authors' measurement, and other edges answer by
/// other laws.
const ODD_EDGE: f64 = 0.3;

/// Of what is something else, so many have a plane's extent: the image of a wall in others looks like a
/// wall. The rest may have any extent up to that.
const LIKE_PLANE: f64 = 0.65;

/// And so many turn between two places as a plane or as a corner does; the rest by any angle.
const TURNS_LIKE_KNOWN: f64 = 0.8;

/// Widest turn of something else, degrees.
const WIDEST_TURN_DEG: f64 = 60.0;

/// How much wider than a plane's an extent may be where sounds overlap, as a part of it.
const WIDEST: f64 = 1.5;

/// What one scan says of an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ExtentLikelihood {
    /// Density of its extent for a plane or corner.
    pub(super) plane_corner: f64,
    /// And for an edge.
    pub(super) edge: f64,
    /// If any extent up to a plane's were as likely, per degree.
    any: f64,
}

impl ExtentLikelihood {
    /// From the densities for the paper's kinds and the extent of a perfect plane, degrees.
    pub(super) fn new(plane_corner: f64, edge: f64, plane_extent_deg: f64) -> Self {
        let any = 1.0 / (WIDEST * plane_extent_deg).max(1.0);
        Self { plane_corner, edge, any }
    }

    /// An arc of which nothing can be said.
    pub(super) const NONE: Self = Self { plane_corner: 0.0, edge: 0.0, any: 0.0 };
}

/// Densities of the turn to one other place for a plane, and for a corner or edge.
pub(super) type TurnLikelihood = [f64; 2];

/// The probabilities of an arc that `hidden_by` nearer arcs would hide if they were walls.
pub(super) fn probabilities(
    extent: &ExtentLikelihood,
    hidden_by: usize,
    turns: impl IntoIterator<Item = TurnLikelihood>,
) -> Probabilities {
    let prior_other = OTHER[hidden_by.min(OTHER.len() - 1)];
    let [of_plane, of_corner, of_edge] = KINDS.map(|share| (1.0 - prior_other) * share);
    let mixed = |density: f64, odd: f64| (1.0 - odd) * density + odd * extent.any;
    let plane_corner = mixed(extent.plane_corner, ODD_EXTENT);
    let [mut plane, mut corner] = [of_plane * plane_corner, of_corner * plane_corner];
    let mut edge = of_edge * mixed(extent.edge, ODD_EDGE);
    let mut other = prior_other * mixed(extent.plane_corner, 1.0 - LIKE_PLANE);
    for [as_plane, as_corner] in turns {
        plane *= as_plane;
        corner *= as_corner;
        edge *= as_corner;
        let known = (as_plane + as_corner) / 2.0;
        other *= TURNS_LIKE_KNOWN * known + (1.0 - TURNS_LIKE_KNOWN) / WIDEST_TURN_DEG;
    }
    let all = plane + corner + edge + other;
    if all > 0.0 && all.is_finite() {
        let [plane, corner, edge, other] = [plane, corner, edge, other].map(|part| part / all);
        Probabilities { plane, corner, edge, other }
    } else {
        Probabilities { other: 1.0, ..Probabilities::default() }
    }
}

/// Mean density of a measured extent over strengths from `low` to `high`, all of them equally
/// likely as far as they are heard at all: from `least` on.
pub(super) fn mean_density(
    error: &UniformSum,
    seen_deg: f64,
    [low, high]: [f64; 2],
    least: f64,
    true_deg: impl Fn(f64) -> f64,
) -> f64 {
    let from = low.max(least);
    if from >= high {
        return 0.0;
    }
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..STRENGTHS {
        // The extent grows like a root from where it begins to be heard, so strengths are taken
        // closer together there.
        let part = (i as f64 + 0.5) / STRENGTHS as f64;
        let extent_deg = true_deg(from + (high - from) * part * part);
        sum += part * error.density(seen_deg - extent_deg);
        weights += part;
    }
    sum / weights
}

/// So many scattering strengths, and reflectances, are the densities averaged over.
const STRENGTHS: usize = 16;

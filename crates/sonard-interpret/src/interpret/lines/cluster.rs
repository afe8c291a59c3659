//! Clusters by the sphere-of-influence graph.

use std::collections::HashMap;

use rstar::{RTree, primitives::GeomWithData};
use spade::{DelaunayTriangulation, Point2, Triangulation};

use sonard_model::geometry::DVec2;

/// Groups points: each has a circle out to its nearest neighbour, at least `least_radius_m`, and
/// points whose circles meet are in one group (G. Toussaint, "A graph-theoretical primal sketch",
/// 1988). Groups and the indices in them are in rising order; points that are not finite are in
/// none.
///
/// The nearest neighbour is one in the Delaunay triangulation, so for n points whose circles meet
/// few others this takes time in proportion to n log n.
#[must_use]
pub fn clusters(points: &[DVec2], least_radius_m: f64) -> Vec<Vec<usize>> {
    let radii = radii(points, least_radius_m);
    let near: Vec<_> = (0..points.len())
        .filter(|&at| points[at].is_finite())
        .map(|at| GeomWithData::new(points[at].to_array(), at))
        .collect();
    let tree = RTree::bulk_load(near);
    let mut groups = Groups::new(points.len());
    for (at, &radius_m) in radii.iter().enumerate() {
        if !points[at].is_finite() {
            continue;
        }
        // Circles smaller than this one meet it within twice its radius; larger ones find it.
        let reach_m = 2.0 * radius_m;
        for other in tree.locate_within_distance(points[at].to_array(), reach_m * reach_m) {
            let apart_m = points[at].distance(points[other.data]);
            if radii[other.data] <= radius_m && apart_m <= radius_m + radii[other.data] {
                groups.join(at, other.data);
            }
        }
    }
    groups.collect(|at| points[at].is_finite())
}

/// Distance of each point to its nearest neighbour, but at least `least_m`, metres.
fn radii(points: &[DVec2], least_m: f64) -> Vec<f64> {
    let mut radii = vec![least_m.max(0.0); points.len()];
    // Points in one place are one vertex, and have a neighbour at no distance.
    let mut places: HashMap<[u64; 2], Vec<usize>> = HashMap::new();
    for (at, point) in points.iter().enumerate().filter(|(_, point)| point.is_finite()) {
        // Adding zero makes -0 the same place as 0.
        let key = (*point + DVec2::ZERO).to_array().map(f64::to_bits);
        places.entry(key).or_default().push(at);
    }
    let vertices = places.values().map(|same| Point2::from(points[same[0]].to_array())).collect();
    // Coordinates beyond what the triangulation bears are no places in a room.
    let Ok(net) = DelaunayTriangulation::<Point2<f64>>::bulk_load(vertices) else { return radii };
    for vertex in net.vertices() {
        let here = vertex.position();
        let place = DVec2::new(here.x, here.y);
        let key = place.to_array().map(f64::to_bits);
        let Some([only]) = places.get(&key).map(Vec::as_slice) else { continue };
        let nearest_m = vertex
            .out_edges()
            .map(|edge| edge.to().position())
            .map(|there| place.distance(DVec2::new(there.x, there.y)))
            .fold(f64::INFINITY, f64::min);
        if nearest_m.is_finite() {
            radii[*only] = radii[*only].max(nearest_m);
        }
    }
    radii
}

/// Disjoint sets.
struct Groups {
    parent: Vec<usize>,
}

impl Groups {
    fn new(count: usize) -> Self {
        Self { parent: (0..count).collect() }
    }

    fn root(&mut self, mut at: usize) -> usize {
        while self.parent[at] != at {
            self.parent[at] = self.parent[self.parent[at]];
            at = self.parent[at];
        }
        at
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.root(one), self.root(other));
        // The smallest index is the root, so that groups come out in rising order.
        self.parent[one.max(other)] = one.min(other);
    }

    fn collect(mut self, wanted: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = vec![Vec::new(); self.parent.len()];
        for at in (0..self.parent.len()).filter(|at| wanted(*at)) {
            let root = self.root(at);
            groups[root].push(at);
        }
        groups.retain(|group| !group.is_empty());
        groups
    }
}

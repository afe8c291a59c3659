//! Clusters by the sphere-of-influence graph.

use std::collections::HashMap;

use rstar::{RTree, primitives::GeomWithData};
use spade::{DelaunayTriangulation, Point2, Triangulation};

use sonard_model::geometry::DVec2;

/// Clusters points by the sphere-of-influence graph (G. Toussaint, "A graph-theoretical primal
/// sketch", 1988). Each point has a circle out to its nearest neighbour, of radius at least
/// `min_radius_m`; points whose circles intersect share a cluster.
///
/// Clusters and the indices in them are in ascending order; points that are not finite belong to
/// none. The nearest neighbour is adjacent in the Delaunay triangulation, so n points whose circles
/// intersect few others take O(n log n).
#[must_use]
pub fn clusters(points: &[DVec2], min_radius_m: f64) -> Vec<Vec<usize>> {
    let radii = radii(points, min_radius_m);
    let near: Vec<_> = (0..points.len())
        .filter(|&at| points[at].is_finite())
        .map(|at| GeomWithData::new(points[at].to_array(), at))
        .collect();
    let tree = RTree::bulk_load(near);
    let mut sets = DisjointSets::new(points.len());
    for (at, &radius_m) in radii.iter().enumerate() {
        if !points[at].is_finite() {
            continue;
        }
        // Circles not larger than this one intersect it within twice its radius; larger ones find
        // it.
        let reach_m = 2.0 * radius_m;
        for other in tree.locate_within_distance(points[at].to_array(), reach_m * reach_m) {
            let apart_m = points[at].distance(points[other.data]);
            if radii[other.data] <= radius_m && apart_m <= radius_m + radii[other.data] {
                sets.join(at, other.data);
            }
        }
    }
    sets.into_groups(|at| points[at].is_finite())
}

/// Distance of each point to its nearest neighbour, at least `min_m`, metres.
fn radii(points: &[DVec2], min_m: f64) -> Vec<f64> {
    let mut radii = vec![min_m.max(0.0); points.len()];
    // Coincident points are one vertex, and have a neighbour at distance zero.
    let mut places: HashMap<[u64; 2], Vec<usize>> = HashMap::new();
    for (at, point) in points.iter().enumerate().filter(|(_, point)| point.is_finite()) {
        // Adding zero turns -0 into 0.
        let key = (*point + DVec2::ZERO).to_array().map(f64::to_bits);
        places.entry(key).or_default().push(at);
    }
    let vertices = places.values().map(|same| Point2::from(points[same[0]].to_array())).collect();
    // Coordinates that the triangulation rejects lie outside any room.
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

/// Disjoint-set forest.
struct DisjointSets {
    parent: Vec<usize>,
}

impl DisjointSets {
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

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        // The smallest index is the root, so that groups are in ascending order.
        self.parent[a.max(b)] = a.min(b);
    }

    fn into_groups(mut self, filter: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = vec![Vec::new(); self.parent.len()];
        for at in (0..self.parent.len()).filter(|at| filter(*at)) {
            let root = self.root(at);
            groups[root].push(at);
        }
        groups.retain(|group| !group.is_empty());
        groups
    }
}

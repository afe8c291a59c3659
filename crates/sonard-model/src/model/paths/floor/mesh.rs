//! Triangle mesh of a scene's floor plan: a walk from triangle to triangle reaches walls in the
//! order in which sound does.

use std::collections::HashMap;

use rstar::{RTree, primitives::GeomWithData};
use smallvec::SmallVec;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use crate::geometry::{Arrangement, DVec2, distance_to_segment, edge_key};

/// Triangles between the walls, inside a box around the scene.
#[derive(Debug)]
pub(crate) struct Mesh {
    /// Wall ends and crossings, then the corners of the box.
    pub(crate) points: Vec<DVec2>,
    pub(crate) triangles: Vec<Triangle>,
    /// Triangle behind each side, wall or not; `u32::MAX` at the box.
    across: Vec<[u32; 3]>,
    /// Walls above or below another one at the same place, by [`between`] its ends.
    stacked: HashMap<[u32; 2], Vec<u32>>,
    /// Index of a triangle at each point.
    near: RTree<GeomWithData<[f64; 2], u32>>,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Triangle {
    /// Indices of the corners, counter-clockwise.
    pub(crate) corners: [u32; 3],
    /// Side `i` goes from corner `i` to corner `i + 1`.
    pub(crate) sides: [TriangleSide; 3],
}

/// Neighbour at a triangle's side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TriangleSide {
    /// Another triangle, through its side of that number.
    Open { triangle: u32, side: u8 },
    /// A wall, by its index.
    Wall(u32),
    /// The border of the box.
    Outside,
}

impl Mesh {
    /// Triangulates the walls in a box that is `margin_m` wider than they are. Returns `None` if
    /// there are no walls and no `extra` points, which the box has to contain too.
    pub(crate) fn new(
        plan: &Arrangement,
        stacked: HashMap<[u32; 2], Vec<u32>>,
        extra: &[DVec2],
        margin_m: f64,
    ) -> Option<Self> {
        let all = || plan.points.iter().chain(extra).copied();
        let low = all().reduce(DVec2::min)? - margin_m;
        let high = all().reduce(DVec2::max)? + margin_m;
        let mut points = plan.points.clone();
        points.extend([low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]);
        let cdt = triangulate(&points, plan);
        let triangles = triangles(&cdt, plan);
        let mut of_point = vec![0; points.len()];
        for (triangle, index) in triangles.iter().zip(0_u32..) {
            for corner in triangle.corners {
                of_point[corner as usize] = index;
            }
        }
        let near = points.iter().zip(of_point).map(|(p, t)| GeomWithData::new(p.to_array(), t));
        let near = RTree::bulk_load(near.collect());
        let across = cdt.inner_faces().map(|face| face.adjacent_edges().map(behind)).collect();
        Some(Self { points, triangles, across, stacked, near })
    }

    /// Returns the triangle behind a side, wall or not, and the index of the side there.
    pub(crate) fn beyond(&self, triangle: u32, side: usize) -> Option<(u32, u8)> {
        let other = *self.across[triangle as usize].get(side)?;
        let end = self.triangles[triangle as usize].corners[(side + 1) % 3];
        let corners = self.triangles.get(other as usize)?.corners;
        let side = corners.iter().position(|&corner| corner == end)?;
        Some((other, side as u8))
    }

    /// Walls above or below the one in a side.
    pub(crate) fn stacked(&self, triangle: u32, side: usize) -> &[u32] {
        if self.stacked.is_empty() {
            return &[];
        }
        let corners = self.triangles[triangle as usize].corners;
        let ends = [corners[side], corners[(side + 1) % 3]];
        self.stacked.get(&edge_key(ends)).map_or(&[], Vec::as_slice)
    }

    /// Returns the ends of all sides that are walls; a side of two triangles is listed twice.
    pub(crate) fn walls(&self) -> impl Iterator<Item = [DVec2; 2]> {
        self.triangles.iter().zip(0..).flat_map(move |(of, triangle)| {
            (0..3)
                .filter(|side| matches!(of.sides[*side], TriangleSide::Wall(_)))
                .map(move |side| self.side(triangle, side))
        })
    }

    /// Returns a corner of a triangle.
    pub(crate) fn corner(&self, triangle: u32, corner: usize) -> DVec2 {
        self.points[self.triangles[triangle as usize].corners[corner] as usize]
    }

    /// Returns the ends of a side of a triangle.
    pub(crate) fn side(&self, triangle: u32, side: usize) -> [DVec2; 2] {
        [side, (side + 1) % 3].map(|corner| self.corner(triangle, corner))
    }

    /// Returns the triangle that contains a point (one of them if it is on a side); `None` outside
    /// the box.
    ///
    /// Walks from a triangle at the nearest corner through sides that the point is beyond, by exact
    /// signs.
    pub(crate) fn locate(&self, point: DVec2) -> Option<u32> {
        let mut at = self.near.nearest_neighbor(point.to_array())?.data;
        // In a Delaunay mesh such a walk ends. The constraints of the walls may make it circle, in
        // which case a linear search decides.
        for _ in 0..self.triangles.len() {
            let Some(side) = (0..3).find(|&side| self.is_beyond(at, side, point)) else {
                return Some(at);
            };
            at = self.across[at as usize][side];
            if at == u32::MAX {
                return None;
            }
        }
        (0..self.triangles.len() as u32).find(|&triangle| self.holds(triangle, point))
    }

    /// Returns `true` if a point is in a triangle, sides included.
    pub(crate) fn holds(&self, triangle: u32, point: DVec2) -> bool {
        !(0..3).any(|side| self.is_beyond(triangle, side, point))
    }

    /// Returns the triangles that have points within `radius_m` of `center`.
    pub(crate) fn triangles_near(&self, center: DVec2, radius_m: f64) -> Vec<u32> {
        let Some(first) = self.locate(center) else { return Vec::new() };
        let mut found = vec![first];
        let mut next = 0;
        while let Some(&triangle) = found.get(next) {
            next += 1;
            for side in 0..3 {
                let behind = self.across[triangle as usize][side];
                let ends = [self.corner(triangle, side), self.corner(triangle, (side + 1) % 3)];
                let near = distance_to_segment(center, ends[0], ends[1]) <= radius_m;
                if near && behind != u32::MAX && !found.contains(&behind) {
                    found.push(behind);
                }
            }
        }
        found
    }

    /// Triangles around each point, counter-clockwise, each with the index of that corner.
    pub(crate) fn around_points(&self) -> Vec<SmallVec<[(u32, u8); 6]>> {
        let mut around: Vec<SmallVec<[(u32, u8); 6]>> = vec![SmallVec::new(); self.points.len()];
        for (triangle, index) in self.triangles.iter().zip(0..) {
            for (point, corner) in triangle.corners.into_iter().zip(0..) {
                around[point as usize].push((index, corner));
            }
        }
        for (triangles, &at) in around.iter_mut().zip(&self.points) {
            let direction = |&(t, corner): &(u32, u8)| {
                (self.corner(t, (corner as usize + 1) % 3) - at).to_angle()
            };
            triangles.sort_by(|a, b| direction(a).total_cmp(&direction(b)));
        }
        around
    }

    fn is_beyond(&self, triangle: u32, side: usize, point: DVec2) -> bool {
        let [a, b] = [self.corner(triangle, side), self.corner(triangle, (side + 1) % 3)];
        // The exact sign: a rounded one could leave a point between two triangles.
        let [a, b, p] = [a, b, point].map(|p| robust::Coord { x: p.x, y: p.y });
        robust::orient2d(a, b, p) < 0.0
    }
}

type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;

fn triangulate(points: &[DVec2], plan: &Arrangement) -> Cdt {
    let vertices = points.iter().map(|p| Point2::new(p.x, p.y)).collect();
    let edges = plan.pieces.iter().map(|piece| piece.ends.map(|end| end as usize)).collect();
    // Pieces touch at their ends only, and coordinates of a checked scene are finite, so neither
    // conflicts nor errors are possible.
    Cdt::try_bulk_load_cdt(vertices, edges, |_| debug_assert!(false, "walls cross"))
        .unwrap_or_default()
}

type Edge<'a> = spade::handles::DirectedEdgeHandle<'a, Point2<f64>, (), spade::CdtEdge<()>, ()>;

/// Returns the triangle behind an edge.
fn behind(edge: Edge) -> u32 {
    // Inner faces are numbered from 1; face 0 is the outside.
    edge.rev().face().as_inner().map_or(u32::MAX, |face| face.index() as u32 - 1)
}

fn triangles(cdt: &Cdt, plan: &Arrangement) -> Vec<Triangle> {
    let wall_of: HashMap<[u32; 2], u32> =
        plan.pieces.iter().map(|piece| (edge_key(piece.ends), piece.segment)).collect();
    let side = |edge: Edge| {
        let ends = edge.vertices().map(|vertex| vertex.index() as u32);
        if edge.is_constraint_edge()
            && let Some(&wall) = wall_of.get(&edge_key(ends))
        {
            return TriangleSide::Wall(wall);
        }
        let Some(face) = edge.rev().face().as_inner() else { return TriangleSide::Outside };
        let back = edge.rev().fix();
        let slot = face.adjacent_edges().iter().position(|other| other.fix() == back);
        TriangleSide::Open { triangle: behind(edge), side: slot.map_or(0, |slot| slot as u8) }
    };
    cdt.inner_faces()
        .map(|face| {
            let edges = face.adjacent_edges();
            Triangle {
                corners: edges.map(|edge| edge.from().index() as u32),
                sides: edges.map(side),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(segments: &[[f64; 4]]) -> Mesh {
        let segments: Vec<_> = segments
            .iter()
            .map(|&[ax, ay, bx, by]| (DVec2::new(ax, ay), DVec2::new(bx, by)))
            .collect();
        Mesh::new(&Arrangement::from_segments(&segments), HashMap::new(), &[], 10.0).expect("walls")
    }

    #[test]
    fn sides_are_mutual() {
        let mesh = mesh(&[[0.0, 0.0, 1.0, 0.0], [0.3, -1.0, 0.4, 2.0], [3.0, 0.5, 3.0, 0.9]]);
        let mut walls = 0;
        for (triangle, index) in mesh.triangles.iter().zip(0..) {
            for (i, side) in triangle.sides.iter().enumerate() {
                match *side {
                    TriangleSide::Open { triangle: other, side } => {
                        let back = mesh.triangles[other as usize].sides[side as usize];
                        assert_eq!(back, TriangleSide::Open { triangle: index, side: i as u8 });
                        let ends = [triangle.corners[i], triangle.corners[(i + 1) % 3]];
                        let other = mesh.triangles[other as usize].corners;
                        let side = side as usize;
                        assert_eq!(ends, [other[(side + 1) % 3], other[side]]);
                    }
                    TriangleSide::Wall(_) => walls += 1,
                    TriangleSide::Outside => {}
                }
            }
        }
        // Two crossing walls in two pieces each and a separate one, seen from both sides.
        assert_eq!(walls, 2 * 5);
    }

    #[test]
    fn locate_on_sides_and_behind_walls() {
        let mesh = mesh(&[[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 1.0, 1.0], [0.2, 0.2, 0.5, 0.7]]);
        for i in 0..40 {
            for j in 0..40 {
                let point = DVec2::new(f64::from(i) / 8.0 - 2.0, f64::from(j) / 8.0 - 2.0);
                let at = mesh.locate(point).expect("inside the box");
                assert!(mesh.holds(at, point), "{point}");
            }
        }
        assert_eq!(mesh.locate(DVec2::new(30.0, 0.0)), None);
    }
}

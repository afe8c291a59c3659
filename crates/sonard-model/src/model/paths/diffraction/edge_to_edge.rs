//! Rays from each upright edge to others.

use std::sync::{Arc, OnceLock};

use smallvec::SmallVec;

use super::edge_ray::is_same_departure;
use crate::model::paths::{
    beams::{Beams, UnfoldedRay},
    effort::{BOUND, Effort},
    floor::{ALONG_RAD, Mesh, TracingPlan},
    settings::PathSettings,
    tolerance::SAME_M,
};

/// Trees of beams from the edges of a scene, by point. A tree is grown on first use, for the
/// longest paths that the scene was prepared for, and serves all observation points.
#[derive(Debug)]
pub(crate) struct EdgeToEdge {
    from: Vec<OnceLock<FromEdge>>,
    /// Triangles around each point with the index of their corner there, counter-clockwise.
    around: Vec<SmallVec<[(u32, u8); 6]>>,
    max_path_m: f64,
    /// Total effort of all trees, because they are kept.
    pub(crate) effort: Arc<Effort>,
}

/// Rays from an edge to edges.
#[derive(Debug)]
pub(crate) struct FromEdge {
    /// Beams from the edge; `to_edges` is grouped by edge, shortest first.
    pub(crate) beams: Beams,
    /// For each ray, the presence of air on its left and on its right: along a wall a ray may have
    /// left on one side only.
    pub(crate) flanks: Vec<[bool; 2]>,
}

impl Default for EdgeToEdge {
    /// Creates an empty set.
    fn default() -> Self {
        let effort = Arc::new(Effort::new(BOUND));
        Self { from: Vec::new(), around: Vec::new(), max_path_m: 0.0, effort }
    }
}

impl EdgeToEdge {
    pub(crate) fn new(mesh: &Mesh, settings: &PathSettings) -> Self {
        let from = mesh.points.iter().map(|_| OnceLock::new()).collect();
        let effort = Arc::new(Effort::new(BOUND));
        Self { from, around: mesh.around_points(), max_path_m: settings.max_path_m, effort }
    }

    /// Returns the rays from an edge to edges.
    pub(crate) fn at(&self, plan: &TracingPlan, point: u32) -> &FromEdge {
        let grow = || {
            let plan = TracingPlan { effort: self.effort.clone(), ..plan.within(self.max_path_m) };
            FromEdge::grow(&plan, point, &self.around[point as usize])
        };
        self.from[point as usize].get_or_init(grow)
    }
}

impl FromEdge {
    fn grow(plan: &TracingPlan, point: u32, around: &[(u32, u8)]) -> Self {
        let mut beams = Beams::grow_from_corner(plan, point, around);
        let rays = std::mem::take(&mut beams.to_edges);
        let side = |ray: &UnfoldedRay| {
            let (triangle, corner) = *around.get(beams.root_slot(&plan.walls, ray.into()))?;
            let mesh = plan.mesh.as_ref()?;
            let at = mesh.corner(triangle, corner as usize);
            // A ray along the right border of its triangle has the triangle on the left.
            Some([1, 2].map(|next| {
                let border = mesh.corner(triangle, (corner as usize + next) % 3) - at;
                let off_m = border.perp_dot(ray.departure).abs();
                border.dot(ray.departure) > 0.0 && off_m <= ALONG_RAD * border.length()
            }))
        };
        let mut found: Vec<(u32, UnfoldedRay, [bool; 2])> =
            rays.iter().map(|(edge, ray)| (*edge, *ray, side(ray).unwrap_or_default())).collect();
        found.sort_by(|(first, a, _), (second, b, _)| {
            first.cmp(second).then(a.run.length_squared().total_cmp(&b.run.length_squared()))
        });
        let mut flanks: Vec<[bool; 2]> = Vec::with_capacity(found.len());
        for (edge, ray, sides) in found {
            match known(&beams.to_edges, edge, &ray) {
                // A ray that touches a corner, or runs along a wall, is found on both sides of it.
                Some(index) => {
                    let known = &mut flanks[index];
                    *known = [known[0] | sides[0], known[1] | sides[1]];
                }
                None => {
                    beams.to_edges.push((edge, ray));
                    flanks.push(sides);
                }
            }
        }
        Self { beams, flanks }
    }
}

/// Index of a ray among those already known, which are sorted by edge and length.
fn known(rays: &[(u32, UnfoldedRay)], edge: u32, ray: &UnfoldedRay) -> Option<usize> {
    let length_m = ray.run.length();
    rays.iter()
        .enumerate()
        .rev()
        .take_while(|(_, (to, other))| *to == edge && length_m - other.run.length() < SAME_M)
        .find(|(_, (_, other))| is_same_departure(ray, other))
        .map(|(index, _)| index)
}

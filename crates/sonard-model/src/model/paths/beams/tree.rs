//! Tree of beams from one start.

use super::{
    beam::{RayLeg, UnfoldedRay},
    lit::{LitCylinder, LitWall},
    slopes::Slopes,
};
use crate::{geometry::DVec2, model::paths::floor::WallMirror};

/// Node of a beam without a reflection. The numbers just below it are those of the beams from a
/// corner, one for each triangle around that corner.
pub(crate) const ROOT: u32 = u32::MAX;

/// Beams from one start: the walls that reflected them, and their rays to receiver, edges and
/// cylinders.
#[derive(Debug, Default)]
pub(crate) struct Beams {
    pub(crate) nodes: Vec<BeamNode>,
    /// Possible slopes of the rays.
    pub(crate) slopes: Slopes,
    /// Rays that reach the receiver.
    pub(crate) to_receiver: Vec<UnfoldedRay>,
    /// Rays that end at an edge, with the index of its point.
    pub(crate) to_edges: Vec<(u32, UnfoldedRay)>,
    /// Beams that hit a cylinder.
    pub(crate) to_cylinders: Vec<LitCylinder>,
    /// Visible parts of rough walls; consumed by scattering.
    pub(crate) on_rough_walls: Vec<LitWall>,
    /// Visible parts of walls with level edges; consumed by level-edge diffraction.
    pub(crate) below_level_edges: Vec<LitWall>,
}

/// A step in the history of beams.
///
/// A node keeps no ray, only the choice of walls. Which of two merged beams contained a ray follows
/// from the ray, by [`Beams::walls_back`].
#[derive(Debug, Clone, Copy)]
pub(crate) enum BeamNode {
    /// Reflection by a wall, after another node.
    Wall { wall: u32, before: u32 },
    /// Merge of two beams: rays to the left of `border` came from `left`.
    Merged { border: DVec2, left: u32, right: u32 },
}

impl Beams {
    /// Groups the rays by edge.
    pub(crate) fn sort_by_edge(&mut self) {
        self.to_edges.sort_by_key(|(point, _)| *point);
    }

    /// Returns the rays to an edge and the number of the first; requires [`Self::sort_by_edge`].
    pub(crate) fn rays_to_edge(&self, point: u32) -> (u32, &[(u32, UnfoldedRay)]) {
        let from = self.to_edges.partition_point(|ray| ray.0 < point);
        let count = self.to_edges[from..].partition_point(|ray| ray.0 == point);
        (from as u32, &self.to_edges[from..from + count])
    }

    /// Index of the triangle, around the corner where the tree began, in which a ray started.
    pub(crate) fn root_slot(&self, walls: &[WallMirror], leg: RayLeg) -> usize {
        let (mut at, mut run) = (leg.node, leg.run);
        while let Some(node) = self.nodes.get(at as usize) {
            match *node {
                BeamNode::Merged { border, left, right } => {
                    at = if border.perp_dot(run) >= 0.0 { left } else { right };
                }
                BeamNode::Wall { wall, before } => {
                    at = before;
                    run = walls[wall as usize].mirror.image_of_direction(run);
                }
            }
        }
        (ROOT - at) as usize
    }

    /// Walls that reflected a ray, last one first.
    ///
    /// Unfolds the ray backwards: in front of a wall the ray ran along the mirror image of its
    /// direction behind the wall. At a node where two beams merged, the sign of that direction
    /// relative to the common border decides which of the two contained the ray.
    pub(crate) fn walls_back<'a>(
        &'a self,
        walls: &'a [WallMirror],
        leg: RayLeg,
    ) -> impl Iterator<Item = u32> + 'a {
        let (mut at, mut run) = (leg.node, leg.run);
        std::iter::from_fn(move || {
            loop {
                match *self.nodes.get(at as usize)? {
                    BeamNode::Merged { border, left, right } => {
                        at = if border.perp_dot(run) >= 0.0 { left } else { right };
                    }
                    BeamNode::Wall { wall, before } => {
                        at = before;
                        run = walls[wall as usize].mirror.image_of_direction(run);
                        return Some(wall);
                    }
                }
            }
        })
    }
}

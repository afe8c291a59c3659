//! The tree of beams from one start.

use super::{
    beam::{Leg, Ray},
    lit::{LitSpan, View},
    slopes::Slopes,
};
use crate::{geometry::DVec2, model::paths::plan::WallMirror};

/// Marks a beam without a reflection. Below it are as many as there are triangles around a corner, for
/// the beams in each.
pub(crate) const ROOT: u32 = u32::MAX;

/// The beams from one start: the walls they met, and the rays in them to receiver, edges and cylinders.
#[derive(Debug, Default)]
pub(crate) struct Beams {
    pub(crate) nodes: Vec<Node>,
    /// How steeply the rays of beams can climb.
    pub(crate) slopes: Slopes,
    /// Rays that come to the receiver.
    pub(crate) to_receiver: Vec<Ray>,
    /// Rays that end at an edge, with the index of its point.
    pub(crate) to_edges: Vec<(u32, Ray)>,
    /// Beams that meet a cylinder.
    pub(crate) to_cylinders: Vec<View>,
    /// Parts of rough walls in sight, until scattering has taken them.
    pub(crate) on_rough_walls: Vec<LitSpan>,
    /// Parts in sight of walls with level edges, until these have taken them.
    pub(crate) below_level_edges: Vec<LitSpan>,
}

/// A step in the history of beams.
///
/// A node does not keep the ray, only the choice of walls: which of two merged beams a ray was in follows
/// from the ray, by [`Beams::walls_back`].
#[derive(Debug, Clone, Copy)]
pub(crate) enum Node {
    /// Reflected by a wall, after another node.
    Wall { wall: u32, before: u32 },
    /// Two beams merged: what runs on the left of `border` was at `left`.
    Merged { border: DVec2, left: u32, right: u32 },
}

impl Beams {
    /// Puts the rays to each edge side by side.
    pub(crate) fn sort_by_edge(&mut self) {
        self.to_edges.sort_by_key(|(point, _)| *point);
    }

    /// Rays to an edge, and the number of the first; sorted by edge.
    pub(crate) fn rays_to_edge(&self, point: u32) -> (u32, &[(u32, Ray)]) {
        let from = self.to_edges.partition_point(|ray| ray.0 < point);
        let count = self.to_edges[from..].partition_point(|ray| ray.0 == point);
        (from as u32, &self.to_edges[from..from + count])
    }

    /// In which of the triangles around the corner that it grew from a ray began.
    pub(crate) fn root_slot(&self, walls: &[WallMirror], leg: Leg) -> usize {
        let (mut at, mut run) = (leg.node, leg.run);
        while let Some(node) = self.nodes.get(at as usize) {
            match *node {
                Node::Merged { border, left, right } => {
                    at = if border.perp_dot(run) >= 0.0 { left } else { right };
                }
                Node::Wall { wall, before } => {
                    at = before;
                    run = walls[wall as usize].mirror.turn(run);
                }
            }
        }
        (ROOT - at) as usize
    }

    /// The walls that a ray met, last one first.
    ///
    /// Unfolds the ray backwards: before a wall it ran along the mirror image of its direction behind it,
    /// and at a node where two beams merged the sign of that direction beside the common border says in
    /// which of both it was.
    pub(crate) fn walls_back<'a>(
        &'a self,
        walls: &'a [WallMirror],
        leg: Leg,
    ) -> impl Iterator<Item = u32> + 'a {
        let (mut at, mut run) = (leg.node, leg.run);
        std::iter::from_fn(move || {
            loop {
                match *self.nodes.get(at as usize)? {
                    Node::Merged { border, left, right } => {
                        at = if border.perp_dot(run) >= 0.0 { left } else { right };
                    }
                    Node::Wall { wall, before } => {
                        at = before;
                        run = walls[wall as usize].mirror.turn(run);
                        return Some(wall);
                    }
                }
            }
        })
    }
}

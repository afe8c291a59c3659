//! The tree of beams from one place.

use super::{
    Face, Paths,
    beam::{Beam, Ray},
    interactions::{Leg, Part},
    rounds::Span,
    scatter::{Lit, Spot},
    tube::{Curved, Link},
    tubes::BentRay,
};
use crate::geometry::DVec2;

mod grow;

use grow::{Grower, ROOT};

/// What the beams from one place have met.
#[derive(Debug, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// Rays that come to the receiver.
    pub(super) returns: Vec<Ray>,
    /// Rays that end at an edge, with the index of its point.
    pub(super) to_edges: Vec<(u32, Ray)>,
    /// Beams that meet a cylinder.
    pub(super) to_cylinders: Vec<View>,
    /// Parts of rough walls in sight, until they have become `spots`.
    pub(super) lit: Vec<Lit>,
    /// Where rough walls send sound back.
    pub(super) spots: Vec<Spot>,
    /// Walls with limits where beams come to them, until their rims have been asked.
    pub(super) passed: Vec<Lit>,
    /// What tubes have met after their first cylinders.
    pub(super) links: Vec<Link>,
    /// Rays by way of cylinders that end at the receiver or at an edge.
    pub(super) curved: Vec<Curved>,
    /// Of these, the ones to edges.
    pub(super) bent_to_edges: Vec<BentRay>,
}

/// Where beams have been.
#[derive(Debug, Clone, Copy)]
enum Node {
    /// Reflected by a wall, after another node.
    Wall { wall: u32, before: u32 },
    /// Two beams joined: what runs on the left of `border` was at `left`.
    Joint { border: DVec2, left: u32, right: u32 },
}

/// A beam that meets a cylinder, all of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    pub(super) cylinder: u32,
    /// The part of the surface that it lights, radians.
    pub(super) span: Span,
    pub(super) beam: Beam,
}

impl Tree {
    /// All beams from `start` that can still give an echo at `target`.
    pub(super) fn grow(paths: &Paths, start: DVec2, target: DVec2) -> Self {
        let places = || {
            let mesh = paths.mesh.as_ref()?;
            Some((mesh, mesh.locate(start)?, mesh.locate(target)?))
        };
        let Some((mesh, first, home)) = places() else { return Self::default() };
        Grower::new(paths, mesh, start, target, home).grow(first)
    }

    /// All beams from a point of the mesh, whose triangles these are, for the rays in them to edges.
    pub(super) fn grow_from_corner(paths: &Paths, point: u32, around: &[(u32, u8)]) -> Self {
        let Some(mesh) = &paths.mesh else { return Self::default() };
        let Some(&(home, _)) = around.first() else { return Self::default() };
        let start = mesh.points[point as usize];
        let tree = Grower::new(paths, mesh, start, start, home).grow_from_corner(around);
        Self { nodes: tree.nodes, to_edges: tree.to_edges, ..Self::default() }
    }

    /// A ray to an edge by its number: those over walls alone first, then those by cylinders.
    pub(super) fn part(&self, ray: u32) -> Part {
        let ray = ray as usize;
        match ray.checked_sub(self.to_edges.len()) {
            None => Part::Flat((&self.to_edges[ray].1).into()),
            Some(bent) => Part::Curved(self.bent_to_edges[bent].ray.node),
        }
    }

    /// A ray to an edge over walls alone.
    pub(super) fn flat_ray(&self, ray: u32) -> Option<&Ray> {
        self.to_edges.get(ray as usize).map(|(_, ray)| ray)
    }

    /// Puts the rays to each edge side by side.
    pub(super) fn sort_by_edge(&mut self) {
        self.to_edges.sort_by_key(|(point, _)| *point);
        self.bent_to_edges.sort_by_key(|bent| bent.point);
    }

    /// The edges that are met, each once.
    pub(super) fn edges(&self) -> Vec<u32> {
        let flat = self.to_edges.chunk_by(|a, b| a.0 == b.0).map(|rays| rays[0].0);
        let mut edges: Vec<u32> = flat.collect();
        if !self.bent_to_edges.is_empty() {
            edges.extend(self.bent_to_edges.iter().map(|bent| bent.point));
            edges.sort_unstable();
            edges.dedup();
        }
        edges
    }

    /// Rays over walls alone to an edge, and the number of the first; sorted by edge.
    pub(super) fn flat_to(&self, point: u32) -> (u32, &[(u32, Ray)]) {
        let from = self.to_edges.partition_point(|ray| ray.0 < point);
        let count = self.to_edges[from..].partition_point(|ray| ray.0 == point);
        (from as u32, &self.to_edges[from..from + count])
    }

    /// The same for rays by way of cylinders.
    pub(super) fn bent_to(&self, point: u32) -> (u32, &[BentRay]) {
        let bent = &self.bent_to_edges;
        let from = bent.partition_point(|ray| ray.point < point);
        let count = bent[from..].partition_point(|ray| ray.point == point);
        ((self.to_edges.len() + from) as u32, &bent[from..from + count])
    }

    /// In which of the triangles around the corner that it grew from a ray began.
    pub(super) fn root_slot(&self, faces: &[Face], leg: Leg) -> usize {
        let (mut at, mut run) = (leg.node, leg.run);
        while let Some(node) = self.nodes.get(at as usize) {
            match *node {
                Node::Joint { border, left, right } => {
                    at = if border.perp_dot(run) >= 0.0 { left } else { right };
                }
                Node::Wall { wall, before } => {
                    at = before;
                    run = faces[wall as usize].mirror.turn(run);
                }
            }
        }
        (ROOT - at) as usize
    }

    /// The walls that a ray met, last one first.
    pub(super) fn walls_back<'a>(
        &'a self,
        faces: &'a [Face],
        leg: Leg,
    ) -> impl Iterator<Item = u32> + 'a {
        let (mut at, mut run) = (leg.node, leg.run);
        std::iter::from_fn(move || {
            loop {
                match *self.nodes.get(at as usize)? {
                    Node::Joint { border, left, right } => {
                        at = if border.perp_dot(run) >= 0.0 { left } else { right };
                    }
                    Node::Wall { wall, before } => {
                        at = before;
                        run = faces[wall as usize].mirror.turn(run);
                        return Some(wall);
                    }
                }
            }
        })
    }
}

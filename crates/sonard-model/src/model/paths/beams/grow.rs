//! Growth of the beam tree.

mod low_walls;
mod reflect;

use smallvec::SmallVec;

use super::{
    beam::{RayBeam, UnfoldedRay, reaches, reaches_well},
    lit::LitCylinder,
    shade::shade,
    tree::{Beams, ROOT},
};
use crate::{
    geometry::DVec2,
    model::{
        SearchPart,
        paths::{
            floor::{ALL_SLOPES, Mesh, TracingPlan, TriangleSide},
            tolerance::TIE_M,
        },
    },
};

/// Safety limit: no scene keeps a beam this long, but rounding could trap one.
const MAX_REFLECTIONS: u16 = 4096;

impl Beams {
    /// Traces all beams from `start` that can still give an echo at `target`.
    pub(crate) fn grow(plan: &TracingPlan, start: DVec2, target: DVec2) -> Self {
        let Some(mesh) = &plan.mesh else { return Self::in_the_open(plan, start, target) };
        let triangles = || Some((mesh.locate(start)?, mesh.locate(target)?));
        let Some((first, home)) = triangles() else {
            return Self::in_the_open(plan, start, target);
        };
        Grower::new(plan, mesh, start, target, home).grow(first)
    }

    /// Beams of a scene that has no walls or cylinders within reach, only perhaps floor and ceiling.
    fn in_the_open(plan: &TracingPlan, start: DVec2, target: DVec2) -> Self {
        let run = target - start;
        let (gain, node, order, slopes) = (1.0, ROOT, 0, ALL_SLOPES);
        let departure = run.normalize_or_zero();
        let straight = UnfoldedRay { run, departure, gain, node, order, slopes };
        let is_in_reach = run != DVec2::ZERO && run.length() <= plan.settings.max_path_m;
        let is_listed = plan.settings.direct && is_in_reach;
        let to_receiver = is_listed.then_some(straight).into_iter().collect();
        Self { to_receiver, ..Self::default() }
    }

    /// Traces all beams from a mesh point, given the triangles around it, for their rays to other
    /// edges.
    pub(crate) fn grow_from_corner(plan: &TracingPlan, point: u32, around: &[(u32, u8)]) -> Self {
        let Some(mesh) = &plan.mesh else { return Self::default() };
        let Some(&(home, _)) = around.first() else { return Self::default() };
        let start = mesh.points[point as usize];
        let mut grower = Grower::new(plan, mesh, start, start, home);
        // An edge re-emits sound from any height.
        grower.starts_level = false;
        let tree = grower.grow_from_corner(around);
        Self { nodes: tree.nodes, to_edges: tree.to_edges, ..Self::default() }
    }
}

/// Grows a tree order by order (breadth first).
///
/// Invariant: beams of one order lie side by side in `next`, counter-clockwise by departure. Beams
/// that a corner has split and that reach the same image again are therefore adjacent and can be
/// merged. Without that, each corner seen in a room of right angles would cut beams for good, and
/// their number would grow with the cube of the range instead of its square.
struct Grower<'a> {
    plan: &'a TracingPlan,
    mesh: &'a Mesh,
    start: DVec2,
    /// Receiver; usually the start.
    target: DVec2,
    /// Triangle of the target.
    home: u32,
    max_reflections: u16,
    /// `true` if beams start at the transducer's height, so that slopes determine heights.
    starts_level: bool,
    /// Parts of the current beam still to be followed, each with the side through which it leaves,
    /// or `None` for what cylinders have left of it.
    parts: Vec<(RayBeam, Option<usize>)>,
    next: Vec<RayBeam>,
    /// Beams of the next order by walls stacked above or below others; these are not merged.
    stacked: Vec<RayBeam>,
    tree: Beams,
}

impl<'a> Grower<'a> {
    fn new(plan: &'a TracingPlan, mesh: &'a Mesh, start: DVec2, target: DVec2, home: u32) -> Self {
        let max_reflections =
            plan.settings.max_order.unwrap_or(MAX_REFLECTIONS).min(MAX_REFLECTIONS);
        let (parts, next, stacked) = Default::default();
        let tree = Beams::default();
        let starts_level = true;
        Self {
            plan,
            mesh,
            start,
            target,
            home,
            max_reflections,
            starts_level,
            parts,
            next,
            stacked,
            tree,
        }
    }

    /// Traces all beams of a start inside a triangle.
    fn grow(mut self, triangle: u32) -> Beams {
        self.expand_start(self.first(triangle), None);
        self.finish()
    }

    /// Traces all beams of a start that is a corner of these triangles. Paths to another corner and
    /// back to this one bound the paths by both corners to any receiver, which are no shorter.
    fn grow_from_corner(mut self, around: &[(u32, u8)]) -> Beams {
        for (&(triangle, corner), slot) in around.iter().zip(0..) {
            let first = RayBeam { node: ROOT - slot, ..self.first(triangle) };
            let side = (corner as usize + 1) % 3;
            let ends = [side, (side + 1) % 3];
            for end in ends {
                self.add_near_edge(&first, self.mesh.triangles[triangle as usize].corners[end]);
            }
            let [right, left] = ends.map(|end| self.mesh.corner(triangle, end) - self.start);
            for part in self.shaded(RayBeam { right, left, ..first }) {
                let beam = self.leave(part, side);
                self.follow(beam);
            }
        }
        self.finish()
    }

    fn first(&self, triangle: u32) -> RayBeam {
        RayBeam {
            image: self.start,
            right: DVec2::ZERO,
            left: DVec2::ZERO,
            turn: DVec2::X,
            gain: 1.0,
            detectable_m: self.plan.settings.detectable_m(),
            node: ROOT,
            triangle,
            side: 0,
            mirrored: false,
            is_level: true,
            order: 0,
            slopes: ALL_SLOPES,
        }
    }

    fn finish(mut self) -> Beams {
        let mut beams = Vec::new();
        loop {
            std::mem::swap(&mut beams, &mut self.next);
            beams.append(&mut self.stacked);
            if beams.is_empty() {
                break;
            }
            for beam in beams.drain(..) {
                if self.plan.effort.is_over() {
                    break;
                }
                self.follow(Some(beam));
            }
        }
        self.tree
    }

    /// Starts beams through the sides of the start's triangle, and rays to its corners. A start on
    /// a side is also expanded in the triangle behind that side.
    fn expand_start(&mut self, first: RayBeam, entered_by: Option<usize>) {
        let (mesh, start) = (self.mesh, self.start);
        let triangle = mesh.triangles[first.triangle as usize];
        let to_corner = |corner: usize| mesh.corner(first.triangle, corner) - start;
        match entered_by {
            None => triangle.corners.iter().for_each(|&corner| self.add_near_edge(&first, corner)),
            Some(side) => self.add_near_edge(&first, triangle.corners[(side + 2) % 3]),
        }
        if first.triangle == self.home && self.plan.settings.direct {
            self.add_direct_ray(&first);
        }
        // Counter-clockwise, from the side after the entry side.
        let from = entered_by.map_or(0, |side| side + 1);
        for side in (from..from + 3).map(|side| side % 3).filter(|&s| Some(s) != entered_by) {
            let (right, left) = (to_corner(side), to_corner((side + 1) % 3));
            let on_side = right.perp_dot(left) <= TIE_M * (left - right).length();
            match triangle.sides[side] {
                TriangleSide::Open { triangle, side } if on_side && entered_by.is_none() => {
                    self.expand_start(RayBeam { triangle, ..first }, Some(side as usize));
                }
                _ if on_side => {}
                _ => {
                    for part in self.shaded(RayBeam { right, left, ..first }) {
                        let beam = self.leave(part, side);
                        self.follow(beam);
                    }
                }
            }
        }
    }

    /// Follows a beam and the parts that split off it to their walls, counter-clockwise by
    /// departure.
    fn follow(&mut self, beam: Option<RayBeam>) {
        let mut at_hand = beam;
        loop {
            while let Some(beam) = at_hand {
                at_hand = self.cross(beam);
            }
            let Some((part, side)) = self.parts.pop() else { return };
            at_hand = match side {
                Some(side) => self.leave(part, side),
                None => self.pass(part),
            };
        }
    }

    /// Takes a beam through its triangle, past the cylinders in it.
    fn cross(&mut self, beam: RayBeam) -> Option<RayBeam> {
        if beam.triangle == self.home && (beam.node != ROOT || self.plan.settings.direct) {
            self.add_ray_to_target(&beam);
        }
        if self.plan.cylinders.in_triangle(beam.triangle).is_empty() {
            return self.pass(beam);
        }
        let passing = self.shaded(beam);
        self.parts.extend(passing.into_iter().rev().map(|part| (part, None)));
        None
    }

    /// Returns the parts of a beam that cylinders in its triangle let pass, counter-clockwise by
    /// departure.
    fn shaded(&mut self, beam: RayBeam) -> SmallVec<[RayBeam; 2]> {
        let known = self.tree.to_cylinders.len();
        let mut passing = shade(&self.plan.cylinders, &beam, &mut self.tree.to_cylinders);
        self.plan.effort.keep::<LitCylinder>(self.tree.to_cylinders.len() - known);
        if beam.mirrored {
            passing.reverse();
        }
        passing
    }

    /// Takes a beam past its cylinders through its triangle. Where the far corner splits it, the
    /// second part is queued.
    ///
    /// Invariant: each ray leaves by one side. The sign of `border x run` (`run` from the image to
    /// the far corner) decides on which side of the corner a border passes. Parts are followed
    /// counter-clockwise by departure, which behind an odd number of mirrors is clockwise by
    /// direction.
    fn pass(&mut self, beam: RayBeam) -> Option<RayBeam> {
        let side = beam.side as usize;
        let (right_side, left_side) = ((side + 1) % 3, (side + 2) % 3);
        let corner = self.mesh.triangles[beam.triangle as usize].corners[left_side];
        let run = self.mesh.points[corner as usize] - beam.image;
        if reaches(beam.right, run) && reaches(run, beam.left) {
            self.add_ray_to_edge(&beam, corner);
        }
        // A corner on a border sends the whole beam past it, on the other side.
        if !reaches_well(beam.right, run) {
            return self.leave(beam, left_side);
        }
        if !reaches_well(run, beam.left) {
            return self.leave(beam, right_side);
        }
        let (right, left) = (RayBeam { left: run, ..beam }, RayBeam { right: run, ..beam });
        if beam.mirrored {
            self.parts.push((right, Some(right_side)));
            self.leave(left, left_side)
        } else {
            self.parts.push((left, Some(left_side)));
            self.leave(right, right_side)
        }
    }

    /// Returns the beam in the triangle behind a side, or `None` if a wall reflects it or no echo
    /// is possible.
    fn leave(&mut self, beam: RayBeam, side: usize) -> Option<RayBeam> {
        if !self.plan.effort.step(SearchPart::Beams, 1) {
            return None;
        }
        match self.mesh.triangles[beam.triangle as usize].sides[side] {
            TriangleSide::Open { triangle, side } => {
                let next = RayBeam { triangle, side, ..beam };
                self.may_return(&next).then_some(next)
            }
            TriangleSide::Wall(wall) => {
                self.reflect(&beam, wall, side);
                for &other in self.mesh.stacked(beam.triangle, side) {
                    let next = self.reflected(&beam, other, side);
                    self.stacked.extend(next);
                }
                let slopes = self.slopes_behind(&beam, wall, side)?;
                let (triangle, side) = self.mesh.beyond(beam.triangle, side)?;
                let is_level = beam.is_level && self.plan.climbs.is_passed_by_level(wall);
                let next = RayBeam { triangle, side, slopes, is_level, ..beam };
                self.may_return(&next).then_some(next)
            }
            TriangleSide::Outside => None,
        }
    }

    /// Returns `true` if a beam can be back within its longest path through its entry side: a cheap
    /// test at each side.
    fn may_return(&self, beam: &RayBeam) -> bool {
        let [a, b] = self.mesh.side(beam.triangle, beam.side as usize);
        let middle = 0.5 * (a + b);
        let (out, back) =
            (middle.distance_squared(beam.image), middle.distance_squared(self.target));
        let longest_m = self.longest_m(beam);
        // With distances p and q from the side's middle, no path through the side is shorter than p
        // + q - |ab|; (p + q)^2 <= 2 p^2 + 2 q^2 avoids the roots for most beams.
        2.0 * (out + back) <= longest_m * longest_m
            || out.sqrt() + back.sqrt() - a.distance(b) <= longest_m
    }

    fn longest_m(&self, beam: &RayBeam) -> f64 {
        beam.detectable_m.min(self.plan.settings.max_path_m)
    }

    fn add_ray_to_target(&mut self, beam: &RayBeam) {
        let run = self.target - beam.image;
        let is_in_reach = run.length_squared() <= self.longest_m(beam).powi(2);
        let is_hidden = || {
            let [a, b] = self.mesh.side(beam.triangle, beam.side as usize);
            let share = (a - beam.image).perp_dot(b - a) / run.perp_dot(b - a);
            self.plan.cylinders.hide_in(beam.triangle, beam.image + share * run, self.target)
        };
        if beam.holds(run) && is_in_reach && !is_hidden() {
            self.tree.to_receiver.push(beam.ray_to(self.target));
        }
    }

    /// Adds the direct ray to a target in the triangle of the start.
    fn add_direct_ray(&mut self, first: &RayBeam) {
        let length_m = self.target.distance(self.start);
        let is_in_reach = length_m > 0.0 && length_m <= self.plan.settings.max_path_m;
        if is_in_reach && !self.plan.cylinders.hide_in(first.triangle, self.start, self.target) {
            self.tree.to_receiver.push(first.ray_to(self.target));
        }
    }

    fn add_ray_to_edge(&mut self, beam: &RayBeam, point: u32) {
        let at = self.mesh.points[point as usize];
        if self.plan.corners.diffracts(point, at - beam.image) {
            self.plan.effort.keep::<(u32, UnfoldedRay)>(1);
            self.tree.to_edges.push((point, beam.ray_to(at)));
        }
    }

    /// Adds the ray to an edge in the triangle of the start, which no cylinder has shaded yet.
    fn add_near_edge(&mut self, beam: &RayBeam, point: u32) {
        let at = self.mesh.points[point as usize];
        if !self.plan.cylinders.hide_in(beam.triangle, self.start, at) {
            self.add_ray_to_edge(beam, point);
        }
    }
}

//! Tubes of rays, from their first cylinder on.
//!
//! A beam that meets a cylinder has no image behind it any more. What is left of it is a tube:
//! the rays between two border rays, each known by where it touched the first cylinder. Cylinders
//! are convex, so the rays of a tube spread and never cross: seen from any point they pass by in
//! order. So the tube walks the mesh as a beam does, and where a beam finds by a sign on which
//! side of a corner a ray passes, a tube finds the one ray through it as the zero of a monotone
//! function. Corners, the tangents of other cylinders, and walls split it; each ray from the start
//! is in exactly one tube, as it is in one beam.
//!
//! Tubes end as arms at the next cylinder ([`super::arms`]), out of which echoes are made, and from
//! which the next level of tubes begins; and they hold rays to edges. They are followed as long as
//! one of both can still be heard.

mod meet;
mod part;

use smallvec::SmallVec;

use super::{
    Paths,
    arms::{Arm, DIRECT, LOUDER, Leaves, Partners, Strength},
    beam::Ray,
    mesh::Side,
    rounds::{Circle, Span},
    trace::{Tree, View},
    tube::{Curved, FIRST, Front, Link, Surfaces, Tracer, surfaces_to},
};
use crate::{
    geometry::{DVec2, distance_to_segment, wrap_pi},
    model::Reflector,
};
use part::{Tube, ray_through, split};

/// Rays that cylinders have turned to edges are followed from this much above the weakest sound
/// that is asked for, so with 20 dB below the threshold for that, down to the threshold.
const EDGES_ABOVE: f64 = 10.0;

/// An edge sends back half of a mirror's echo at most: what it takes from it at its boundary.
const EDGE_MOST: f64 = 0.5;

/// Rays to an edge by way of a cylinder.
#[derive(Debug, Clone, Copy)]
pub(super) struct BentRay {
    pub(super) point: u32,
    /// `run` is the last leg's direction times the whole length; `node` says which
    /// [`Tree::curved`] it is.
    pub(super) ray: Ray,
    pub(super) width_m: f64,
    /// Radius of curvature of the wave front, metres.
    pub(super) radius_m: f64,
}

/// Follows the tubes of a tree, level by level.
pub(super) struct TubeGrower<'a> {
    paths: &'a Paths,
    pub(super) tree: &'a mut Tree,
    target: DVec2,
    views: Vec<View>,
    waiting: Vec<Tube>,
    /// All so far, those of the last level at the end.
    pub(super) arms: Vec<Arm>,
    /// Where the last level begins.
    last: usize,
    has_edges: bool,
    /// Largest cylinder, metres.
    radius_m: f64,
}

impl<'a> TubeGrower<'a> {
    /// For the beams that met cylinders, and echoes to `target`. Has the arms of level 0.
    pub(super) fn new(paths: &'a Paths, tree: &'a mut Tree, target: DVec2) -> Self {
        let views = std::mem::take(&mut tree.to_cylinders);
        let radii = paths.rounds.circles.iter().map(|circle| circle.radius_m);
        let radius_m = radii.fold(0.0, f64::max);
        // Where beams find none, tubes are not followed for them.
        let has_edges = !tree.to_edges.is_empty();
        let (waiting, arms) = (Vec::new(), Vec::new());
        let mut grower =
            Self { paths, tree, target, views, waiting, arms, last: 0, has_edges, radius_m };
        for view in 0..grower.views.len() as u32 {
            grower.begin(view);
        }
        grower
    }

    /// The strongest of the last level.
    pub(super) fn last_level(&self) -> &[Arm] {
        &self.arms[self.last..]
    }

    /// Follows the arms of the last level on to those of the next one, as far as there are
    /// partners for them. False if there are none left.
    pub(super) fn grow(&mut self, partners: &Partners) -> bool {
        let level = self.last..self.arms.len();
        self.last = self.arms.len();
        for index in level {
            self.launch(index, partners);
            while let Some(tube) = self.waiting.pop() {
                self.follow(&tube);
            }
        }
        self.last < self.arms.len()
    }

    /// Gives the views back to the tree, and the arms out.
    pub(super) fn finish(self) -> Vec<Arm> {
        self.tree.to_cylinders = self.views;
        self.arms
    }

    fn begin(&mut self, index: u32) {
        let View { cylinder, span, beam } = self.views[index as usize];
        if !self.paths.settings.allows(beam.order + 1) {
            return;
        }
        let tracer = Tracer { paths: self.paths, view: &self.views[index as usize], surfaces: &[] };
        let ends = [span.from_rad, span.to_rad];
        // As they leave: before its first cylinder a ray has no front.
        let borders = ends.map(|at| tracer.front(at));
        let circle = tracer.circle();
        let nearest_rad = (beam.image - circle.center).to_angle();
        let ends = ends.map(|at| tracer.first_contact(at));
        let middle = 0.5 * (span.from_rad + span.to_rad);
        let away = wrap_pi(nearest_rad - middle).abs();
        let length_m = if away < 0.5 * (span.to_rad - span.from_rad) {
            beam.image.distance(circle.center) - circle.radius_m
        } else {
            ends[0].length_m.min(ends[1].length_m)
        };
        let one_way = [length_m, length_m, 1.0];
        self.arms.push(Arm {
            cylinder,
            view: index,
            link: DIRECT,
            surfaces: Surfaces::new(),
            level: 0,
            order: beam.order,
            gain: beam.gain,
            span,
            borders,
            mirrored: true,
            triangle: beam.triangle,
            ends,
            leaves: Leaves::between(tracer.departure(span.from_rad), tracer.departure(span.to_rad)),
            least_m: length_m,
            strength: Strength::of(beam.gain, one_way, self.radius_m, self.paths),
        });
    }

    /// Sends what an arm's cylinder reflects on its way, if it is worth it.
    fn launch(&mut self, index: usize, partners: &Partners) {
        let arm = &self.arms[index];
        let partner = partners.best(&arm.leaves);
        let order = arm.order + 1;
        let circle = &self.paths.rounds.circles[arm.cylinder as usize];
        let floor = self.paths.settings.round_floor(1, arm.least_m + self.back_m(circle));
        let is_heard = arm.strength.with(&partner) >= floor.powi(2);
        if !(is_heard || self.has_edges) || !self.paths.settings.allows(order + 1) {
            return;
        }
        let surface = Reflector::Cylinder(arm.cylinder);
        let (link, borders) = if arm.link == DIRECT {
            (FIRST, arm.borders)
        } else {
            self.tree.links.push(Link { surface, before: arm.link });
            let borders = arm.borders.map(|border| self.paths.off(&border, surface));
            (self.tree.links.len() as u32 - 1, borders)
        };
        let tube = Tube {
            view: arm.view,
            link,
            span: arm.span,
            borders,
            mirrored: !arm.mirrored,
            triangle: arm.triangle,
            side: None,
            gain: arm.gain * circle.gain,
            order,
            level: arm.level + 1,
            partner,
        };
        let mut surfaces = arm.surfaces.clone();
        if arm.link != DIRECT {
            surfaces.push(surface);
        }
        let tracer =
            Tracer { paths: self.paths, view: &self.views[arm.view as usize], surfaces: &surfaces };
        split(&tube, &tracer, circle, 0, partners, &mut self.waiting);
    }

    /// Takes a tube through its triangle: what is in it, what it meets there, where it leaves.
    fn follow(&mut self, tube: &Tube) {
        if !self.is_worth(tube) {
            return;
        }
        let surfaces = surfaces_to(&self.tree.links, tube.link);
        let paths = self.paths;
        let view = self.views[tube.view as usize];
        let tracer = Tracer { paths, view: &view, surfaces: &surfaces };
        let mut cuts: SmallVec<[f64; 8]> = self.meet_corners(tube, &tracer);
        let hits = self.meet_arcs(tube, &tracer);
        cuts.extend(hits.iter().flat_map(|span| [span.from_rad, span.to_rad]));
        cuts.sort_by(f64::total_cmp);
        let inside = cuts.iter().filter(|&&at| tube.span.from_rad < at && at < tube.span.to_rad);
        let inside = inside.map(|&at| (at, tracer.front(at)));
        let [from, to] = tube.borders;
        let first = (tube.span.from_rad, from);
        let ends: SmallVec<[(f64, Front); 8]> =
            [first].into_iter().chain(inside).chain([(tube.span.to_rad, to)]).collect();
        for pair in ends.windows(2) {
            let span = Span { from_rad: pair[0].0, to_rad: pair[1].0 };
            let middle = 0.5 * (span.from_rad + span.to_rad);
            let is_hit = hits.iter().any(|hit| hit.from_rad < middle && middle < hit.to_rad);
            if !is_hit && span.to_rad > span.from_rad {
                let part = Tube { span, borders: [pair[0].1, pair[1].1], ..*tube };
                self.leave(&part, &tracer.front(middle));
            }
        }
    }

    /// Whether an echo of the tube can still be short and strong enough.
    fn is_worth(&self, tube: &Tube) -> bool {
        let settings = &self.paths.settings;
        let left_m = tube.side.map_or(0.0, |side| {
            let [a, b] = self.side_of(tube.triangle, side as usize);
            distance_to_segment(self.target, a, b)
        });
        let length_m = tube.least(|front| front.length_m);
        let least_m = length_m + left_m;
        if least_m > settings.max_path_m {
            return false;
        }
        let width_m = tube.least(|front| front.width_m);
        let growth = tube.least(|front| front.growth);
        let spread = [length_m, width_m, growth];
        let strength = Strength::of(tube.gain, spread, self.radius_m, self.paths);
        strength.with(&tube.partner) >= settings.round_floor(1, least_m).powi(2)
            || self.has_edges && self.is_worth_an_edge(tube.gain, spread)
    }

    /// Whether an edge could send back enough of rays that have spread so. With any partner the
    /// power is at most `L / w + 1 / g` of a mirror's, by the same reasoning as for arms.
    fn is_worth_an_edge(&self, gain: f64, [length_m, width_m, growth]: [f64; 3]) -> bool {
        let settings = &self.paths.settings;
        let loss = EDGE_MOST * gain * settings.air_gain(length_m);
        LOUDER * loss * loss * (length_m / width_m + 1.0 / growth)
            >= (EDGES_ABOVE * settings.floor).powi(2)
    }

    /// The shortest way back from a cylinder, metres.
    fn back_m(&self, circle: &Circle) -> f64 {
        (self.target.distance(circle.center) - circle.radius_m).max(0.0)
    }

    fn side_of(&self, triangle: u32, side: usize) -> [DVec2; 2] {
        let Some(mesh) = &self.paths.mesh else { return [DVec2::ZERO; 2] };
        [side, (side + 1) % 3].map(|corner| mesh.corner(triangle, corner))
    }

    /// Rays to the corners of the tube's triangle that are edges, and where corners split it.
    fn meet_corners(&mut self, tube: &Tube, tracer: &Tracer) -> SmallVec<[f64; 8]> {
        let Some(mesh) = &self.paths.mesh else { return SmallVec::new() };
        let corners = mesh.triangles[tube.triangle as usize].corners;
        let far = tube.side.map(|side| (side as usize + 2) % 3);
        let mut cuts = SmallVec::new();
        for (index, &corner) in corners.iter().enumerate() {
            if far.is_some_and(|far| far != index) {
                continue;
            }
            let place = mesh.points[corner as usize];
            let Some((at, front)) = ray_through(tube, tracer, place) else { continue };
            cuts.push(at);
            if self.has_edges {
                self.meet_edge(tube, tracer, corner, at, &front.moved(front.ahead_m(place)));
            }
        }
        cuts
    }

    fn meet_edge(&mut self, tube: &Tube, tracer: &Tracer, point: u32, at: f64, end: &Front) {
        let spread = [end.length_m, end.width_m, end.growth];
        if !self.paths.edges.answers(point, end.along) || !self.is_worth_an_edge(tube.gain, spread)
        {
            return;
        }
        let curved = &mut self.tree.curved;
        curved.push(Curved { view: tube.view, link: tube.link, contact_rad: at });
        let ray = Ray {
            run: end.length_m * end.along,
            departure: tracer.departure(at),
            gain: tube.gain,
            node: curved.len() as u32 - 1,
            order: tube.order,
        };
        let (width_m, radius_m) = (end.width_m, end.radius_m());
        self.tree.bent_to_edges.push(BentRay { point, ray, width_m, radius_m });
    }

    fn reflected(&mut self, tube: &Tube, wall: u32) -> Tube {
        let surface = Reflector::Wall(wall);
        let borders = tube.borders.map(|border| self.paths.off(&border, surface));
        let links = &mut self.tree.links;
        links.push(Link { surface, before: tube.link });
        Tube {
            link: links.len() as u32 - 1,
            mirrored: !tube.mirrored,
            gain: tube.gain * self.paths.faces[wall as usize].gain,
            order: tube.order + 1,
            borders,
            ..*tube
        }
    }

    /// Sends a part on through the side by which its middle ray leaves.
    fn leave(&mut self, tube: &Tube, middle: &Front) {
        let Some(mesh) = &self.paths.mesh else { return };
        let triangle = &mesh.triangles[tube.triangle as usize];
        let distance_m = |side: usize| {
            let [a, b] = self.side_of(tube.triangle, side);
            let outward = -(b - a).perp();
            let slant = outward.dot(middle.along);
            // A ray that starts on a side by rounding outside leaves by it at once.
            if slant > 0.0 {
                (outward.dot(a - middle.origin) / slant).max(0.0)
            } else {
                f64::INFINITY
            }
        };
        let sides = (0..3).filter(|&side| tube.side != Some(side as u8));
        let Some(side) = sides.min_by(|&a, &b| distance_m(a).total_cmp(&distance_m(b))) else {
            return;
        };
        match triangle.sides[side] {
            Side::Open { triangle, side } => {
                self.waiting.push(Tube { triangle, side: Some(side), ..*tube });
            }
            Side::Wall(wall) => {
                if self.paths.settings.allows(tube.order + 1) {
                    let stacked = mesh.stacked(tube.triangle, side).iter().copied();
                    for wall in std::iter::once(wall).chain(stacked) {
                        let next = self.reflected(tube, wall);
                        self.waiting.push(Tube { side: Some(side as u8), ..next });
                    }
                }
                if self.paths.heights.lets_pass(wall)
                    && let Some((triangle, side)) = mesh.beyond(tube.triangle, side)
                {
                    self.waiting.push(Tube { triangle, side: Some(side), ..*tube });
                }
            }
            Side::Outside => {}
        }
    }
}

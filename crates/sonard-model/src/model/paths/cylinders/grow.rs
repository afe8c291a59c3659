//! Tubes of rays, from their first cylinder onwards.
//!
//! A beam that hits a cylinder has no image behind it any more. It continues as a tube: the rays
//! between two border rays, each identified by its contact with the first cylinder. Cylinders are
//! convex, so the rays of a tube spread and never cross: seen from any point they pass in order. A
//! tube therefore walks the mesh as a beam does. A beam determines by a sign on which side of a
//! corner a ray passes; a tube finds the one ray through the corner as the zero of a monotone
//! function. Corners, the tangents of other cylinders, and walls split a tube. Each ray from the
//! start is in exactly one tube, as it is in one beam.
//!
//! Tubes end as half-paths at the next cylinder, from which echoes are composed and the next level
//! of tubes begins. They also contain rays to edges. Tubes are followed as long as either can still
//! be detected.

use smallvec::SmallVec;

use super::{
    departures::Departures,
    front::Front,
    half_path::{DIRECT, HalfPath},
    hits::Hits,
    partners::{Partners, PartnersByLength},
    rays::{CylinderRay, CylinderRays, FIRST, SpreadRay, SurfaceLink, Surfaces, surfaces_to},
    strength::{POWER_MARGIN, Strength},
    tracer::Tracer,
    tube::{Tube, advanced, min_length_m, min_spread, ray_through, split},
};
use crate::{
    geometry::{DVec2, distance_to_segment, wrap_pi},
    model::{
        Reflector, SearchPart,
        paths::{
            beams::{Beams, LitCylinder, UnfoldedRay},
            floor::{AngleSpan, PlanCircle, TracingPlan, TriangleSide},
            settings::PathSettings,
            tolerance::TIE_M,
        },
    },
};

/// Effort of a tube in a triangle, in steps of a beam.
const STEPS_PER_TUBE: usize = 16;

/// Largest gain of an edge: that of a mirror, half of each of two images whose boundaries coincide.
const MAX_EDGE_GAIN: f64 = 1.0;

/// Traces the tubes from one start, level by level: a tube of level `n` has touched `n` cylinders.
pub(crate) struct TubeGrower<'a> {
    pub(crate) plan: &'a TracingPlan,
    target: DVec2,
    views: &'a [LitCylinder],
    rays: CylinderRays,
    waiting: Vec<Tube>,
    /// Best partners of the waiting tubes, by [`Tube::partners`].
    partners: Vec<PartnersByLength>,
    /// All half-paths so far, those of the last level at the end.
    pub(crate) half_paths: Vec<HalfPath>,
    /// Index at which the last level begins.
    last: usize,
    pub(crate) has_edges: bool,
    /// Radius of the largest cylinder, metres.
    pub(crate) radius_m: f64,
}

impl<'a> TubeGrower<'a> {
    /// Creates a grower with the half-paths of level 0, for the beams that hit cylinders and echoes
    /// to `target`.
    pub(crate) fn new(plan: &'a TracingPlan, beams: &'a Beams, target: DVec2) -> Self {
        let radii = plan.cylinders.circles.iter().map(|circle| circle.radius_m);
        let mut grower = Self {
            plan,
            target,
            views: &beams.to_cylinders,
            rays: CylinderRays::default(),
            waiting: Vec::new(),
            partners: Vec::new(),
            half_paths: Vec::new(),
            last: 0,
            // Where beams find no edge, tubes are not followed to edges.
            has_edges: !beams.to_edges.is_empty(),
            radius_m: radii.fold(0.0, f64::max),
        };
        for view in 0..grower.views.len() as u32 {
            grower.begin(view);
        }
        grower
    }

    /// Half-paths of the last level.
    pub(crate) fn last_level(&self) -> &[HalfPath] {
        &self.half_paths[self.last..]
    }

    /// Extends the half-paths of the last level to those of the next one, as far as there are
    /// partners for them. Returns `false` if none are left.
    pub(crate) fn grow(&mut self, partners: &Partners) -> bool {
        let level = self.last..self.half_paths.len();
        self.last = self.half_paths.len();
        for index in level {
            self.launch(index, partners);
            while let Some(tube) = self.waiting.pop() {
                let known = [self.half_paths.len(), self.rays.to_edges.len()];
                self.follow(&tube);
                self.plan.effort.keep::<HalfPath>(self.half_paths.len() - known[0]);
                self.plan.effort.keep::<SpreadRay>(2 * (self.rays.to_edges.len() - known[1]));
            }
        }
        self.last < self.half_paths.len() && !self.plan.effort.is_over()
    }

    /// Returns the rays that the tubes found, and the half-paths.
    pub(crate) fn finish(self) -> (CylinderRays, Vec<HalfPath>) {
        (self.rays, self.half_paths)
    }

    /// Adds the half-path of a beam that reaches a cylinder directly.
    fn begin(&mut self, index: u32) {
        let LitCylinder { cylinder, span, beam } = self.views[index as usize];
        if !self.plan.settings.allows(beam.order + 1) {
            return;
        }
        let tracer = Tracer::new(self.plan, &self.views[index as usize], &[]);
        let ends = [span.from_rad, span.to_rad];
        // The rays as they leave: before its first cylinder a ray has no front.
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
        self.half_paths.push(HalfPath {
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
            departures: Departures::between(
                tracer.departure(span.from_rad),
                tracer.departure(span.to_rad),
            ),
            min_m: length_m,
            spread: one_way,
            strength: Strength::new(beam.gain, one_way, self.radius_m, &self.plan.settings),
        });
    }

    /// Starts tubes from the reflection at a half-path's cylinder, if they can still give an echo.
    fn launch(&mut self, index: usize, partners: &Partners) {
        let half_path = &self.half_paths[index];
        let best = partners.best(&half_path.departures);
        let order = half_path.order + 1;
        let circle = &self.plan.cylinders.circles[half_path.cylinder as usize];
        let to_next_m = self.plan.cylinders.to_next_m(half_path.cylinder);
        // At the next cylinder; rays head-on spread least here.
        let [length_m, width_m, growth] = half_path.spread;
        let reflected = [length_m, width_m, growth + 2.0 * width_m / circle.radius_m];
        let next = advanced(reflected, to_next_m);
        let gain = half_path.gain * circle.gain;
        let strength = Strength::new(gain, next, self.radius_m, &self.plan.settings);
        let may_be_detected = self.may_be_detected(&strength, half_path.min_m + to_next_m, &best)
            && self.plan.settings.allows(order + 1);
        // An edge adds no order.
        if !(may_be_detected || self.has_edges && self.plan.settings.allows(order)) {
            return;
        }
        let surface = Reflector::Cylinder(half_path.cylinder);
        let (link, borders) = if half_path.link == DIRECT {
            (FIRST, half_path.borders)
        } else {
            self.rays.links.push(SurfaceLink { surface, before: half_path.link });
            let borders = half_path.borders.map(|border| self.plan.reflect(&border, surface));
            (self.rays.links.len() as u32 - 1, borders)
        };
        let tube = Tube {
            view: half_path.view,
            link,
            span: half_path.span,
            borders,
            middle: None,
            mirrored: !half_path.mirrored,
            triangle: half_path.triangle,
            side: None,
            gain,
            order,
            level: half_path.level + 1,
            partners: 0,
            min_m: half_path.min_m,
            to_next_m,
        };
        let mut surfaces = half_path.surfaces.clone();
        if half_path.link != DIRECT {
            surfaces.push(surface);
        }
        let view = &self.views[half_path.view as usize];
        let tracer = Tracer::new(self.plan, view, &surfaces);
        self.partners.clear();
        split(&tube, &tracer, circle, 0, partners, (&mut self.waiting, &mut self.partners));
    }

    /// Takes a tube through its triangle: splits it, records its hits and follows the parts that
    /// leave.
    fn follow(&mut self, tube: &Tube) {
        if !self.plan.effort.step(SearchPart::Cylinders, STEPS_PER_TUBE) || !self.is_viable(tube) {
            return;
        }
        let surfaces = surfaces_to(&self.rays.links, tube.link);
        let view = &self.views[tube.view as usize];
        let tracer = Tracer::new(self.plan, view, &surfaces);
        let mut cuts: SmallVec<[f64; 8]> = self.split_at_corners(tube, &tracer);
        let mut hits = Hits::new(tube, &tracer);
        cuts.extend(hits.cuts());
        cuts.sort_by(f64::total_cmp);
        let AngleSpan { from_rad, to_rad } = tube.span;
        let [mut from, last] = [(from_rad, tube.borders[0]), (to_rad, tube.borders[1])];
        for &at in cuts.iter().filter(|&&at| from_rad < at && at < to_rad) {
            if at > from.0 {
                let to = (at, tracer.front(at));
                self.follow_part(tube, &tracer, &mut hits, [from, to]);
                from = to;
            }
        }
        self.follow_part(tube, &tracer, &mut hits, [from, last]);
        for (cylinder, span) in hits.parts() {
            let half_path = self.half_path(tube, &tracer, cylinder, span);
            self.half_paths.extend(half_path);
        }
    }

    /// Follows the part of a tube between two rays, all of which hits the same surfaces. The rays
    /// are given by their first contacts.
    fn follow_part(
        &mut self,
        tube: &Tube,
        tracer: &Tracer,
        hits: &mut Hits,
        [from, to]: [(f64, Front); 2],
    ) {
        let span = AngleSpan { from_rad: from.0, to_rad: to.0 };
        if span.to_rad <= span.from_rad {
            return;
        }
        // While nothing cuts a tube its middle ray stays the same.
        let is_whole = (span.from_rad, span.to_rad) == (tube.span.from_rad, tube.span.to_rad);
        let known = tube.middle.filter(|_| is_whole);
        let middle = known.unwrap_or_else(|| tracer.front(0.5 * (span.from_rad + span.to_rad)));
        if hits.lets_pass(span, &middle) {
            let borders = [from.1, to.1];
            let part = Tube { span, borders, middle: Some(middle), ..*tube };
            self.leave(&part, &middle);
        }
    }

    /// Returns `true` if an echo of the tube can still be short and strong enough.
    ///
    /// The minima of length, width and growth over its borders are those over all its rays (to
    /// within [`POWER_MARGIN`]). They are evaluated at the side by which the tube entered, and
    /// advanced to the nearest cylinder, where the half-path ends. With the best remaining partner
    /// they bound every echo ([`strength`](super::strength)).
    fn is_viable(&self, tube: &Tube) -> bool {
        let settings = &self.plan.settings;
        let (mut min_m, mut to_cylinder_m) = (tube.min_m, tube.to_next_m);
        if self.has_edges {
            let spread = min_spread(&tube.borders);
            let left_m = tube.side.map_or(0.0, |side| {
                let [a, b] = self.side_of(tube.triangle, side as usize);
                distance_to_segment(self.target, a, b)
            });
            let echo_m = spread[0] + left_m;
            if echo_m <= settings.max_path_m && self.is_viable_at_edge(tube.gain, spread, echo_m) {
                return true;
            }
        }
        let [from, to] = tube.borders;
        let mut rays = [from, to, tube.middle.unwrap_or(from)];
        if let Some(side) = tube.side {
            let [a, b] = self.side_of(tube.triangle, side as usize);
            let outward = (b - a).perp();
            for ray in &mut rays {
                let ahead_m = outward.dot(a - ray.origin) / outward.dot(ray.along);
                // Not for rays along the side.
                if ahead_m > 0.0 {
                    *ray = ray.moved(ahead_m);
                }
            }
            min_m = min_m.max(min_length_m([&rays[0], &rays[1]]) - TIE_M);
            to_cylinder_m = self.plan.cylinders.distance_to_segment(a, b);
        }
        let ahead = advanced(min_spread(&rays), to_cylinder_m);
        let strength = Strength::new(tube.gain, ahead, self.radius_m, settings);
        self.may_be_detected(&strength, min_m + to_cylinder_m, self.partners_of(tube))
    }

    pub(crate) fn partners_of(&self, tube: &Tube) -> &PartnersByLength {
        &self.partners[tube.partners as usize]
    }

    /// Returns `true` if a half-path of this strength and of at least this length can give an echo
    /// with any of the partners.
    pub(crate) fn may_be_detected(
        &self,
        strength: &Strength,
        min_m: f64,
        partners: &PartnersByLength,
    ) -> bool {
        let PathSettings { max_path_m, unrestricted_m, .. } = self.plan.settings;
        [unrestricted_m.min(max_path_m), max_path_m].into_iter().any(|length_m| {
            let floor = self.plan.settings.contact_floor(true, length_m);
            min_m <= length_m && strength.with(&partners.up_to(length_m - min_m)) >= floor.powi(2)
        })
    }

    /// Returns `true` if an edge can return enough of rays with this spreading, in echoes of at
    /// least `min_m` there and back, including the loss in air. With any partner the power is at
    /// most `L / w + 1 / g` of a mirror's, by the same reasoning as for half-paths
    /// ([`strength`](super::strength)).
    pub(crate) fn is_viable_at_edge(
        &self,
        gain: f64,
        [length_m, width_m, growth]: [f64; 3],
        min_m: f64,
    ) -> bool {
        let settings = &self.plan.settings;
        let loss = MAX_EDGE_GAIN * gain * settings.air_gain(min_m);
        POWER_MARGIN * loss * loss * (length_m / width_m + 1.0 / growth)
            >= settings.contact_floor(true, min_m).powi(2)
    }

    /// Length of the shortest path back from a cylinder, metres.
    pub(crate) fn back_m(&self, circle: &PlanCircle) -> f64 {
        (self.target.distance(circle.center) - circle.radius_m).max(0.0)
    }

    fn side_of(&self, triangle: u32, side: usize) -> [DVec2; 2] {
        let mesh = self.plan.mesh.as_ref();
        mesh.map_or([DVec2::ZERO; 2], |mesh| mesh.side(triangle, side))
    }

    /// Adds rays to the corners of the tube's triangle that are edges, and returns where corners
    /// split it.
    fn split_at_corners(&mut self, tube: &Tube, tracer: &Tracer) -> SmallVec<[f64; 8]> {
        let Some(mesh) = &self.plan.mesh else { return SmallVec::new() };
        let corners = mesh.triangles[tube.triangle as usize].corners;
        let far = tube.side.map(|side| (side as usize + 2) % 3);
        let mut cuts = SmallVec::new();
        for (index, &corner) in corners.iter().enumerate() {
            if far.is_some_and(|far| far != index) {
                continue;
            }
            let point = mesh.points[corner as usize];
            let Some((at, front)) = ray_through(tube, tracer, point) else { continue };
            cuts.push(at);
            let is_hidden = || self.plan.cylinders.hide_in(tube.triangle, front.origin, point);
            if self.has_edges && !is_hidden() {
                self.add_ray_to_edge(tube, tracer, corner, at, &front.moved(front.ahead_m(point)));
            }
        }
        cuts
    }

    fn add_ray_to_edge(&mut self, tube: &Tube, tracer: &Tracer, point: u32, at: f64, end: &Front) {
        let spread = [end.length_m, end.width_m, end.growth];
        let min_m = end.length_m + end.origin.distance(self.target);
        let is_viable = || self.is_viable_at_edge(tube.gain, spread, min_m);
        if !self.plan.corners.diffracts(point, end.along) || !is_viable() {
            return;
        }
        let rays = &mut self.rays.rays;
        rays.push(CylinderRay { view: tube.view, link: tube.link, contact_rad: at });
        let ray = UnfoldedRay {
            run: end.length_m * end.along,
            departure: tracer.departure(at),
            gain: tube.gain,
            node: rays.len() as u32 - 1,
            order: tube.order,
            slopes: tracer.view.beam.slopes,
        };
        let (width_m, radius_m) = (end.width_m, end.radius_m());
        self.rays.to_edges.push(SpreadRay { point, ray, width_m, radius_m });
    }

    fn reflected(&mut self, tube: &Tube, wall: u32) -> Tube {
        let surface = Reflector::Wall(wall);
        let borders = tube.borders.map(|border| self.plan.reflect(&border, surface));
        let middle = tube.middle.map(|middle| self.plan.reflect(&middle, surface));
        let links = &mut self.rays.links;
        links.push(SurfaceLink { surface, before: tube.link });
        Tube {
            link: links.len() as u32 - 1,
            mirrored: !tube.mirrored,
            gain: tube.gain * self.plan.walls[wall as usize].gain,
            order: tube.order + 1,
            borders,
            middle,
            ..*tube
        }
    }

    /// Continues a part through the side by which its middle ray leaves.
    fn leave(&mut self, tube: &Tube, middle: &Front) {
        let Some(mesh) = &self.plan.mesh else { return };
        let triangle = &mesh.triangles[tube.triangle as usize];
        let distance_m = |side: usize| {
            let [a, b] = self.side_of(tube.triangle, side);
            let outward = -(b - a).perp();
            let slant = outward.dot(middle.along);
            // A ray that, by rounding, starts outside a side leaves by it at once.
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
            TriangleSide::Open { triangle, side } => {
                self.waiting.push(Tube { triangle, side: Some(side), ..*tube });
            }
            TriangleSide::Wall(wall) => {
                if self.plan.settings.allows(tube.order + 1) {
                    let stacked = mesh.stacked(tube.triangle, side).iter().copied();
                    for wall in std::iter::once(wall).chain(stacked) {
                        let next = self.reflected(tube, wall);
                        self.waiting.push(Tube { side: Some(side as u8), ..next });
                    }
                }
                if self.plan.lets_pass(wall)
                    && let Some((triangle, side)) = mesh.beyond(tube.triangle, side)
                {
                    self.waiting.push(Tube { triangle, side: Some(side), ..*tube });
                }
            }
            TriangleSide::Outside => {}
        }
    }
}

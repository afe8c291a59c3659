//! Echoes that touch cylinders: tubes of rays, from their first cylinder on.
//!
//! A beam that meets a cylinder has no image behind it any more. What is left of it is a tube:
//! the rays between two border rays, each known by where it touched the first cylinder. Cylinders
//! are convex, so the rays of a tube spread and never cross: seen from any point they pass by in
//! order. So the tube walks the mesh as a beam does, and where a beam finds by a sign on which
//! side of a corner a ray passes, a tube finds the one ray through it as the zero of a monotone
//! function. Corners, the tangents of other cylinders, and walls split it; each ray from the start
//! is in exactly one tube, as it is in one beam. An echo is a tube that holds the receiver, a ray
//! to an edge one that holds the edge.

use smallvec::SmallVec;

use super::{
    Echo, Paths, Via,
    beam::{Ray, TIE_M},
    mesh::Side,
    rounds::{Arc, Circle, Span},
    trace::{Tree, View},
    tube::{BORDER_M, Curved, ECHO_M, FIRST, Front, Link, Tracer, zero_between},
};
use crate::{
    geometry::{DVec2, distance_to_segment},
    model::Reflector,
};

/// A tube's part of a cylinder is split until it turns the rays by no more than twice this,
/// radians.
const MOST_TURN_RAD: f64 = 0.7;

/// Halvings of a tube at a cylinder, at most: what grazes it is then too weak.
const MOST_HALVINGS: u32 = 12;

/// Between its borders no ray of a tube is louder than they are by more than this.
const LOUDER: f64 = 1.6;

/// Most reflections at cylinders on a path. Between a body and a wall that it all but touches
/// paths with more are without number; here each has spread by a few times the cavity's width.
const MOST_CONTACTS: u8 = 3;

/// Paths by cylinders are followed from this much above the weakest that is asked for: with 20 dB
/// below the threshold for that, from 10 dB below it. There are a great many of the others.
const FLOOR_ABOVE: f64 = 10.0;

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

/// Rays between two, all of which have met the same surfaces.
#[derive(Debug, Clone, Copy)]
struct Tube {
    view: u32,
    link: u32,
    /// The contact of its borders with the first cylinder, in growing order.
    span: Span,
    /// The borders as they leave the last surface, in the same order.
    borders: [Front; 2],
    /// Whether the ray at `from_rad` is the left border.
    mirrored: bool,
    triangle: u32,
    /// The side it came in by, if it did not start here.
    side: Option<u8>,
    gain: f64,
    order: u16,
    /// Reflections at cylinders.
    contacts: u8,
}

impl Tube {
    /// The borders, the right one first.
    fn in_order(&self) -> [&Front; 2] {
        let [from, to] = &self.borders;
        if self.mirrored { [to, from] } else { [from, to] }
    }

    fn halves(&self, at_rad: f64, front: Front) -> [Self; 2] {
        let Span { from_rad, to_rad } = self.span;
        let [from, to] = self.borders;
        let part =
            |from_rad, to_rad, borders| Self { span: Span { from_rad, to_rad }, borders, ..*self };
        [part(from_rad, at_rad, [from, front]), part(at_rad, to_rad, [front, to])]
    }
}

/// Follows all tubes of a tree.
pub(super) struct TubeGrower<'a> {
    paths: &'a Paths,
    tree: &'a mut Tree,
    start: DVec2,
    target: DVec2,
    home: Option<u32>,
    views: Vec<View>,
    waiting: Vec<Tube>,
    echoes: Vec<Echo>,
}

impl<'a> TubeGrower<'a> {
    /// For the beams from `start` that met cylinders, and echoes to `target`.
    pub(super) fn new(paths: &'a Paths, tree: &'a mut Tree, [start, target]: [DVec2; 2]) -> Self {
        let home = paths.mesh.as_ref().and_then(|mesh| mesh.locate(target));
        let views = std::mem::take(&mut tree.to_cylinders);
        let (waiting, echoes) = (Vec::new(), Vec::new());
        Self { paths, tree, start, target, home, views, waiting, echoes }
    }

    /// All echoes that touch cylinders but no edge; rays to edges go to [`Tree::bent_to_edges`].
    pub(super) fn grow(mut self) -> Vec<Echo> {
        for view in 0..self.views.len() as u32 {
            self.begin(view);
            while let Some(tube) = self.waiting.pop() {
                self.follow(&tube);
            }
        }
        self.tree.to_cylinders = self.views;
        self.echoes
    }

    fn begin(&mut self, index: u32) {
        let View { arc, beam } = self.views[index as usize];
        let circle = &self.paths.rounds.circles[arc.cylinder as usize];
        let Some(lit) = circle.lit_by(&beam) else { return };
        if !self.paths.settings.allows(beam.order + 1) {
            return;
        }
        for span in arc.span.common(&lit) {
            let view = &self.views[index as usize];
            let tracer = Tracer::new(self.paths, view, &[], FIRST);
            let tube = Tube {
                view: index,
                link: FIRST,
                span,
                borders: [tracer.front(span.from_rad), tracer.front(span.to_rad)],
                mirrored: false,
                triangle: beam.triangle,
                side: None,
                gain: beam.gain * circle.gain,
                order: beam.order + 1,
                contacts: 1,
            };
            self.split(&tube, circle, 0);
        }
    }

    /// Puts a tube that has just met a circle in parts that turn little.
    fn split(&mut self, tube: &Tube, circle: &Circle, halvings: u32) {
        let [from, to] = tube.borders;
        let middle = |front: &Front| front.origin - circle.center;
        let turn = middle(&from).angle_to(middle(&to)).abs();
        let opens = from.along.angle_to(to.along).abs();
        if halvings < MOST_HALVINGS && (turn > MOST_TURN_RAD || opens > 2.0 * MOST_TURN_RAD) {
            let half = 0.5 * (tube.span.from_rad + tube.span.to_rad);
            let front = self.tracer(tube).front(half);
            for part in tube.halves(half, front) {
                self.split(&part, circle, halvings + 1);
            }
        } else {
            self.waiting.push(*tube);
        }
    }

    fn tracer(&self, tube: &Tube) -> Tracer<'_> {
        Tracer::new(self.paths, &self.views[tube.view as usize], &self.tree.links, tube.link)
    }

    /// Takes a tube through its triangle: what is in it, what it meets there, where it leaves.
    fn follow(&mut self, tube: &Tube) {
        if !self.is_worth(tube) {
            return;
        }
        if self.home == Some(tube.triangle) {
            self.meet_target(tube);
        }
        let mut cuts: SmallVec<[f64; 8]> = self.meet_corners(tube);
        let hits = self.meet_arcs(tube);
        cuts.extend(hits.iter().flat_map(|span| [span.from_rad, span.to_rad]));
        cuts.sort_by(f64::total_cmp);
        let tracer = self.tracer(tube);
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
                self.leave(&Tube { span, borders: [pair[0].1, pair[1].1], ..*tube }, middle);
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
        let least = |of: fn(&Front) -> f64| of(&tube.borders[0]).min(of(&tube.borders[1]));
        let length_m = least(|front| front.length_m) + left_m;
        let width_m = least(|front| front.width_m) + left_m * least(|front| front.growth);
        let most =
            tube.gain * settings.air_gain(length_m) * (LOUDER * length_m / width_m).min(1.0).sqrt();
        length_m <= settings.max_path_m && most >= self.floor()
    }

    fn floor(&self) -> f64 {
        FLOOR_ABOVE * self.paths.settings.floor
    }

    fn side_of(&self, triangle: u32, side: usize) -> [DVec2; 2] {
        let Some(mesh) = &self.paths.mesh else { return [DVec2::ZERO; 2] };
        [side, (side + 1) % 3].map(|corner| mesh.corner(triangle, corner))
    }

    /// The ray of the tube through a point; `None` if the point is beside it.
    fn ray_through(&self, tube: &Tube, point: DVec2) -> Option<(f64, Front)> {
        let [right, left] = tube.in_order();
        let is_between = right.offset_m(point) >= -TIE_M && left.offset_m(point) <= TIE_M;
        if !is_between {
            return None;
        }
        let tracer = self.tracer(tube);
        let Span { from_rad, to_rad } = tube.span;
        let at = zero_between(from_rad, to_rad, ECHO_M, |at| tracer.front(at).offset_m(point));
        let front = tracer.front(at);
        (front.ahead_m(point) > 0.0).then_some((at, front))
    }

    fn meet_target(&mut self, tube: &Tube) {
        let Some((at, front)) = self.ray_through(tube, self.target) else { return };
        let end = front.moved(front.ahead_m(self.target));
        let settings = &self.paths.settings;
        let amplitude =
            tube.gain * settings.air_gain(end.length_m) * (end.length_m / end.width_m).sqrt();
        if amplitude < self.floor() || end.length_m > settings.max_path_m {
            return;
        }
        let Some(curved) = self.keep(tube, at, self.target) else { return };
        self.echoes.push(Echo {
            length_m: end.length_m,
            amplitude,
            phase_rad: 0.0,
            departure: self.departure(tube, at),
            arrival: -end.along,
            rise_rad: [0.0; 2],
            image: 0,
            via: Via::Cylinders { curved },
        });
    }

    /// Rays to the corners of the tube's triangle that are edges, and where corners split it.
    fn meet_corners(&mut self, tube: &Tube) -> SmallVec<[f64; 8]> {
        let Some(mesh) = &self.paths.mesh else { return SmallVec::new() };
        let corners = mesh.triangles[tube.triangle as usize].corners;
        let far = tube.side.map(|side| (side as usize + 2) % 3);
        let mut cuts = SmallVec::new();
        for (index, &corner) in corners.iter().enumerate() {
            if far.is_some_and(|far| far != index) {
                continue;
            }
            let place = mesh.points[corner as usize];
            let Some((at, front)) = self.ray_through(tube, place) else { continue };
            cuts.push(at);
            self.meet_edge(tube, corner, at, &front.moved(front.ahead_m(place)));
        }
        cuts
    }

    fn meet_edge(&mut self, tube: &Tube, point: u32, at: f64, end: &Front) {
        if !self.paths.edges.answers(point, end.along) {
            return;
        }
        let Some(curved) = self.keep(tube, at, end.origin) else { return };
        let ray = Ray {
            run: end.length_m * end.along,
            departure: self.departure(tube, at),
            gain: tube.gain,
            node: curved,
            order: tube.order,
        };
        let (width_m, radius_m) = (end.width_m, end.radius_m());
        self.tree.bent_to_edges.push(BentRay { point, ray, width_m, radius_m });
    }

    fn departure(&self, tube: &Tube, at: f64) -> DVec2 {
        let run = self.tracer(tube).leg(at).run;
        self.views[tube.view as usize].beam.departure(run.normalize_or_zero())
    }

    /// Writes down the ray that ends at a point; `None` if a cylinder stands in its way.
    fn keep(&mut self, tube: &Tube, contact_rad: f64, end: DVec2) -> Option<u32> {
        let tracer = self.tracer(tube);
        let contacts = tracer.contacts(contact_rad);
        let hidden = contacts
            .iter()
            .zip(contacts.iter().skip(1).chain([&end]))
            .any(|(from, to)| self.paths.rounds.hide(*from, *to));
        let leg = tracer.leg(contact_rad);
        if hidden || self.paths.hides_leg(self.tree, leg, self.start, contacts[0]) {
            return None;
        }
        self.tree.curved.push(Curved { view: tube.view, link: tube.link, contact_rad });
        Some(self.tree.curved.len() as u32 - 1)
    }

    /// Sends the parts that meet cylinders in this triangle on their way, and says which they are.
    fn meet_arcs(&mut self, tube: &Tube) -> SmallVec<[Span; 2]> {
        let mut hits = SmallVec::new();
        for &arc in self.paths.rounds.in_triangle(tube.triangle) {
            let surface = Reflector::Cylinder(arc.cylinder);
            let tracer = self.tracer(tube);
            let last = tracer.surfaces.last().copied();
            let first = Reflector::Cylinder(self.views[tube.view as usize].arc.cylinder);
            // A circle is convex: what leaves it does not come back to it by itself.
            if last.unwrap_or(first) == surface {
                continue;
            }
            let circle = &self.paths.rounds.circles[arc.cylinder as usize];
            let spans = met_spans(tube, &tracer, circle, &arc);
            for span in spans {
                hits.push(span);
                if tube.contacts < MOST_CONTACTS && self.paths.settings.allows(tube.order + 1) {
                    let part = self.part(tube, span);
                    let next = self.reflected(&part, surface, circle.gain);
                    let contacts = tube.contacts + 1;
                    self.split(&Tube { side: None, contacts, ..next }, circle, 0);
                }
            }
        }
        hits
    }

    fn part(&self, tube: &Tube, span: Span) -> Tube {
        let tracer = self.tracer(tube);
        let borders = [span.from_rad, span.to_rad].map(|at| tracer.front(at));
        Tube { span, borders, ..*tube }
    }

    fn reflected(&mut self, tube: &Tube, surface: Reflector, gain: f64) -> Tube {
        let borders = tube.borders.map(|border| self.paths.off(&border, surface));
        let links = &mut self.tree.links;
        links.push(Link { surface, before: tube.link });
        Tube {
            link: links.len() as u32 - 1,
            mirrored: !tube.mirrored,
            gain: tube.gain * gain,
            order: tube.order + 1,
            borders,
            ..*tube
        }
    }

    /// Sends a part on through the side by which its middle ray leaves.
    fn leave(&mut self, tube: &Tube, middle: f64) {
        let Some(mesh) = &self.paths.mesh else { return };
        let front = self.tracer(tube).front(middle);
        let triangle = &mesh.triangles[tube.triangle as usize];
        let distance_m = |side: usize| {
            let [a, b] = self.side_of(tube.triangle, side);
            let outward = -(b - a).perp();
            let slant = outward.dot(front.along);
            // A ray that starts on a side by rounding outside leaves by it at once.
            if slant > 0.0 {
                (outward.dot(a - front.origin) / slant).max(0.0)
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
                    let gain = self.paths.faces[wall as usize].gain;
                    let next = self.reflected(tube, Reflector::Wall(wall), gain);
                    self.waiting.push(Tube { side: Some(side as u8), ..next });
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

/// The parts of a tube that meet an arc.
fn met_spans(tube: &Tube, tracer: &Tracer, circle: &Circle, arc: &Arc) -> SmallVec<[Span; 2]> {
    let [right, left] = tube.in_order();
    let Span { from_rad, to_rad } = tube.span;
    let (r, center) = (circle.radius_m, circle.center);
    let is_beside = right.offset_m(center) <= -r || left.offset_m(center) >= r;
    if is_beside {
        return SmallVec::new();
    }
    // Where the rays touch the circle, its centre to their left and to their right.
    let tangent = |side: f64| {
        zero_between(from_rad, to_rad, BORDER_M, |at| tracer.front(at).offset_m(center) - side * r)
    };
    let ends = [(right, 1.0), (left, -1.0)].map(|(border, side)| {
        let beyond = side * border.offset_m(center) > r;
        let own = if std::ptr::eq(border, &tube.borders[0]) { from_rad } else { to_rad };
        if beyond { tangent(side) } else { own }
    });
    // Their contacts: clockwise around the circle from right to left.
    let contact = |at: f64| {
        let front = tracer.front(at);
        let offset_m = front.offset_m(center);
        let half_chord = (r * r - offset_m * offset_m).max(0.0).sqrt();
        (front.moved(front.ahead_m(center) - half_chord).origin - center).to_angle()
    };
    let last = contact(ends[1]);
    let turn = (contact(ends[0]) - last).rem_euclid(std::f64::consts::TAU);
    let lit = Span { from_rad: last, to_rad: last + turn };
    lit.common(&arc.span)
        .into_iter()
        .map(|part| {
            let at = |angle: f64, end: f64, own: f64| {
                if angle == own {
                    return end;
                }
                let point = circle.point(angle);
                zero_between(from_rad, to_rad, BORDER_M, |at| tracer.front(at).offset_m(point))
            };
            let one = at(part.from_rad, ends[1], lit.from_rad);
            let other = at(part.to_rad, ends[0], lit.to_rad);
            Span { from_rad: one.min(other), to_rad: one.max(other) }
        })
        .filter(|span| {
            let middle = tracer.front(0.5 * (span.from_rad + span.to_rad));
            span.to_rad > span.from_rad && middle.ahead_m(center) > 0.0
        })
        .collect()
}

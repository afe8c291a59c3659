//! Rays that cylinders have spread, and tubes of them.

use smallvec::SmallVec;

use super::{Face, Paths, arms::Contact, interactions::Leg, rounds::Circle, trace::View};
use crate::{geometry::DVec2, model::Reflector};

/// Marks a tube that has met its first cylinder only.
pub(super) const FIRST: u32 = u32::MAX;

/// Surfaces in the order in which a ray meets them, after its first cylinder.
pub(super) type Surfaces = SmallVec<[Reflector; 8]>;

/// A surface that tubes have met after their first cylinder.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    pub(super) surface: Reflector,
    pub(super) before: u32,
}

/// A ray that met a cylinder, by where it met the first one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Curved {
    /// The beam before, in [`super::trace::Tree::to_cylinders`].
    pub(super) view: u32,
    /// Last of the surfaces after, in [`super::trace::Tree::links`].
    pub(super) link: u32,
    /// Angle of the first contact around the cylinder's centre, radians.
    pub(super) contact_rad: f64,
}

/// A ray where it leaves a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Front {
    pub(super) origin: DVec2,
    /// Unit vector.
    pub(super) along: DVec2,
    /// Length of the way so far, metres.
    pub(super) length_m: f64,
    /// Distance to the neighbouring ray over the angle between them at departure, metres, and
    /// its growth a metre: without cylinders `length_m` and 1.
    pub(super) width_m: f64,
    pub(super) growth: f64,
    /// That angle over the one between their first contacts, seen from the first cylinder's centre.
    pub(super) rate: f64,
}

impl Front {
    /// How far a point is to the left of the ray, metres.
    pub(super) fn offset_m(&self, point: DVec2) -> f64 {
        self.along.perp_dot(point - self.origin)
    }

    /// How far along the ray a point is abreast of it, metres.
    pub(super) fn ahead_m(&self, point: DVec2) -> f64 {
        self.along.dot(point - self.origin)
    }

    /// So much farther on.
    pub(super) fn moved(&self, distance_m: f64) -> Self {
        Self {
            origin: self.origin + distance_m * self.along,
            length_m: self.length_m + distance_m,
            width_m: self.width_m + distance_m * self.growth,
            ..*self
        }
    }

    /// Radius of curvature of the wave front, metres.
    pub(super) fn radius_m(&self) -> f64 {
        self.width_m / self.growth
    }

    fn off_wall(&self, face: &Face) -> Self {
        let mirror = &face.mirror;
        let distance_m = -mirror.height_m(self.origin) / mirror.normal.dot(self.along);
        let hit = self.moved(distance_m);
        Self { along: mirror.turn(self.along), ..hit }
    }

    /// Moved to the outside of a circle, with the normal there and the cosine of the angle of
    /// incidence. A ray that misses it by rounding touches it.
    pub(super) fn onto(&self, circle: &Circle) -> (Self, DVec2, f64) {
        let offset_m = self.offset_m(circle.center);
        let half_chord = circle.radius_m * circle.radius_m - offset_m * offset_m;
        let hit = self.moved(self.ahead_m(circle.center) - half_chord.max(0.0).sqrt());
        let normal = (hit.origin - circle.center).normalize();
        (hit, normal, (-normal.dot(hit.along)).max(LEAST_COSINE))
    }

    /// Off the outside of a circle: the mirror equation in the plane of incidence (Keller and Lewis
    /// 1995, for instance), by which the curvature of the front grows by `2 / (r cos i)`.
    fn off_circle(&self, circle: &Circle) -> Self {
        let (hit, normal, cosine) = self.onto(circle);
        Self {
            along: hit.along + 2.0 * cosine * normal,
            growth: hit.growth + 2.0 * hit.width_m / (circle.radius_m * cosine),
            ..hit
        }
    }
}

/// Rays that graze a cylinder spread without bounds; this keeps their figures finite.
const LEAST_COSINE: f64 = 1e-9;

impl Paths {
    /// A ray off one more surface.
    pub(super) fn off(&self, front: &Front, surface: Reflector) -> Front {
        match surface {
            Reflector::Wall(wall) => front.off_wall(&self.faces[wall as usize]),
            Reflector::Cylinder(cylinder) => {
                front.off_circle(&self.rounds.circles[cylinder as usize])
            }
            Reflector::Floor | Reflector::Ceiling => *front,
        }
    }
}

/// Follows rays of one beam by way of its cylinder and other surfaces.
pub(super) struct Tracer<'a> {
    pub(super) paths: &'a Paths,
    pub(super) view: &'a View,
    pub(super) surfaces: &'a [Reflector],
}

/// The surfaces up to a link, in the order in which they are met.
pub(super) fn surfaces_to(links: &[Link], mut link: u32) -> Surfaces {
    let mut surfaces = Surfaces::new();
    while let Some(met) = links.get(link as usize) {
        surfaces.push(met.surface);
        link = met.before;
    }
    surfaces.reverse();
    surfaces
}

impl<'a> Tracer<'a> {
    /// The ray as it leaves its last surface.
    pub(super) fn front(&self, contact_rad: f64) -> Front {
        let first = self.first(contact_rad);
        self.surfaces.iter().fold(first, |front, &surface| self.paths.off(&front, surface))
    }

    /// Where it touches the surfaces, the first cylinder included.
    pub(super) fn contacts(&self, contact_rad: f64) -> Vec<DVec2> {
        let mut front = self.first(contact_rad);
        let mut contacts = vec![front.origin];
        for &surface in self.surfaces {
            front = self.paths.off(&front, surface);
            contacts.push(front.origin);
        }
        contacts
    }

    /// From the beam's image to the first contact.
    pub(super) fn leg(&self, contact_rad: f64) -> Leg {
        let run = self.circle().point(contact_rad) - self.view.beam.image;
        Leg { node: self.view.beam.node, run }
    }

    /// The direction in which the ray leaves the start.
    pub(super) fn departure(&self, contact_rad: f64) -> DVec2 {
        self.view.beam.departure(self.leg(contact_rad).run.normalize_or_zero())
    }

    /// The ray where it meets the first cylinder.
    pub(super) fn first_contact(&self, contact_rad: f64) -> Contact {
        let normal = DVec2::from_angle(contact_rad);
        let circle = self.circle();
        let run = circle.center + circle.radius_m * normal - self.view.beam.image;
        let length_m = run.length();
        let along = run / length_m;
        Contact {
            at_rad: contact_rad,
            place_rad: contact_rad,
            place_rate: 1.0,
            slope: normal.perp_dot(along),
            cosine: (-normal.dot(along)).max(LEAST_COSINE),
            length_m,
            width_m: length_m,
            growth: 1.0,
        }
    }

    fn first(&self, contact_rad: f64) -> Front {
        let circle = self.circle();
        let normal = DVec2::from_angle(contact_rad);
        let hit = circle.center + circle.radius_m * normal;
        let run = hit - self.view.beam.image;
        let length_m = run.length();
        let along = run / length_m;
        let cosine = (-normal.dot(along)).max(LEAST_COSINE);
        Front {
            origin: hit,
            along: along + 2.0 * cosine * normal,
            length_m,
            width_m: length_m,
            growth: 1.0 + 2.0 * length_m / (circle.radius_m * cosine),
            rate: circle.radius_m * cosine / length_m,
        }
    }

    pub(super) fn circle(&self) -> &'a Circle {
        &self.paths.rounds.circles[self.view.cylinder as usize]
    }
}

/// Zero of a monotone function between two places where it has the values `at_ends`, whose signs
/// differ (else the end that is closer to zero), to within `exact` of the function. `f` gives value
/// and slope: Newton's method, kept between the places by halving.
pub(super) fn zero_between(
    [mut low, mut high]: [f64; 2],
    at_ends: [f64; 2],
    exact: f64,
    f: impl Fn(f64) -> (f64, f64),
) -> f64 {
    let [at_low, at_high] = at_ends;
    if (at_low < 0.0) == (at_high < 0.0) {
        return if at_low.abs() <= at_high.abs() { low } else { high };
    }
    let mut at = (low * at_high - high * at_low) / (at_high - at_low);
    for _ in 0..MOST_STEPS {
        if !(low < at && at < high) {
            at = 0.5 * (low + high);
            if at <= low || at >= high {
                break;
            }
        }
        let (here, slope) = f(at);
        if here.abs() < exact {
            break;
        }
        if (here < 0.0) == (at_low < 0.0) {
            low = at;
        } else {
            high = at;
        }
        let next = at - here / slope;
        if (next - at).abs() <= f64::EPSILON * at.abs() {
            break;
        }
        at = next;
    }
    at
}

const MOST_STEPS: usize = 100;

/// Rays to edges and borders between tubes are found to within this, metres: far below what counts
/// as a tie.
pub(super) const EXACT_M: f64 = 1e-12;

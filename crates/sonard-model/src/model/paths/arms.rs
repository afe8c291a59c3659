//! One-way rays to cylinders, and how strong an echo they can still become.
//!
//! An arm is all rays of a tube (or of a beam) that meet a cylinder's surface between two places.
//! Two arms at one surface make an echo where the one leaves as the other comes (`joints`). Over
//! legs of widths `w1, w2` whose fronts have the curvatures `1/R1, 1/R2` at a surface of radius `r`,
//! met at `i` from its normal, such an echo has spread to
//!
//! ```text
//! w = w1 w2 (1/R1 + 1/R2 + 2 / (r cos i))
//! ```
//!
//! beside its length `L = L1 + L2` over flat walls, so its amplitude is `sqrt(L / w)` times what
//! surfaces and air leave. With the growth `g = w/R` of each arm that is at most
//! `sqrt(y1 x2 + x1 y2)` for `x = 1 / (g + 2 w / r)` and `y = L / w`, each with the arm's own loss. On
//! any way `x` and `y` only fall: fronts that convex surfaces turn never converge. So the best `x` and
//! `y` of the partners an arm can have bound every echo that it or its continuations can give.

use std::f64::consts::{PI, TAU};

use super::{
    Paths,
    interactions::Leg,
    rounds::Span,
    trace::View,
    tube::{Front, Surfaces, Tracer, zero_between},
    wheel::Both,
};
use crate::geometry::{DVec2, wrap_pi};

/// Between the rays that are looked at no ray of a tube is louder than they are by more than this
/// in power: its parts of a cylinder turn by 0.7 radians at most.
pub(super) const LOUDER: f64 = 1.6;

/// Rays to a part of a cylinder's surface, all of which have met the same surfaces before.
#[derive(Debug)]
pub(super) struct Arm {
    pub(super) cylinder: u32,
    /// The beam that it begins with, in [`super::trace::Tree::to_cylinders`].
    pub(super) view: u32,
    /// See [`super::tube::Curved`]; [`DIRECT`] for a beam that comes straight here.
    pub(super) link: u32,
    /// What it met after its first cylinder.
    pub(super) surfaces: Surfaces,
    /// Cylinders met before.
    pub(super) level: u16,
    pub(super) order: u16,
    pub(super) gain: f64,
    /// Between which contacts with its first cylinder, radians.
    pub(super) span: Span,
    /// The rays at the ends of the span before they come here; for a beam after that.
    pub(super) borders: [Front; 2],
    pub(super) mirrored: bool,
    pub(super) triangle: u32,
    /// Its ends here, by place.
    pub(super) ends: [Contact; 2],
    pub(super) leaves: Leaves,
    /// Its shortest ray comes this far, metres.
    pub(super) least_m: f64,
    pub(super) strength: Strength,
}

/// Marks an arm that has met no cylinder before.
pub(super) const DIRECT: u32 = u32::MAX - 1;

/// A ray where it meets a cylinder.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contact {
    /// Its contact with its first cylinder, radians.
    pub(super) at_rad: f64,
    /// Where it meets this one: angle around the centre, radians.
    pub(super) place_rad: f64,
    /// How fast `place_rad` grows with `at_rad`.
    pub(super) place_rate: f64,
    /// Sine of the angle of incidence, positive for a ray that runs counter-clockwise.
    pub(super) slope: f64,
    /// Its cosine.
    pub(super) cosine: f64,
    pub(super) length_m: f64,
    pub(super) width_m: f64,
    pub(super) growth: f64,
}

/// The directions in which the rays of an arm leave.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaves {
    pub(super) middle_rad: f64,
    pub(super) half_rad: f64,
}

impl Leaves {
    pub(super) fn between(one: DVec2, other: DVec2) -> Self {
        let half_rad = 0.5 * one.angle_to(other);
        Self { middle_rad: wrap_pi(one.to_angle() + half_rad), half_rad: half_rad.abs() }
    }

    /// The least angle between directions of both, radians.
    pub(super) fn gap_rad(&self, other: &Self) -> f64 {
        let apart = wrap_pi(self.middle_rad - other.middle_rad).abs();
        (apart - self.half_rad - other.half_rad).max(0.0)
    }
}

/// `x` and `y` of the module's description, with losses squared.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Strength {
    pub(super) x: f64,
    pub(super) y: f64,
}

impl Strength {
    /// Of rays that have come so far with this spreading, before a cylinder of radius `radius_m` at
    /// most.
    pub(super) fn of(
        gain: f64,
        [length_m, width_m, growth]: [f64; 3],
        radius_m: f64,
        paths: &Paths,
    ) -> Self {
        let power = (gain * paths.settings.air_gain(length_m)).powi(2);
        Self { x: power / (growth + 2.0 * width_m / radius_m), y: power * length_m / width_m }
    }

    /// Bound of the power of an echo out of two arms.
    pub(super) fn with(&self, other: &Self) -> f64 {
        LOUDER * (self.y * other.x + self.x * other.y)
    }

    pub(super) fn max(self, other: Self) -> Self {
        Self { x: self.x.max(other.x), y: self.y.max(other.y) }
    }
}

/// Places are found to within this, radians.
const EXACT_RAD: f64 = 1e-12;

/// Departures are sorted into this many bins.
const BINS: usize = 120;

/// The strongest partners that a ray can have, by the direction in which it leaves.
#[derive(Debug, Clone)]
pub(super) struct Partners(Vec<Strength>);

impl Partners {
    pub(super) fn of<'a>(arms: impl Iterator<Item = &'a Arm>, both: Option<&Both>) -> Self {
        let mut own = vec![Strength::default(); BINS];
        for arm in arms {
            for bin in bins(&arm.leaves) {
                own[bin] = own[bin].max(arm.strength);
            }
        }
        let Some(both) = both else {
            let most = own.into_iter().fold(Strength::default(), Strength::max);
            return Self(vec![most; BINS]);
        };
        let width_rad = TAU / BINS as f64;
        let heard: Vec<f64> = (0..=BINS / 2)
            .map(|apart| both.heard((apart as f64 - 1.0).max(0.0) * width_rad).powi(2))
            .collect();
        let best = |bin: usize| {
            own.iter().enumerate().fold(Strength::default(), |best, (other, strength)| {
                let apart = bin.abs_diff(other);
                let heard = heard[apart.min(BINS - apart)];
                best.max(Strength { x: heard * strength.x, y: heard * strength.y })
            })
        };
        Self((0..BINS).map(best).collect())
    }

    /// The best for rays that leave like this.
    pub(super) fn best(&self, leaves: &Leaves) -> Strength {
        bins(leaves).map(|bin| self.0[bin]).fold(Strength::default(), Strength::max)
    }
}

fn bins(leaves: &Leaves) -> impl Iterator<Item = usize> {
    let place = |angle: f64| ((angle + PI) / TAU * BINS as f64).floor() as i64;
    let from = place(leaves.middle_rad - leaves.half_rad);
    let to = place(leaves.middle_rad + leaves.half_rad).min(from + BINS as i64 - 1);
    (from..=to).map(|bin| bin.rem_euclid(BINS as i64) as usize)
}

/// What follows an arm's rays.
pub(super) struct ArmTracer<'a> {
    pub(super) arm: &'a Arm,
    tracer: Tracer<'a>,
}

impl<'a> ArmTracer<'a> {
    pub(super) fn new(paths: &'a Paths, views: &'a [View], arm: &'a Arm) -> Self {
        let view = &views[arm.view as usize];
        Self { arm, tracer: Tracer { paths, view, surfaces: &arm.surfaces } }
    }

    /// The ray that met its first cylinder at `at_rad`, where it meets this one; its place is less
    /// than half a turn from `near_rad`.
    pub(super) fn contact(&self, at_rad: f64, near_rad: f64) -> Contact {
        if self.arm.link == DIRECT {
            return self.tracer.first_contact(at_rad);
        }
        let front = self.tracer.front(at_rad);
        self.tracer.paths.contact(&front, self.arm.cylinder, self.arm.mirrored, at_rad, near_rad)
    }

    /// The ray that comes to a place between its ends.
    pub(super) fn contact_at(&self, place_rad: f64, near_rad: f64) -> Contact {
        let Span { from_rad, to_rad } = self.arm.span;
        let mut ends = self.arm.ends.map(|end| end.place_rad - place_rad);
        if !self.arm.mirrored {
            ends.reverse();
        }
        let at_rad = zero_between([from_rad, to_rad], ends, EXACT_RAD, |at| {
            let contact = self.contact(at, near_rad);
            (contact.place_rad - place_rad, contact.place_rate)
        });
        self.contact(at_rad, near_rad)
    }

    /// The direction in which that ray leaves.
    pub(super) fn departure(&self, at_rad: f64) -> DVec2 {
        self.tracer.departure(at_rad)
    }

    /// Its way from the beam's image to its first cylinder.
    pub(super) fn leg(&self, at_rad: f64) -> Leg {
        self.tracer.leg(at_rad)
    }
}

impl Paths {
    /// A ray that leaves its last surface like this, where it meets a cylinder.
    pub(super) fn contact(
        &self,
        front: &Front,
        cylinder: u32,
        mirrored: bool,
        at_rad: f64,
        near_rad: f64,
    ) -> Contact {
        let circle = &self.rounds.circles[cylinder as usize];
        let (hit, normal, cosine) = front.onto(circle);
        let place_rad = near_rad + wrap_pi(normal.to_angle() - near_rad);
        // Counter-clockwise is to the right for one who looks at the surface.
        let way = if mirrored { 1.0 } else { -1.0 };
        Contact {
            at_rad,
            place_rad,
            place_rate: way * hit.width_m * hit.rate / (circle.radius_m * cosine),
            slope: normal.perp_dot(hit.along),
            cosine,
            length_m: hit.length_m,
            width_m: hit.width_m,
            growth: hit.growth,
        }
    }
}

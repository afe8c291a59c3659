//! Echoes that touch cylinders: two half-paths, connected where they meet.
//!
//! The path of an echo read backwards is a path too (reciprocity). So an echo of `n` contacts with cylinders
//! is found from half-paths of half as many: one to its middle contact from the start and one from the
//! receiver, as in bidirectional tracing. What is followed that way is the square root of what one-way search
//! would have to follow, since behind each contact there are several times more paths.
//!
//! A middle contact has as many cylinders before it as after it, or one more.

use super::{
    contact::Contact,
    departures::Departures,
    groups::{Group, Groups},
    half_path::{DIRECT, HalfPath, HalfPathTracer},
    rays::{CylinderRay, CylinderRays, OneWay},
    stationary::{SLACK, overlap, stationary_contact},
    strength::Strength,
};
use crate::{
    geometry::turn_rad,
    model::{
        SearchPart,
        paths::{
            beams::{Leg, View},
            echo::{Echo, Via},
            pattern::TwoWayBound,
            plan::{Circle, Plan},
        },
    },
};

/// Effort of finding where two half-paths meet, in steps of a beam.
const STEPS_A_PAIR: usize = 32;

/// The contact in the middle of an echo path.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Connection {
    pub(crate) cylinder: u32,
    /// Angle of the contact around its centre, radians.
    pub(crate) angle_rad: f64,
    /// From the transmitter to there.
    pub(crate) out: OneWay,
    /// From the receiver to there, in its own tree if it has one.
    pub(crate) back: OneWay,
}

/// Connects half-paths.
pub(crate) struct Connector<'a> {
    plan: &'a Plan,
    bound: Option<&'a TwoWayBound>,
    pub(crate) connections: Vec<Connection>,
    pub(crate) echoes: Vec<Echo>,
}

/// The half-paths from one start.
pub(crate) struct HalfPaths<'a> {
    pub(crate) views: &'a [View],
    pub(crate) all: &'a [HalfPath],
    /// The store for rays of echoes.
    pub(crate) rays: &'a mut CylinderRays,
}

/// The half-paths from one start, sorted.
struct Sorted<'a> {
    views: &'a [View],
    all: &'a [HalfPath],
    groups: Groups,
}

impl<'a> Connector<'a> {
    pub(crate) fn new(plan: &'a Plan, bound: Option<&'a TwoWayBound>) -> Self {
        Self { plan, bound, connections: Vec::new(), echoes: Vec::new() }
    }

    /// All echoes between the half-paths from a start and those from another, or from the same.
    pub(crate) fn connect(&mut self, out: &mut HalfPaths, back: Option<&mut HalfPaths>) {
        let outs = self.sorted(out);
        match back {
            None => {
                for pair in self.pairs(&outs, None) {
                    let halves = [0, 1].map(|end| pair.half(end, out.rays));
                    self.push(&pair, halves, !pair.own_reverse);
                }
            }
            Some(back) => {
                for pair in self.pairs(&outs, Some(&self.sorted(back))) {
                    let halves = [pair.half(0, out.rays), pair.half(1, back.rays)];
                    self.push(&pair, halves, false);
                }
            }
        }
    }

    fn sorted<'b>(&self, from: &HalfPaths<'b>) -> Sorted<'b> {
        let groups = Groups::of(from.all, self.plan.cylinders.circles.len());
        Sorted { views: from.views, all: from.all, groups }
    }

    /// Echoes out on half-paths from the transmitter and back on those from the receiver; from one start
    /// each pair once.
    fn pairs(&self, out: &Sorted, back: Option<&Sorted>) -> Vec<Pair> {
        let mut found = Vec::new();
        let other = back.unwrap_or(out);
        for (key, outs) in out.groups.by_cylinder.iter().enumerate() {
            // As many cylinders before as after, or one more.
            let lower = key.checked_sub(out.groups.cylinders).map(|lower| (lower, false));
            for (key, is_level) in [(key, true)].into_iter().chain(lower) {
                let Some(backs) = other.groups.by_cylinder.get(key) else { continue };
                let once = is_level && back.is_none();
                for group in outs {
                    let backs: Vec<&Group> =
                        backs.iter().filter(|back| self.may_meet_any(out, group, back)).collect();
                    for &half_path in &group.half_paths {
                        self.partners_of(out, half_path, other, &backs, once, &mut found);
                    }
                }
            }
        }
        found
    }

    /// Whether any half-path of a group can give an echo with any of another.
    fn may_meet_any(&self, out: &Sorted, group: &Group, back: &Group) -> bool {
        let is_repeated = out.all[group.half_paths[0] as usize].level > 0;
        let least_m = group.least_m + back.least_m;
        let floor = self.plan.settings.contact_floor(is_repeated, least_m).powi(2);
        let most = group.most.with(&back.most);
        most * self.most_heard() >= floor
            && most * self.heard(&group.departures, &back.departures) >= floor
    }

    /// Connects a half-path to others; with `once`, only with those whose number is not smaller.
    fn partners_of(
        &self,
        out: &Sorted,
        number: u32,
        back: &Sorted,
        groups: &[&Group],
        once: bool,
        found: &mut Vec<Pair>,
    ) {
        let half_path = &out.all[number as usize];
        let floor = |other_m: f64| {
            self.plan
                .settings
                .contact_floor(half_path.level > 0, half_path.least_m + other_m)
                .powi(2)
        };
        let mut tracer = None;
        for group in groups {
            let (most, least) = (half_path.strength.with(&group.most), floor(group.least_m));
            // In whatever directions: a cheap test before the one that asks for them.
            let is_loud = most * self.most_heard() >= least
                && most * self.heard(&half_path.departures, &group.departures) >= least;
            if !is_loud {
                continue;
            }
            for &other in group.half_paths.iter().filter(|&&other| !once || other >= number) {
                let other = &back.all[other as usize];
                // Sorted by falling `x`: the bound of all that follow falls with it.
                let most = Strength { x: other.strength.x, ..group.most };
                if half_path.strength.with(&most) < least {
                    break;
                }
                if !self.plan.effort.step(SearchPart::Cylinders, 1) {
                    return;
                }
                if self.may_meet(half_path, other, floor(other.least_m)) {
                    let tracer = tracer.get_or_insert_with(|| {
                        HalfPathTracer::new(self.plan, out.views, half_path)
                    });
                    let other = HalfPathTracer::new(self.plan, back.views, other);
                    self.plan.effort.step(SearchPart::Cylinders, STEPS_A_PAIR);
                    let pair = self.pair(tracer, &other);
                    self.plan.effort.keep::<(Pair, Echo, Echo)>(pair.iter().len());
                    found.extend(pair);
                }
            }
        }
    }

    /// Most of the power that is heard of echoes that leave and come back like this.
    fn heard(&self, one: &Departures, other: &Departures) -> f64 {
        self.bound.map_or(1.0, |bound| bound.at(one.gap_rad(other)).powi(2))
    }

    /// The most that it is in any directions.
    fn most_heard(&self) -> f64 {
        self.bound.map_or(1.0, |bound| bound.at(0.0).powi(2))
    }

    /// Cheap tests: whether two half-paths can give an echo at all.
    fn may_meet(&self, out: &HalfPath, back: &HalfPath, floor: f64) -> bool {
        let [[a, b], [c, d]] = [&out.ends, &back.ends];
        let most = out.strength.with(&back.strength);
        a.slope + c.slope < SLACK
            && b.slope + d.slope > -SLACK
            && most * self.most_heard() >= floor
            && overlap(&out.ends, &back.ends).is_some()
            && most * self.heard(&out.departures, &back.departures) >= floor
            && self.plan.settings.allows(out.order + back.order + 1)
    }

    /// The echo out on one half-path and back on another, if there is one.
    fn pair(&self, out: &HalfPathTracer, back: &HalfPathTracer) -> Option<Pair> {
        let settings = &self.plan.settings;
        let circle = &self.plan.cylinders.circles[out.half_path.cylinder as usize];
        let gain = out.half_path.gain * back.half_path.gain * circle.gain;
        let (contacts, angle_rad) = stationary_contact(out, back, circle.radius_m)?;
        let [one, other] = &contacts;
        let off =
            |contact: &Contact| circle.radius_m * contact.slope * (angle_rad - contact.angle_rad);
        let length_m = one.length_m + off(one) + other.length_m + off(other);
        let amplitude = self.amplitude(&contacts, circle, gain);
        let departures = [out.departure(one.at_rad), back.departure(other.at_rad)];
        let heard =
            self.bound.map_or(1.0, |bound| bound.at(turn_rad(departures[0], departures[1]).abs()));
        let floor = settings.contact_floor(out.half_path.level > 0, length_m);
        let fits = length_m <= settings.max_path_m && amplitude * heard >= floor;
        fits.then_some(Pair {
            cylinder: out.half_path.cylinder,
            own_reverse: std::ptr::eq(out.half_path, back.half_path),
            rays: [(out.half_path, one), (back.half_path, other)].map(|(half_path, contact)| {
                CylinderRay {
                    view: half_path.view,
                    link: half_path.link,
                    contact_rad: contact.at_rad,
                }
            }),
            angle_rad,
            legs: [out.leg(one.at_rad), back.leg(other.at_rad)],
            echo: Echo {
                length_m,
                amplitude,
                phase_rad: 0.0,
                departure: departures[0],
                arrival: departures[1],
                rise_rad: [0.0; 2],
                image: 0,
                slopes: [out.slopes(), back.slopes()],
                is_repeated: out.half_path.level > 0,
                via: Via::Cylinder { connection: 0 },
            },
        })
    }

    /// Amplitude of an echo with these contacts: `sqrt(L / w)` by the equation of
    /// [`strength`](super::strength), times what surfaces and air leave.
    fn amplitude(&self, [one, other]: &[Contact; 2], circle: &Circle, gain: f64) -> f64 {
        let length_m = one.length_m + other.length_m;
        let cosine = 0.5 * (one.cosine + other.cosine);
        let width_m = one.growth * other.width_m
            + one.width_m * other.growth
            + 2.0 * one.width_m * other.width_m / (circle.radius_m * cosine);
        gain * self.plan.settings.air_gain(length_m) * (length_m / width_m).sqrt()
    }

    fn push(&mut self, pair: &Pair, [out, back]: [OneWay; 2], both_ways: bool) {
        let connection =
            Connection { cylinder: pair.cylinder, angle_rad: pair.angle_rad, out, back };
        let number = self.connections.len() as u32;
        self.connections.push(connection);
        self.echoes.push(Echo { via: Via::Cylinder { connection: number }, ..pair.echo });
        if both_ways {
            self.connections.push(Connection { out: back, back: out, ..connection });
            self.echoes.push(Echo {
                departure: pair.echo.arrival,
                arrival: pair.echo.departure,
                slopes: [pair.echo.slopes[1], pair.echo.slopes[0]],
                via: Via::Cylinder { connection: number + 1 },
                ..pair.echo
            });
        }
    }
}

/// An echo out of two half-paths.
struct Pair {
    cylinder: u32,
    /// Whether it comes back as it went.
    own_reverse: bool,
    /// Its rays to the cylinder, by way of others or direct.
    rays: [CylinderRay; 2],
    /// From the start to their first cylinders.
    legs: [Leg; 2],
    angle_rad: f64,
    echo: Echo,
}

impl Pair {
    /// Its half from one of its ends; a ray by way of other cylinders is kept among the `rays` from there.
    fn half(&self, end: usize, rays: &mut CylinderRays) -> OneWay {
        if self.rays[end].link == DIRECT {
            return OneWay::Walls(self.legs[end]);
        }
        rays.rays.push(self.rays[end]);
        OneWay::Cylinders(rays.rays.len() as u32 - 1)
    }
}

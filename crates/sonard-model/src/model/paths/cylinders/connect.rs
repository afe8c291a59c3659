//! Echoes that touch cylinders: two half-paths, connected at a common contact.
//!
//! The path of an echo read backwards is a path too (reciprocity). An echo of `n` contacts with
//! cylinders is therefore found from half-paths of half as many: one to its middle contact from the
//! start and one from the receiver, as in bidirectional tracing. The number of half-paths is the
//! square root of what a one-way search would follow, since each contact multiplies the paths.
//!
//! A middle contact has as many cylinders before it as after it, or one more.

use super::{
    contact::Contact,
    departures::Departures,
    groups::{HalfPathGroup, HalfPathGroups},
    half_path::{DIRECT, HalfPath, HalfPathTracer},
    rays::{CylinderRay, CylinderRays, OneWay},
    stationary::{SLACK, overlap, stationary_contact},
    strength::Strength,
};
use crate::{
    geometry::signed_angle_rad,
    model::{
        SearchPart,
        paths::{
            beams::{LitCylinder, RayLeg},
            echo::{PathEcho, Via},
            floor::{PlanCircle, TracingPlan},
            pattern::TwoWayBound,
        },
    },
};

/// Effort of connecting two half-paths, in steps of a beam.
const STEPS_PER_PAIR: usize = 32;

/// Contact in the middle of an echo path.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MiddleContact {
    pub(crate) cylinder: u32,
    /// Angle of the contact around the cylinder's centre, radians.
    pub(crate) angle_rad: f64,
    /// Path from the transmitter to the contact.
    pub(crate) out: OneWay,
    /// Path from the receiver to the contact, in the receiver's own tree if there is one.
    pub(crate) back: OneWay,
}

pub(crate) struct Connector<'a> {
    plan: &'a TracingPlan,
    bound: Option<&'a TwoWayBound>,
    pub(crate) connections: Vec<MiddleContact>,
    pub(crate) echoes: Vec<PathEcho>,
}

/// Half-paths from one start.
pub(crate) struct HalfPaths<'a> {
    pub(crate) views: &'a [LitCylinder],
    pub(crate) all: &'a [HalfPath],
    /// Destination of the rays of echoes.
    pub(crate) rays: &'a mut CylinderRays,
}

/// Half-paths from one start, grouped.
struct GroupedHalfPaths<'a> {
    views: &'a [LitCylinder],
    all: &'a [HalfPath],
    groups: HalfPathGroups,
}

impl<'a> Connector<'a> {
    pub(crate) fn new(plan: &'a TracingPlan, bound: Option<&'a TwoWayBound>) -> Self {
        Self { plan, bound, connections: Vec::new(), echoes: Vec::new() }
    }

    /// Connects the half-paths from a start to those from another start, or to each other.
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

    fn sorted<'b>(&self, from: &HalfPaths<'b>) -> GroupedHalfPaths<'b> {
        let groups = HalfPathGroups::new(from.all, self.plan.cylinders.circles.len());
        GroupedHalfPaths { views: from.views, all: from.all, groups }
    }

    /// Finds echoes out on half-paths from the transmitter and back on those from the receiver;
    /// from one start each pair once.
    fn pairs(&self, out: &GroupedHalfPaths, back: Option<&GroupedHalfPaths>) -> Vec<ConnectedPair> {
        let mut found = Vec::new();
        let other = back.unwrap_or(out);
        for (key, outs) in out.groups.by_cylinder.iter().enumerate() {
            // As many cylinders before as after, or one more.
            let lower = key.checked_sub(out.groups.cylinders).map(|lower| (lower, false));
            for (key, is_level) in [(key, true)].into_iter().chain(lower) {
                let Some(backs) = other.groups.by_cylinder.get(key) else { continue };
                let once = is_level && back.is_none();
                for group in outs {
                    let backs: Vec<&HalfPathGroup> = backs
                        .iter()
                        .filter(|back| self.may_connect_any(out, group, back))
                        .collect();
                    for &half_path in &group.half_paths {
                        self.connect_partners(out, half_path, other, &backs, once, &mut found);
                    }
                }
            }
        }
        found
    }

    /// Returns `true` if any half-path of a group can give an echo with any of another.
    fn may_connect_any(
        &self,
        out: &GroupedHalfPaths,
        group: &HalfPathGroup,
        back: &HalfPathGroup,
    ) -> bool {
        let is_repeated = out.all[group.half_paths[0] as usize].level > 0;
        let min_m = group.min_m + back.min_m;
        let floor = self.plan.settings.contact_floor(is_repeated, min_m).powi(2);
        let bound = group.max_strength.with(&back.max_strength);
        self.may_be_detected(bound, min_m, floor, [&group.departures, &back.departures])
    }

    /// Returns `true` if echoes of at most this power before the beam pattern, and of at least this
    /// length, can reach a floor of power.
    fn may_be_detected(
        &self,
        bound: f64,
        min_m: f64,
        floor: f64,
        [a, b]: [&Departures; 2],
    ) -> bool {
        // In any direction: a cheap test before the one that depends on directions.
        min_m <= self.plan.settings.max_path_m
            && bound * self.max_pattern_power() >= floor
            && bound * self.pattern_power(a, b) >= floor
    }

    /// Connects a half-path to others; with `once`, only to those whose number is not smaller.
    fn connect_partners(
        &self,
        out: &GroupedHalfPaths,
        number: u32,
        back: &GroupedHalfPaths,
        groups: &[&HalfPathGroup],
        once: bool,
        found: &mut Vec<ConnectedPair>,
    ) {
        let half_path = &out.all[number as usize];
        let floor = |other_m: f64| {
            self.plan.settings.contact_floor(half_path.level > 0, half_path.min_m + other_m).powi(2)
        };
        let mut tracer = None;
        for group in groups {
            let (bound, min_power) =
                (half_path.strength.with(&group.max_strength), floor(group.min_m));
            let min_m = half_path.min_m + group.min_m;
            let departures = [&half_path.departures, &group.departures];
            if !self.may_be_detected(bound, min_m, min_power, departures) {
                continue;
            }
            for &other in group.half_paths.iter().filter(|&&other| !once || other >= number) {
                let other = &back.all[other as usize];
                // Sorted by decreasing `x`, so the bound of all later ones decreases too.
                let bound = Strength { x: other.strength.x, ..group.max_strength };
                if half_path.strength.with(&bound) < min_power {
                    break;
                }
                if !self.plan.effort.step(SearchPart::Cylinders, 1) {
                    return;
                }
                if self.may_connect(half_path, other, floor(other.min_m)) {
                    let tracer = tracer.get_or_insert_with(|| {
                        HalfPathTracer::new(self.plan, out.views, half_path)
                    });
                    let other = HalfPathTracer::new(self.plan, back.views, other);
                    self.plan.effort.step(SearchPart::Cylinders, STEPS_PER_PAIR);
                    let pair = self.pair(tracer, &other);
                    self.plan.effort.keep::<(ConnectedPair, PathEcho, PathEcho)>(pair.iter().len());
                    found.extend(pair);
                }
            }
        }
    }

    /// Upper bound of the two-way pattern's power for echoes with these departures.
    fn pattern_power(&self, a: &Departures, b: &Departures) -> f64 {
        self.bound.map_or(1.0, |bound| bound.at(a.gap_rad(b)).powi(2))
    }

    /// Upper bound of the two-way pattern's power over all directions.
    fn max_pattern_power(&self) -> f64 {
        self.bound.map_or(1.0, |bound| bound.at(0.0).powi(2))
    }

    /// Cheap tests: returns `false` if two half-paths cannot give an echo.
    fn may_connect(&self, out: &HalfPath, back: &HalfPath, floor: f64) -> bool {
        let [[a, b], [c, d]] = [&out.ends, &back.ends];
        let bound = out.strength.with(&back.strength);
        out.min_m + back.min_m <= self.plan.settings.max_path_m
            && a.slope + c.slope < SLACK
            && b.slope + d.slope > -SLACK
            && bound * self.max_pattern_power() >= floor
            && overlap(&out.ends, &back.ends).is_some()
            && bound * self.pattern_power(&out.departures, &back.departures) >= floor
            && self.plan.settings.allows(out.order + back.order + 1)
    }

    /// Returns the echo out on one half-path and back on another, if there is one.
    fn pair(&self, out: &HalfPathTracer, back: &HalfPathTracer) -> Option<ConnectedPair> {
        let settings = &self.plan.settings;
        let circle = &self.plan.cylinders.circles[out.half_path.cylinder as usize];
        let gain = out.half_path.gain * back.half_path.gain * circle.gain;
        let (contacts, angle_rad) = stationary_contact(out, back, circle.radius_m)?;
        let [a, b] = &contacts;
        let off =
            |contact: &Contact| circle.radius_m * contact.slope * (angle_rad - contact.angle_rad);
        let length_m = a.length_m + off(a) + b.length_m + off(b);
        let amplitude = self.amplitude(&contacts, circle, gain);
        let departures = [out.departure(a.at_rad), back.departure(b.at_rad)];
        let pattern_gain = self
            .bound
            .map_or(1.0, |bound| bound.at(signed_angle_rad(departures[0], departures[1]).abs()));
        let floor = settings.contact_floor(out.half_path.level > 0, length_m);
        let fits = length_m <= settings.max_path_m && amplitude * pattern_gain >= floor;
        fits.then_some(ConnectedPair {
            cylinder: out.half_path.cylinder,
            own_reverse: std::ptr::eq(out.half_path, back.half_path),
            rays: [(out.half_path, a), (back.half_path, b)].map(|(half_path, contact)| {
                CylinderRay {
                    view: half_path.view,
                    link: half_path.link,
                    contact_rad: contact.at_rad,
                }
            }),
            angle_rad,
            legs: [out.leg(a.at_rad), back.leg(b.at_rad)],
            echo: PathEcho {
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
    /// [`strength`](super::strength), times the losses at surfaces and in air.
    fn amplitude(&self, [a, b]: &[Contact; 2], circle: &PlanCircle, gain: f64) -> f64 {
        let length_m = a.length_m + b.length_m;
        let cosine = 0.5 * (a.cosine + b.cosine);
        let width_m = a.growth * b.width_m
            + a.width_m * b.growth
            + 2.0 * a.width_m * b.width_m / (circle.radius_m * cosine);
        gain * self.plan.settings.air_gain(length_m) * (length_m / width_m).sqrt()
    }

    fn push(&mut self, pair: &ConnectedPair, [out, back]: [OneWay; 2], both_ways: bool) {
        let connection =
            MiddleContact { cylinder: pair.cylinder, angle_rad: pair.angle_rad, out, back };
        let number = self.connections.len() as u32;
        self.connections.push(connection);
        self.echoes.push(PathEcho { via: Via::Cylinder { connection: number }, ..pair.echo });
        if both_ways {
            self.connections.push(MiddleContact { out: back, back: out, ..connection });
            self.echoes.push(PathEcho {
                departure: pair.echo.arrival,
                arrival: pair.echo.departure,
                slopes: [pair.echo.slopes[1], pair.echo.slopes[0]],
                via: Via::Cylinder { connection: number + 1 },
                ..pair.echo
            });
        }
    }
}

/// An echo composed of two half-paths.
struct ConnectedPair {
    cylinder: u32,
    /// `true` if the path returns along itself.
    own_reverse: bool,
    /// Rays to the cylinder, by way of others or direct.
    rays: [CylinderRay; 2],
    /// Legs from the start to the first cylinders.
    legs: [RayLeg; 2],
    angle_rad: f64,
    echo: PathEcho,
}

impl ConnectedPair {
    /// Returns the half from one end. A ray by way of other cylinders is added to the `rays` from
    /// there.
    fn half(&self, end: usize, rays: &mut CylinderRays) -> OneWay {
        if self.rays[end].link == DIRECT {
            return OneWay::Walls(self.legs[end]);
        }
        rays.rays.push(self.rays[end]);
        OneWay::Cylinders(rays.rays.len() as u32 - 1)
    }
}

//! Echoes that touch cylinders: two arms that meet at one.
//!
//! The way of an echo read backwards is a way too. So an echo of `n` contacts with cylinders is
//! found from ways of half as many: one to its middle contact from the start and one from the
//! receiver. What is followed that way is the square root of what one-way search would have to
//! follow, since behind each contact there are several times more ways.
//!
//! Along a surface the length of an arm is convex: `L'' = r cos i + r^2 cos^2 i / R`. The sum of two
//! is stationary at one place at most (Fermat: there the sound leaves as a mirror would have it),
//! and Newton's method finds it. A middle contact has as many cylinders before it as after it, or
//! one more.

use super::{
    Echo, Paths, Via,
    arms::{Arm, ArmTracer, Contact, DIRECT, Leaves, Strength},
    beam::TIE_M,
    interactions::{Leg, Part},
    rounds::Circle,
    trace::{Tree, View},
    tube::Curved,
    wheel::Both,
};
use crate::geometry::wrap_pi;

/// The contact in the middle of an echo's way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint {
    pub(super) cylinder: u32,
    /// Angle of the contact around its centre, radians.
    pub(super) place_rad: f64,
    /// From the transmitter to there.
    pub(super) out: Part,
    /// From the receiver to there, in its own tree if it has one.
    pub(super) back: Part,
}

/// Newton's steps at most; four are usual.
const MOST_STEPS: usize = 40;

/// A contact is found when both arms have it to within this, radians.
const SAME_PLACE_RAD: f64 = 1e-11;

/// Arms of one place, by cylinder and level, strongest first.
pub(super) struct Meeting<'a> {
    pub(super) paths: &'a Paths,
    pub(super) both: Option<&'a Both>,
    pub(super) joints: Vec<Joint>,
    pub(super) echoes: Vec<Echo>,
}

/// The arms from one place.
struct Side<'a> {
    views: &'a [View],
    arms: &'a [Arm],
    groups: Groups,
}

impl Meeting<'_> {
    /// All echoes between the arms from a place and those from another, or from the same.
    pub(super) fn join(
        &mut self,
        tree: &mut Tree,
        arms: &[Arm],
        other: Option<(&mut Tree, &[Arm])>,
    ) {
        let count = self.paths.rounds.circles.len();
        let groups = Groups::of(arms, count);
        let out = Side { views: &tree.to_cylinders, arms, groups };
        match other {
            None => {
                for pair in self.pairs(&out, None) {
                    let parts = [0, 1].map(|end| pair.part(end, tree));
                    self.push(&pair, parts, !pair.own_reverse);
                }
            }
            Some((other, others)) => {
                let groups = Groups::of(others, count);
                let back = Side { views: &other.to_cylinders, arms: others, groups };
                for pair in self.pairs(&out, Some(&back)) {
                    let parts = [pair.part(0, tree), pair.part(1, other)];
                    self.push(&pair, parts, false);
                }
            }
        }
    }

    /// Echoes out on one side's arms and back on the other's; on one side alone each pair once.
    fn pairs(&self, out: &Side, back: Option<&Side>) -> Vec<Pair> {
        let mut found = Vec::new();
        let other = back.unwrap_or(out);
        for (key, outs) in out.groups.arms.iter().enumerate() {
            // As many cylinders before as after, or one more.
            let lower = key.checked_sub(out.groups.cylinders).map(|lower| (lower, false));
            for (key, is_level) in [(key, true)].into_iter().chain(lower) {
                let Some(backs) = other.groups.arms.get(key) else { continue };
                let once = is_level && back.is_none();
                for &arm in outs.iter().flat_map(|sheaf| &sheaf.arms) {
                    self.partners_of(out, arm, other, backs, once, &mut found);
                }
            }
        }
        found
    }

    /// Joins an arm with others; with `once`, only with those whose number is not smaller.
    fn partners_of(
        &self,
        out: &Side,
        number: u32,
        back: &Side,
        sheaves: &[Sheaf],
        once: bool,
        found: &mut Vec<Pair>,
    ) {
        let arm = &out.arms[number as usize];
        let floor = |other_m: f64| {
            self.paths.settings.round_floor(arm.level, arm.least_m + other_m).powi(2)
        };
        let tracer = ArmTracer::new(self.paths, out.views, arm);
        for sheaf in sheaves {
            let most = arm.strength.with(&sheaf.most) * self.heard(&arm.leaves, &sheaf.leaves);
            if most < floor(sheaf.least_m) {
                continue;
            }
            for &other in sheaf.arms.iter().filter(|&&other| !once || other >= number) {
                let other = &back.arms[other as usize];
                // Sorted by `x`.
                let most = Strength { x: other.strength.x, ..sheaf.most };
                if arm.strength.with(&most) < floor(sheaf.least_m) {
                    break;
                }
                if self.may_meet(arm, other, floor(other.least_m)) {
                    let other = ArmTracer::new(self.paths, back.views, other);
                    found.extend(self.pair(&tracer, &other));
                }
            }
        }
    }

    /// Most of the power that is heard of echoes that leave and come back like this.
    fn heard(&self, one: &Leaves, other: &Leaves) -> f64 {
        self.both.map_or(1.0, |both| both.heard(one.gap_rad(other)).powi(2))
    }

    /// Cheap tests: whether two arms can give an echo at all.
    fn may_meet(&self, out: &Arm, back: &Arm, floor: f64) -> bool {
        let [[a, b], [c, d]] = [&out.ends, &back.ends];
        a.slope + c.slope < SLACK
            && b.slope + d.slope > -SLACK
            && out.strength.with(&back.strength) * self.heard(&out.leaves, &back.leaves) >= floor
            && self.paths.settings.allows(out.order + back.order + 1)
    }

    /// The echo out on one arm and back on another, if there is one.
    fn pair(&self, out: &ArmTracer, back: &ArmTracer) -> Option<Pair> {
        let settings = &self.paths.settings;
        let circle = &self.paths.rounds.circles[out.arm.cylinder as usize];
        let gain = out.arm.gain * back.arm.gain * circle.gain;
        let (contacts, place_rad) = meet(out, back, circle.radius_m)?;
        let [one, other] = &contacts;
        let off =
            |contact: &Contact| circle.radius_m * contact.slope * (place_rad - contact.place_rad);
        let length_m = one.length_m + off(one) + other.length_m + off(other);
        let amplitude = self.amplitude(&contacts, circle, gain);
        let leaves = [out.departure(one.at_rad), back.departure(other.at_rad)];
        let heard = self.both.map_or(1.0, |both| both.heard(leaves[0].angle_to(leaves[1]).abs()));
        let floor = settings.round_floor(out.arm.level, length_m);
        let fits = length_m <= settings.max_path_m && amplitude * heard >= floor;
        fits.then_some(Pair {
            cylinder: out.arm.cylinder,
            own_reverse: std::ptr::eq(out.arm, back.arm),
            ways: [(out.arm, one), (back.arm, other)].map(|(arm, contact)| Curved {
                view: arm.view,
                link: arm.link,
                contact_rad: contact.at_rad,
            }),
            place_rad,
            legs: [out.leg(one.at_rad), back.leg(other.at_rad)],
            echo: Echo {
                length_m,
                amplitude,
                phase_rad: 0.0,
                departure: leaves[0],
                arrival: leaves[1],
                rise_rad: [0.0; 2],
                image: 0,
                via: Via::Cylinder { joint: 0 },
            },
        })
    }

    /// Amplitude of an echo with these contacts.
    fn amplitude(&self, [one, other]: &[Contact; 2], circle: &Circle, gain: f64) -> f64 {
        let length_m = one.length_m + other.length_m;
        let cosine = 0.5 * (one.cosine + other.cosine);
        let width_m = one.growth * other.width_m
            + one.width_m * other.growth
            + 2.0 * one.width_m * other.width_m / (circle.radius_m * cosine);
        gain * self.paths.settings.air_gain(length_m) * (length_m / width_m).sqrt()
    }

    fn push(&mut self, pair: &Pair, [out, back]: [Part; 2], both_ways: bool) {
        let joint = Joint { cylinder: pair.cylinder, place_rad: pair.place_rad, out, back };
        let number = self.joints.len() as u32;
        self.joints.push(joint);
        self.echoes.push(Echo { via: Via::Cylinder { joint: number }, ..pair.echo });
        if both_ways {
            self.joints.push(Joint { out: back, back: out, ..joint });
            self.echoes.push(Echo {
                departure: pair.echo.arrival,
                arrival: pair.echo.departure,
                via: Via::Cylinder { joint: number + 1 },
                ..pair.echo
            });
        }
    }
}

/// Slopes this little past each other still meet.
const SLACK: f64 = 1e-9;

/// Arms by level and cylinder: each level has a group for each of the `cylinders`.
struct Groups {
    arms: Vec<Vec<Sheaf>>,
    cylinders: usize,
}

/// Arms that leave in similar directions, by falling `x`.
struct Sheaf {
    arms: Vec<u32>,
    leaves: Leaves,
    /// The most of `x` and of `y`.
    most: Strength,
    /// The shortest one's length, metres.
    least_m: f64,
}

/// How far apart departures in a sheaf are, radians.
const SHEAF_RAD: f64 = 0.1;

impl Groups {
    fn of(all: &[Arm], cylinders: usize) -> Self {
        let mut arms: Vec<Vec<Sheaf>> = Vec::new();
        let place = |arm: &Arm| {
            let key = arm.level as usize * cylinders + arm.cylinder as usize;
            (key, (arm.leaves.middle_rad / SHEAF_RAD).floor() as i64)
        };
        let mut order: Vec<u32> = (0..all.len() as u32).collect();
        order.sort_by(|&one, &other| {
            let [one, other] = [one, other].map(|index| &all[index as usize]);
            let by_x = other.strength.x.total_cmp(&one.strength.x);
            place(one).cmp(&place(other)).then(by_x)
        });
        let same =
            |&one: &u32, &other: &u32| place(&all[one as usize]) == place(&all[other as usize]);
        for sheaf in order.chunk_by(same) {
            let (key, _) = place(&all[sheaf[0] as usize]);
            if arms.len() <= key {
                arms.resize_with(key + 1, Vec::new);
            }
            arms[key].push(Sheaf::of(sheaf, all));
        }
        Self { arms, cylinders }
    }
}

impl Sheaf {
    fn of(arms: &[u32], all: &[Arm]) -> Self {
        let first = all[arms[0] as usize].leaves;
        let each = || arms.iter().map(|&index| &all[index as usize]);
        let reach = |arm: &Arm| {
            wrap_pi(arm.leaves.middle_rad - first.middle_rad).abs() + arm.leaves.half_rad
        };
        let half_rad = each().map(reach).fold(0.0, f64::max);
        let most = each().map(|arm| arm.strength).fold(Strength::default(), Strength::max);
        let least_m = each().map(|arm| arm.least_m).fold(f64::INFINITY, f64::min);
        Self { arms: arms.to_vec(), leaves: Leaves { half_rad, ..first }, most, least_m }
    }
}

/// An echo out of two arms.
struct Pair {
    cylinder: u32,
    /// Whether it comes back as it went.
    own_reverse: bool,
    /// Its ways to the cylinder, by way of others or direct.
    ways: [Curved; 2],
    /// From the start to their first cylinders.
    legs: [Leg; 2],
    place_rad: f64,
    echo: Echo,
}

impl Pair {
    fn part(&self, end: usize, tree: &mut Tree) -> Part {
        if self.ways[end].link == DIRECT {
            return Part::Flat(self.legs[end]);
        }
        tree.curved.push(self.ways[end]);
        Part::Curved(tree.curved.len() as u32 - 1)
    }
}

/// Where two arms meet as a mirror would have it, and the place; `None` if nowhere.
fn meet(one: &ArmTracer, other: &ArmTracer, radius_m: f64) -> Option<([Contact; 2], f64)> {
    let [a, b] = [&one.arm.ends, &other.arm.ends];
    let middle = 0.5 * (a[0].place_rad + a[1].place_rad);
    let others = 0.5 * (b[0].place_rad + b[1].place_rad);
    let turn = middle + wrap_pi(others - middle) - others;
    let low = a[0].place_rad.max(b[0].place_rad + turn);
    let high = a[1].place_rad.min(b[1].place_rad + turn);
    if high < low {
        return None;
    }
    // Straight lines through the ends for a start.
    let slope = |[from, to]: &[Contact; 2], place: f64| {
        let rate = (to.slope - from.slope) / (to.place_rad - from.place_rad);
        (from.slope + rate * (place - from.place_rad), rate)
    };
    let ((t, rate), (u, other_rate)) = (slope(a, low), slope(b, low - turn));
    let start = (low - (t + u) / (rate + other_rate)).max(low).min(high);
    let mut at = [guess(a, start), guess(b, start - turn)];
    for _ in 0..MOST_STEPS {
        let p = one.contact(at[0], middle);
        let mut q = other.contact(at[1], others);
        q.place_rad += turn;
        let rates =
            [&p, &q].map(|c| c.cosine + radius_m * c.cosine * c.cosine * c.growth / c.width_m);
        let sum = rates[0] * p.place_rad + rates[1] * q.place_rad - p.slope - q.slope;
        let best = sum / (rates[0] + rates[1]);
        let place = best.max(low).min(high);
        let miss = (place - p.place_rad).abs().max((place - q.place_rad).abs());
        if miss < SAME_PLACE_RAD {
            let is_inside = (best - place).abs() * radius_m <= TIE_M;
            return is_inside.then_some(([p, q], place));
        }
        at[0] = step(one.arm, &p, place);
        at[1] = step(other.arm, &q, place);
    }
    meet_slowly(one, other, [low, high], [middle, others, turn])
}

/// The same by searching along the surface, for the few places between which Newton's steps run to
/// and fro.
fn meet_slowly(
    one: &ArmTracer,
    other: &ArmTracer,
    [low, high]: [f64; 2],
    [middle, others, turn]: [f64; 3],
) -> Option<([Contact; 2], f64)> {
    let at = |place: f64| {
        let p = one.contact_at(place, middle);
        let mut q = other.contact_at(place - turn, others);
        q.place_rad += turn;
        [p, q]
    };
    let sum = |place: f64| at(place).map(|contact| contact.slope).iter().sum::<f64>();
    let ends = [low, high].map(sum);
    if ends[0] > SLACK || ends[1] < -SLACK {
        return None;
    }
    let (mut from, mut to) = (low, high);
    while to - from > SAME_PLACE_RAD {
        let middle = 0.5 * (from + to);
        if sum(middle) < 0.0 { from = middle } else { to = middle }
    }
    let place = 0.5 * (from + to);
    Some((at(place), place))
}

fn guess([from, to]: &[Contact; 2], place: f64) -> f64 {
    let share = (place - from.place_rad) / (to.place_rad - from.place_rad);
    from.at_rad + share.clamp(0.0, 1.0) * (to.at_rad - from.at_rad)
}

fn step(arm: &Arm, contact: &Contact, place_rad: f64) -> f64 {
    let next = contact.at_rad + (place_rad - contact.place_rad) / contact.place_rate;
    next.max(arm.span.from_rad).min(arm.span.to_rad)
}

//! Walls and cylinders that do not reach from floor to ceiling.
//!
//! Without floor and ceiling all sound stays at the ranger's height, and what does not stand there
//! is not there. With them a path has a height at each place. Beams then both turn at such a wall
//! and pass it, and a path counts if it meets its walls where they stand and the others where they
//! do not. What their upper and lower edges bend comes on its own (`rims`).

use std::collections::HashMap;

use rstar::{
    AABB, RTree,
    primitives::{GeomWithData, Rectangle},
};

use super::{Echo, Paths, Trees, beam::TIE_M};
use crate::{
    geometry::{Arrangement, DVec2, Piece, SNAP_M, between},
    model::{Mechanism, Reflector},
    scene::Scene,
};

/// Heights of a scene around a ranger.
#[derive(Debug, Default)]
pub(super) struct Heights {
    floor_z_m: Option<f64>,
    ceiling_z_m: Option<f64>,
    /// The ranger's.
    z_m: f64,
    /// By wall and by cylinder, from and to where; without limits `None`.
    walls: Vec<Option<[f64; 2]>>,
    cylinders: Vec<Option<[f64; 2]>>,
    /// Walls with limits, with their ends in the plan.
    limited: RTree<Limited>,
}

/// A wall with limits, in the box around it.
type Limited = GeomWithData<Rectangle<[f64; 2]>, (u32, [DVec2; 2])>;

impl Heights {
    pub(super) fn new(scene: &Scene, segments: &[(DVec2, DVec2)], z_m: f64) -> Self {
        let walls: Vec<_> = scene.walls.iter().map(|wall| wall.z_m).collect();
        let limited = (0..)
            .zip(&walls)
            .filter(|(_, limits)| limits.is_some())
            .map(|(wall, _)| {
                let (a, b) = segments[wall as usize];
                let around = Rectangle::from_corners(a.to_array(), b.to_array());
                Limited::new(around, (wall, [a, b]))
            })
            .collect();
        Self {
            floor_z_m: scene.floor_z_m,
            ceiling_z_m: scene.ceiling_z_m,
            z_m,
            walls,
            cylinders: scene.cylinders.iter().map(|cylinder| cylinder.z_m).collect(),
            limited: RTree::bulk_load(limited),
        }
    }

    /// Whether a path has different heights on its way.
    fn rises(&self) -> bool {
        self.floor_z_m.is_some() || self.ceiling_z_m.is_some()
    }

    /// Whether what stands between such heights can matter at all.
    pub(super) fn is_there(&self, limits: Option<[f64; 2]>) -> bool {
        self.rises() || holds(limits, self.z_m)
    }

    /// Whether nothing passes a cylinder with such limits.
    pub(super) fn is_opaque(&self, limits: Option<[f64; 2]>) -> bool {
        !(self.rises() && limits.is_some())
    }

    /// Whether sound can pass a wall below or above.
    pub(super) fn lets_pass(&self, wall: u32) -> bool {
        self.rises() && self.walls[wall as usize].is_some()
    }

    /// Walls that stand above or below the one that the plan knows at the same place, by [`between`] their
    /// ends. Of walls that share heights there the one given first counts.
    pub(super) fn stacked(&self, plan: &Arrangement) -> HashMap<[u32; 2], Vec<u32>> {
        if !self.rises() {
            return HashMap::new();
        }
        let others = |piece: &Piece| {
            let ends = between(piece.ends);
            let mut stack = vec![piece.segment];
            for &wall in plan.covered.get(&ends)? {
                if stack.iter().all(|&other| self.are_apart(wall, other)) {
                    stack.push(wall);
                }
            }
            Some((ends, stack.split_off(1)))
        };
        plan.pieces.iter().filter_map(others).collect()
    }

    fn are_apart(&self, one: u32, other: u32) -> bool {
        let [one, other] = [one, other].map(|wall| self.walls[wall as usize]);
        one.zip(other).is_some_and(|([a, b], [c, d])| b <= c || d <= a)
    }

    /// How far above the ranger the level edges of a wall with limits are, metres, and whether each is
    /// its upper one. Where it stands on the floor or reaches the ceiling it has none.
    pub(super) fn rims(&self, wall: u32) -> impl Iterator<Item = (f64, bool)> {
        let limits = self.walls[wall as usize].unwrap_or_default();
        let has = self.has_rims(limits);
        let rim = move |end: usize| has[end].then_some((limits[end] - self.z_m, end == 1));
        [0, 1].into_iter().filter_map(rim)
    }

    /// How far above the ranger a level edge of a wall is, metres.
    pub(super) fn rim_rise_m(&self, wall: u32, is_upper: bool) -> f64 {
        let limits = self.walls[wall as usize].unwrap_or_default();
        limits[usize::from(is_upper)] - self.z_m
    }

    /// Whether what stands between such heights ends above the floor, and below the ceiling.
    fn has_rims(&self, [from_m, to_m]: [f64; 2]) -> [bool; 2] {
        let lower = self.floor_z_m.is_none_or(|floor| from_m > floor);
        let upper = self.ceiling_z_m.is_none_or(|ceiling| to_m < ceiling);
        [lower, upper]
    }

    /// Whether paths have to be asked where they meet things.
    fn matter(&self) -> bool {
        let low_round = self.cylinders.iter().any(Option::is_some);
        self.rises() && (low_round || self.limited.size() > 0)
    }

    /// Whether a wall with limits stands in the way of what crosses its line at a height. On a rim it
    /// does not: there the whole way counts, of which the rim's echo takes half away.
    fn stands_at(&self, wall: u32, z_m: f64) -> bool {
        let [from_m, to_m] = self.walls[wall as usize].unwrap_or_default();
        let [lower, upper] = self.has_rims([from_m, to_m]);
        (!lower || z_m > from_m + TIE_M) && (!upper || z_m < to_m - TIE_M)
    }

    fn limits(&self, reflector: Reflector) -> Option<[f64; 2]> {
        match reflector {
            Reflector::Wall(wall) => self.walls[wall as usize],
            Reflector::Cylinder(cylinder) => self.cylinders[cylinder as usize],
            Reflector::Floor | Reflector::Ceiling => None,
        }
    }

    /// Whether something between such heights is met between two heights of a path that would be
    /// there if floor and ceiling were windows.
    fn bars(&self, limits: Option<[f64; 2]>, straight_m: [f64; 2]) -> bool {
        let Some([from_m, to_m]) = limits else { return true };
        let [low_m, high_m] = [straight_m[0].min(straight_m[1]), straight_m[0].max(straight_m[1])];
        // Where it turns at floor and ceiling in between.
        let images = [self.floor_z_m, self.ceiling_z_m].into_iter().flatten();
        let turns = images.filter(|&at| {
            let period = match (self.floor_z_m, self.ceiling_z_m) {
                (Some(floor), Some(ceiling)) => 2.0 * (ceiling - floor),
                _ => f64::INFINITY,
            };
            let next =
                if period.is_finite() { at + ((low_m - at) / period).ceil() * period } else { at };
            (low_m..=high_m).contains(&next)
        });
        let ends = [low_m, high_m].map(|z_m| self.folded_m(z_m));
        let (low_m, high_m) = ends
            .into_iter()
            .chain(turns)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z_m| {
                (low.min(z_m), high.max(z_m))
            });
        low_m <= to_m && high_m >= from_m
    }

    /// The height of a path that would have climbed so far if floor and ceiling were windows, metres;
    /// `None` without either.
    pub(super) fn z_at(&self, climbed_m: f64) -> Option<f64> {
        self.rises().then(|| self.folded_m(self.z_m + climbed_m))
    }

    /// Where a path is reflected that climbs so far if floor and ceiling are windows, metres, in `count`
    /// reflections; downwards it comes to the floor first.
    pub(super) fn bounces(&self, climb_m: f64, count: u16) -> impl Iterator<Item = Bounce> {
        let mut surfaces =
            [(Reflector::Floor, self.floor_z_m), (Reflector::Ceiling, self.ceiling_z_m)];
        if climb_m > 0.0 {
            surfaces.reverse();
        }
        let first_m = surfaces[0].1.map_or(0.0, |z_m| (z_m - self.z_m).abs());
        let apart_m =
            self.floor_z_m.zip(self.ceiling_z_m).map_or(0.0, |(floor, ceiling)| ceiling - floor);
        (0..count).filter_map(move |number| {
            let (surface, z_m) = surfaces[usize::from(number % 2)];
            let share = (first_m + f64::from(number) * apart_m) / climb_m.abs();
            Some(Bounce { share, surface, z_m: z_m? })
        })
    }

    /// The height of a path that would be at `z_m` if floor and ceiling were windows.
    fn folded_m(&self, z_m: f64) -> f64 {
        match (self.floor_z_m, self.ceiling_z_m) {
            (None, None) => z_m,
            (Some(floor), None) => floor + (z_m - floor).abs(),
            (None, Some(ceiling)) => ceiling - (ceiling - z_m).abs(),
            (Some(floor), Some(ceiling)) => {
                let height = ceiling - floor;
                let above = (z_m - floor).rem_euclid(2.0 * height);
                floor + above.min(2.0 * height - above)
            }
        }
    }
}

/// A reflection at floor or ceiling.
pub(super) struct Bounce {
    /// After which share of the path's length.
    pub(super) share: f64,
    pub(super) surface: Reflector,
    pub(super) z_m: f64,
}

fn holds(limits: Option<[f64; 2]>, z_m: f64) -> bool {
    // On the very end counts as met; a rim's echo knows that.
    limits.is_none_or(|[from, to]| (from - TIE_M..=to + TIE_M).contains(&z_m))
}

impl Paths {
    /// Leaves out echoes whose path misses a wall above or below, or is barred by one.
    pub(super) fn retain_clear(&self, trees: &Trees, echoes: &mut Vec<Echo>) {
        if self.heights.matter() {
            echoes.retain(|echo| self.is_clear(trees, echo));
        }
    }

    fn is_clear(&self, trees: &Trees, echo: &Echo) -> bool {
        let [start, target] = trees.ends;
        let ends = Ends { start, end: Some(target), rise_m: self.image(echo.image).rise_m };
        self.is_way_clear(&self.contacts(trees, echo, target), &ends)
    }

    /// Whether a way meets its contacts where they stand, and nothing else.
    pub(super) fn is_way_clear(&self, contacts: &[(DVec2, Mechanism)], ends: &Ends) -> bool {
        let heights = &self.heights;
        let points = || {
            let first = [(ends.start, None)].into_iter();
            let last = ends.end.map(|end| (end, None));
            first.chain(contacts.iter().map(|&(at, what)| (at, what.surface()))).chain(last)
        };
        let plan_m: f64 =
            points().zip(points().skip(1)).map(|((a, _), (b, _))| a.distance(b)).sum();
        // As if floor and ceiling were windows.
        let straight_z = |along_m: f64| heights.z_m + ends.rise_m * along_m / plan_m;
        let mut along_m = 0.0;
        let mut left_contacts = contacts.len();
        for ((from, left), (to, met)) in points().zip(points().skip(1)) {
            let leg_m = from.distance(to);
            let z_at = |share: f64| straight_z(along_m + share * leg_m);
            if self.is_barred([from, to], [left, met], z_at) {
                return false;
            }
            left_contacts = left_contacts.saturating_sub(1);
            let is_rim = ends.end.is_none() && left_contacts == 0;
            let z_m = heights.folded_m(z_at(1.0));
            if !is_rim && met.is_some_and(|met| !holds(heights.limits(met), z_m)) {
                return false;
            }
            along_m += leg_m;
        }
        true
    }

    /// Whether something with limits stands in a leg between two surfaces, whose height (as if floor
    /// and ceiling were windows) is given for each share of it.
    fn is_barred(
        &self,
        [from, to]: [DVec2; 2],
        own: [Option<Reflector>; 2],
        z_at: impl Fn(f64) -> f64,
    ) -> bool {
        let heights = &self.heights;
        let around = AABB::from_corners(from.to_array(), to.to_array());
        let by_wall = heights.limited.locate_in_envelope_intersecting(around).any(|near| {
            let (wall, ends) = near.data;
            !own.contains(&Some(Reflector::Wall(wall)))
                && crossing(from, to, ends)
                    .is_some_and(|share| heights.stands_at(wall, heights.folded_m(z_at(share))))
        });
        let by_cylinder = || {
            self.rounds.circles.iter().zip(0..).any(|(circle, cylinder)| {
                !circle.is_opaque
                    && !own.contains(&Some(Reflector::Cylinder(cylinder)))
                    && circle.chord(from, to).is_some_and(|chord| {
                        heights.bars(heights.cylinders[cylinder as usize], chord.map(&z_at))
                    })
            })
        };
        by_wall || by_cylinder()
    }
}

/// Where a way begins and ends.
pub(super) struct Ends {
    pub(super) start: DVec2,
    /// `None` for one that ends at its last contact, the rim of a wall.
    pub(super) end: Option<DVec2>,
    /// How much higher it ends, if floor and ceiling are windows, metres.
    pub(super) rise_m: f64,
}

/// Where on the way from `from` to `to` a segment is crossed, as a share of it; none at its very ends,
/// where it comes to a corner of which that segment is the other wall.
fn crossing(from: DVec2, to: DVec2, [a, b]: [DVec2; 2]) -> Option<f64> {
    let (run, along) = (to - from, b - a);
    let slant = run.perp_dot(along);
    let share = (a - from).perp_dot(along) / slant;
    let place = (a - from).perp_dot(run) / slant;
    let off_ends_m = share.min(1.0 - share) * run.length();
    (off_ends_m > 2.0 * SNAP_M && (0.0..=1.0).contains(&place)).then_some(share)
}

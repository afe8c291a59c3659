//! Walls and cylinders that do not reach from floor to ceiling.
//!
//! Without floor and ceiling all sound stays at the ranger's height, and objects at other heights
//! are ignored. With them a path has a height at each point. Beams then both reflect at such a wall
//! and pass it. A path counts if it hits its walls within their heights and passes the others
//! outside theirs. Diffraction at their level edges is listed separately
//! ([`diffraction`](crate::model::paths::diffraction)).

use std::collections::HashMap;

use rstar::{
    RTree,
    primitives::{GeomWithData, Rectangle},
};

use super::images::{HorizontalMirror, VerticalImage, images};
use crate::{
    geometry::{Arrangement, DVec2, SegmentPiece, edge_key},
    model::{
        Reflector,
        paths::{
            floor::{Climbs, Spans, WallClimbs, united},
            settings::PathSettings,
            tolerance::TIE_M,
        },
    },
    scene::{Material, Scene},
};

/// Heights of a scene around a ranger.
#[derive(Debug, Default)]
pub(crate) struct Heights {
    floor_z_m: Option<f64>,
    ceiling_z_m: Option<f64>,
    /// Height of the ranger.
    pub(crate) z_m: f64,
    /// Lower and upper limit by wall and by cylinder; `None` without limits.
    walls: Vec<Option<[f64; 2]>>,
    pub(crate) cylinders: Vec<Option<[f64; 2]>>,
    /// Walls with limits, with their ends in the plan.
    pub(crate) limited: RTree<Limited>,
    /// Images of the ranger by floor and ceiling; empty in a planar scene.
    pub(crate) images: Vec<VerticalImage>,
}

/// Distance from the level edge of a wall within which sound counts both as hitting and as passing
/// it, metres: twice the tolerance of the final check.
const NEAR_EDGE_M: f64 = 2.0 * TIE_M;

/// A wall with limits, in the box around it.
pub(crate) type Limited = GeomWithData<Rectangle<[f64; 2]>, (u32, [DVec2; 2])>;

impl Heights {
    /// Collects the heights for walls with these ends in the plan, and a ranger at a height.
    pub(crate) fn new(
        scene: &Scene,
        segments: &[(DVec2, DVec2)],
        z_m: f64,
        settings: &PathSettings,
    ) -> Self {
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
            images: images(
                mirror(scene.floor_z_m, &scene.floor_material),
                mirror(scene.ceiling_z_m, &scene.ceiling_material),
                z_m,
                settings,
            ),
        }
    }

    /// Returns an image by its number in
    /// [`PathEcho::image`](crate::model::paths::echo::PathEcho::image).
    pub(crate) fn image(&self, number: u16) -> VerticalImage {
        number.checked_sub(1).map_or(VerticalImage::NONE, |image| self.images[image as usize])
    }

    /// Returns `true` if paths may have different heights along them.
    pub(crate) fn rises(&self) -> bool {
        self.floor_z_m.is_some() || self.ceiling_z_m.is_some()
    }

    /// Returns `true` if an object with these limits can affect any path.
    pub(crate) fn is_relevant(&self, limits: Option<[f64; 2]>) -> bool {
        self.rises() || holds(limits, self.z_m)
    }

    /// Returns `true` if no sound passes above or below a cylinder with these limits.
    pub(crate) fn is_opaque(&self, limits: Option<[f64; 2]>) -> bool {
        !(self.rises() && limits.is_some())
    }

    /// Climbs by wall at which sound hits and passes it; empty if no path rises.
    pub(crate) fn climbs(&self, settings: &PathSettings) -> Climbs {
        if !self.rises() {
            return Climbs::default();
        }
        // A path to a level edge ends up to this far from the height of its image.
        let offsets_m = |limits: &[f64; 2]| limits.map(|z_m| (z_m - self.z_m).abs());
        let lateral_m = self.walls.iter().flatten().flat_map(offsets_m).fold(0.0, f64::max);
        let highest_m = lateral_m + settings.max_path_m;
        let of_wall = |limits: &[f64; 2]| {
            let [lower, upper] = self.has_edges(*limits);
            let [from_m, to_m] = [limits[0] + NEAR_EDGE_M, limits[1] - NEAR_EDGE_M];
            let below = lower.then_some([f64::NEG_INFINITY, from_m]);
            let above = upper.then_some([to_m, f64::INFINITY]);
            let passed = [below, above].into_iter().flatten();
            WallClimbs {
                hit: self.unfolded([[limits[0] - NEAR_EDGE_M, limits[1] + NEAR_EDGE_M]], highest_m),
                passed: self.unfolded(passed, highest_m),
            }
        };
        let images = [VerticalImage::NONE].iter().chain(&self.images);
        let mut highest: Vec<[f64; 2]> =
            images.map(|image| [image.gain, image.rise_m.abs() + lateral_m]).collect();
        highest.sort_by(|a, b| b[0].total_cmp(&a[0]));
        let mut max_m = 0.0_f64;
        for [_, climb_m] in &mut highest {
            max_m = max_m.max(*climb_m);
            *climb_m = max_m;
        }
        let walls = self.walls.iter().map(|limits| limits.as_ref().map(of_wall)).collect();
        Climbs { ends_beams: true, walls, highest }
    }

    /// Returns the climbs up to `highest_m`, up or down, that end within one of these ranges of
    /// height.
    fn unfolded(&self, stretches: impl IntoIterator<Item = [f64; 2]>, highest_m: f64) -> Spans {
        let ends = [self.floor_z_m, self.ceiling_z_m];
        let [low_m, high_m] = [ends[0].unwrap_or(f64::MIN), ends[1].unwrap_or(f64::MAX)];
        // Mirrored at one of them, the heights repeat with the period of both.
        let mirror_m = ends[0].or(ends[1]).unwrap_or(self.z_m);
        let period_m = 2.0 * (high_m - low_m);
        let turns = if period_m.is_finite() { (highest_m / period_m).ceil() as i32 + 1 } else { 0 };
        let images = |stretch: [f64; 2]| {
            let [from, to] = [stretch[0].max(low_m), stretch[1].min(high_m)];
            let here = [from - self.z_m, to - self.z_m];
            let there = [2.0 * mirror_m - to - self.z_m, 2.0 * mirror_m - from - self.z_m];
            let copies = (-turns..=turns).flat_map(move |turn| {
                let by_m = if turn == 0 { 0.0 } else { f64::from(turn) * period_m };
                [here, there].map(|[from, to]| [from + by_m, to + by_m])
            });
            copies.filter(|[from, to]| from <= to).collect::<Vec<_>>()
        };
        let all = stretches.into_iter().flat_map(images);
        let near = all.filter(|[from, to]| *from <= highest_m && *to >= -highest_m);
        united(near.map(|span| span.map(|end| end.clamp(-highest_m, highest_m))).collect())
    }

    /// Walls above or below the wall in the floor plan at the same place, by [`between`] their
    /// ends. Of walls with overlapping heights there, the first one counts.
    pub(crate) fn stacked(&self, plan: &Arrangement) -> HashMap<[u32; 2], Vec<u32>> {
        if !self.rises() {
            return HashMap::new();
        }
        let others = |piece: &SegmentPiece| {
            let ends = edge_key(piece.ends);
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

    fn are_apart(&self, first: u32, second: u32) -> bool {
        let [first, second] = [first, second].map(|wall| self.walls[wall as usize]);
        first.zip(second).is_some_and(|([a, b], [c, d])| b <= c || d <= a)
    }

    /// Heights above the ranger of the level edges of a wall with limits, metres, each with `true`
    /// for the upper one. At the floor and at the ceiling there is no edge.
    pub(crate) fn level_edges(&self, wall: u32) -> impl Iterator<Item = (f64, bool)> {
        let limits = self.walls[wall as usize].unwrap_or_default();
        let has = self.has_edges(limits);
        let edge = move |end: usize| has[end].then_some((limits[end] - self.z_m, end == 1));
        [0, 1].into_iter().filter_map(edge)
    }

    /// Height above the ranger of a level edge of a wall, metres.
    pub(crate) fn edge_rise_m(&self, wall: u32, is_upper: bool) -> f64 {
        let limits = self.walls[wall as usize].unwrap_or_default();
        limits[usize::from(is_upper)] - self.z_m
    }

    /// Returns for these limits whether they end above the floor, and below the ceiling.
    fn has_edges(&self, [from_m, to_m]: [f64; 2]) -> [bool; 2] {
        let lower = self.floor_z_m.is_none_or(|floor| from_m > floor);
        let upper = self.ceiling_z_m.is_none_or(|ceiling| to_m < ceiling);
        [lower, upper]
    }

    /// Returns `true` if paths have to be checked against limited heights.
    pub(crate) fn need_checks(&self) -> bool {
        let low_round = self.cylinders.iter().any(Option::is_some);
        self.rises() && (low_round || self.limited.size() > 0)
    }

    /// Returns `true` if a wall with limits blocks a crossing of its line at a height. On its level
    /// edge it does not: there the whole path counts, and the diffracted field, which is minus half
    /// of it, is added.
    pub(crate) fn blocks_at(&self, wall: u32, z_m: f64) -> bool {
        let [from_m, to_m] = self.walls[wall as usize].unwrap_or_default();
        let [lower, upper] = self.has_edges([from_m, to_m]);
        (!lower || z_m > from_m + TIE_M) && (!upper || z_m < to_m - TIE_M)
    }

    pub(crate) fn limits(&self, reflector: Reflector) -> Option<[f64; 2]> {
        match reflector {
            Reflector::Wall(wall) => self.walls[wall as usize],
            Reflector::Cylinder(cylinder) => self.cylinders[cylinder as usize],
            Reflector::Floor | Reflector::Ceiling => None,
        }
    }

    /// Returns `true` if an object with these limits is hit between two heights of a path, with
    /// floor and ceiling as windows.
    ///
    /// Folded, the heights between the two are an interval. Its ends are the folded ends, or floor
    /// and ceiling where the path turns at one of their images in between. Images of each are
    /// `2 (ceiling - floor)` apart.
    pub(crate) fn blocks(&self, limits: Option<[f64; 2]>, straight_m: [f64; 2]) -> bool {
        let Some([from_m, to_m]) = limits else { return true };
        let [low_m, high_m] = [straight_m[0].min(straight_m[1]), straight_m[0].max(straight_m[1])];
        // Turns at floor and ceiling in between.
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

    /// Height, metres, of a path after a climb with floor and ceiling as windows; `None` without
    /// either.
    pub(crate) fn z_at(&self, climbed_m: f64) -> Option<f64> {
        self.rises().then(|| self.folded_m(self.z_m + climbed_m))
    }

    /// Reflections of a path that climbs this far, metres, with floor and ceiling as windows, in
    /// `count` reflections; a descending path reaches the floor first.
    ///
    /// With the first surface `h` away and a room of height `H`, reflection `n` (from 0) is at the
    /// share `(h + n H) / |climb|` of the path's length, because the unfolded path climbs evenly.
    pub(crate) fn bounces(&self, climb_m: f64, count: u16) -> impl Iterator<Item = Bounce> {
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

    /// Height of a path that is at `z_m` with floor and ceiling as windows.
    pub(crate) fn folded_m(&self, z_m: f64) -> f64 {
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

/// Floor or ceiling as a mirror, if there is one.
fn mirror(z_m: Option<f64>, material: &Material) -> Option<HorizontalMirror> {
    Some(HorizontalMirror { z_m: z_m?, gain: material.mirror_amplitude() })
}

/// A reflection at floor or ceiling.
pub(crate) struct Bounce {
    /// Position as a share of the path's length.
    pub(crate) share: f64,
    pub(crate) surface: Reflector,
    pub(crate) z_m: f64,
}

/// Returns `true` if a height is within the limits.
pub(crate) fn holds(limits: Option<[f64; 2]>, z_m: f64) -> bool {
    // The very end counts as a hit; the echo of a level edge takes that into account.
    limits.is_none_or(|[from, to]| (from - TIE_M..=to + TIE_M).contains(&z_m))
}

#[cfg(test)]
mod tests;

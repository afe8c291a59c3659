//! Variants of a random scene: moved, cut, in another order, with additional objects.

use rand::{RngExt, seq::SliceRandom};
use rand_pcg::Pcg64;
use sonard_model::geometry::DVec2;

use super::{Heights, Round, Wall, World};

impl World {
    /// Moves every point by a motion that keeps lengths.
    pub(crate) fn moved(mut self, to: impl Fn(DVec2) -> DVec2) -> Self {
        for wall in &mut self.walls {
            wall.ends = wall.ends.map(&to);
        }
        for round in &mut self.rounds {
            round.center = to(round.center);
        }
        Self { ends: self.ends.map(to), ..self }
    }

    /// Splits every wall into two or three pieces.
    pub(crate) fn split(&self, random: &mut Pcg64) -> Self {
        let mut walls = Vec::new();
        for wall in &self.walls {
            let [a, b] = wall.ends;
            let mut cuts = vec![0.0, random.random_range(0.1..0.5), 1.0];
            if random.random() {
                cuts.insert(2, random.random_range(0.6..0.9));
            }
            let pieces = cuts.windows(2).map(|cut| [a.lerp(b, cut[0]), a.lerp(b, cut[1])]);
            walls.extend(pieces.map(|ends| Wall { ends, ..*wall }));
        }
        Self { walls, ..self.clone() }
    }

    /// Splits every wall in two pieces, with the joint up to a nanometre off the wall's line.
    pub(crate) fn split_off_line(&self, random: &mut Pcg64) -> Self {
        let mut walls = Vec::new();
        for wall in &self.walls {
            let [a, b] = wall.ends;
            let off_m = 10_f64.powf(random.random_range(-13.0..-9.0));
            let off_m = if random.random() { off_m } else { -off_m };
            let joint =
                a.lerp(b, random.random_range(0.1..0.9)) + off_m * (b - a).normalize().perp();
            walls.extend([[a, joint], [joint, b]].map(|ends| Wall { ends, ..*wall }));
        }
        Self { walls, ..self.clone() }
    }

    /// Replaces the room by a rectangle around it.
    pub(crate) fn with_right_angles(mut self) -> Self {
        let along = (self.walls[0].ends[1] - self.walls[0].ends[0]).normalize();
        let inside = |wall: &Wall| wall.ends.map(|end| DVec2::new(along.x, -along.y).rotate(end));
        let corners = || self.walls[..4].iter().flat_map(inside);
        let low = corners().reduce(DVec2::min).expect("four walls");
        let high = corners().reduce(DVec2::max).expect("four walls");
        let corners = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
        let corners = corners.map(|corner| along.rotate(corner));
        for (at, wall) in self.walls[..4].iter_mut().enumerate() {
            wall.ends = [corners[at], corners[(at + 1) % 4]];
        }
        self
    }

    /// Reorders the walls and swaps their ends.
    pub(crate) fn reordered(&self, random: &mut Pcg64) -> Self {
        let mut world = self.clone();
        world.walls.shuffle(random);
        world.rounds.shuffle(random);
        for wall in &mut world.walls {
            if random.random() {
                wall.ends.reverse();
            }
        }
        world
    }

    /// Adds walls and cylinders behind the outer walls.
    pub(crate) fn with_hidden(&self, random: &mut Pcg64) -> Self {
        let mut world = self.clone();
        let middle = self.walls[..4].iter().map(|wall| 0.25 * wall.ends[0]).sum::<DVec2>();
        for wall in &self.walls[..4] {
            let [a, b] = wall.ends;
            let out = (a - b).perp().normalize();
            let out = if out.dot(a - middle) > 0.0 { out } else { -out };
            let at = |along: f64, off_m: f64| a.lerp(b, along) + off_m * out;
            let ends = [
                at(random.random(), random.random_range(0.02..0.5)),
                at(random.random(), random.random_range(0.5..0.8)),
            ];
            world.walls.push(Wall { ends, reflectance: 1.0, roughness: 0.5, z_m: None });
            let center = at(random.random_range(0.3..0.7), 1.1);
            world.rounds.push(Round { center, radius_m: 0.1, reflectance: 1.0, z_m: None });
        }
        world
    }

    /// Moves every height.
    pub(crate) fn with_heights(&self, to: impl Fn(f64) -> f64) -> Self {
        let mut world = self.clone();
        let moved = |z_m: [f64; 2]| {
            let mut z_m = z_m.map(&to);
            z_m.sort_by(f64::total_cmp);
            z_m
        };
        world.walls.iter_mut().for_each(|wall| wall.z_m = wall.z_m.map(moved));
        world.rounds.iter_mut().for_each(|round| round.z_m = round.z_m.map(moved));
        world.heights = self.heights.map(|heights| {
            let is_turned = to(0.0) > to(1.0);
            let [floor, ceiling] = heights.reflectance;
            Heights {
                limits_z_m: moved(heights.limits_z_m),
                reflectance: if is_turned { [ceiling, floor] } else { [floor, ceiling] },
                sensor_z_m: to(heights.sensor_z_m),
            }
        });
        world
    }

    /// Changes every surface's reflectance.
    pub(crate) fn with_reflectance(&self, of: impl Fn(f64) -> f64) -> Self {
        let mut world = self.clone();
        world.walls.iter_mut().for_each(|wall| wall.reflectance = of(wall.reflectance));
        world.rounds.iter_mut().for_each(|round| round.reflectance = of(round.reflectance));
        world
    }
}

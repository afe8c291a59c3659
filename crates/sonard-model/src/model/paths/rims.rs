//! Level edges: upper ones of low walls, lower ones of hanging ones.
//!
//! Such a rim is a straight line at one height over its wall's run in the plan. Sound comes to it from
//! an image of the ranger in the walls (a beam of the plan that lights the wall's line) and in floor and
//! ceiling (`vertical`), and goes back to one: every pair of a way out and a way back is an echo, as at
//! an upright edge, and its reverse another.
//!
//! # Keller's cone
//!
//! The shortest way over the line leaves it as steeply as it comes to it (Keller, JOSA 52, 1962). With
//! the images at distances `p'` and `p` from the line and abreast of its places `x'` and `x`, both
//! turned into one plane about the line, it runs straight:
//!
//! ```text
//! bends at (x' p + x p') / (p' + p)      is sqrt((p' + p)^2 + (x' - x)^2) long      sin b = (p' + p) / length
//! ```
//!
//! Beams light a part of the line only, and where that place is not in both there is no such way.
//!
//! # Strength
//!
//! The wall is thin: across the rim it is a half plane, which hangs from an upper edge and stands on a
//! lower one. With legs `s' = p' / sin b` and `s = p / sin b`, Kouyoumjian and Pathak's coefficient is
//! `1 / sin b` of the one head-on at the distance parameter `L = s' s sin^2 b / (s' + s)`, and the field
//! beside a head-on wall's is that by `sqrt((s' + s) / (s' s)) = sin b / sqrt(L)`: so it is the head-on one
//! at `L = p' p sin b / (p' + p)`. It takes over by halves where the wall's own echo ends, and where sound
//! that passes over the wall begins to be barred: when the ranger rises past a rim, nothing jumps. The laws
//! without an aspect are for head-on sound and know no slant; they get the same `L`, by which they too
//! grow as `1 / sqrt(sin b)`.
//!
//! Left out are ways by cylinders to a rim, the points where rims end, and what bends at two. Where sound
//! grazes a rim on its way out and on its way back, as it does straight over a low wall and back, both halves
//! are taken away, where less would be.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::{
    Echo, Paths, Trees, Via,
    beam::{Ray, TIE_M},
    echo::{SAME_M, SAME_RAD, drop_repeats},
    edges::distance_parameter_m,
    heights::Ends,
    interactions::{Leg, Part},
    scatter::Lit,
    trace::Tree,
    vertical::Image,
};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw, Wedge},
    geometry::{DVec2, Mirror},
    model::{Bend, Mechanism},
};

/// A way by a rim.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rim {
    pub(super) wall: u32,
    /// Whether it is the wall's upper one.
    pub(super) is_upper: bool,
    /// The rays to where it bends from transmitter and receiver, and the images over floor and ceiling
    /// that they come from, counted as in [`Echo::image`].
    pub(super) legs: [Leg; 2],
    pub(super) images: [u16; 2],
}

/// The echoes of all rims in sight from transmitter and receiver; their ways go to [`Trees::rims`].
pub(super) fn echoes(paths: &Paths, trees: &mut Trees, law: EdgeLaw) -> Vec<Echo> {
    let outs = by_wall(&mut trees.out);
    let backs = trees.back.as_mut().map(by_wall);
    let mut all: Vec<(Echo, Rim)> = Vec::new();
    for outs in outs.chunk_by(|one, other| one.wall == other.wall) {
        let wall = outs[0].wall;
        let backs = backs.as_ref().map(|backs| of_wall(backs, wall));
        for (rise_m, is_upper) in paths.heights.rims(wall) {
            let line = Line::new(paths, wall, rise_m, is_upper);
            let search = Search { paths, trees, law, line };
            let outs = line.arms(paths, outs);
            let mut found = match backs {
                None => search.pairs(&outs),
                Some(backs) => search.pairs_between(&outs, &line.arms(paths, backs)),
            };
            found.sort_by(|(one, _), (other, _)| one.length_m.total_cmp(&other.length_m));
            drop_repeats(&mut found, |(echo, _)| echo.length_m, is_same);
            all.append(&mut found);
        }
    }
    trees.rims = all.iter().map(|(_, rim)| *rim).collect();
    let numbered = all.iter().zip(0..);
    numbered.map(|((echo, _), rim)| Echo { via: Via::Rim { rim }, ..*echo }).collect()
}

/// What a tree lights of walls with limits, wall by wall.
fn by_wall(tree: &mut Tree) -> Vec<Lit> {
    let mut lit = std::mem::take(&mut tree.passed);
    lit.sort_by_key(|lit| lit.wall);
    lit
}

fn of_wall(lit: &[Lit], wall: u32) -> &[Lit] {
    let from = lit.partition_point(|lit| lit.wall < wall);
    let count = lit[from..].partition_point(|lit| lit.wall == wall);
    &lit[from..from + count]
}

/// Whether two ways by a rim are one that bends on the border of two beams and was found in both.
fn is_same((one, way): &(Echo, Rim), (other, its_way): &(Echo, Rim)) -> bool {
    let is_near = |a: DVec2, b: DVec2| a.distance_squared(b) < SAME_RAD * SAME_RAD;
    let first_leg_m = |way: &Rim| way.legs[0].run.length();
    is_near(one.departure, other.departure)
        && is_near(one.arrival, other.arrival)
        && way.images == its_way.images
        && (first_leg_m(way) - first_leg_m(its_way)).abs() < SAME_M
}

/// A rim as sound meets it.
#[derive(Debug, Clone, Copy)]
struct Line {
    wall: u32,
    is_upper: bool,
    /// Above the ranger, metres.
    rise_m: f64,
    /// The wall's in the plan.
    mirror: Mirror,
    wedge: Wedge,
}

/// A way to a rim, to any place of it: a beam, and an image over floor and ceiling.
#[derive(Debug, Clone, Copy)]
struct Arm<'a> {
    lit: &'a Lit,
    /// Counted as in [`Echo::image`].
    image: u16,
    gain: f64,
    /// How much higher it ends if floor and ceiling are windows, metres.
    climb_m: f64,
    /// Distance of the image from the line in space, metres, and the place that it is abreast of.
    off_m: f64,
    foot_m: f64,
    /// Direction from the line towards the image, around it from the wall's face, radians.
    around_rad: f64,
    /// Length of the shortest way to what the beam lights, metres.
    least_m: f64,
}

impl Line {
    fn new(paths: &Paths, wall: u32, rise_m: f64, is_upper: bool) -> Self {
        let face = &paths.faces[wall as usize];
        let wedge = Wedge { opening_rad: TAU, reflectance: [face.gain; 2] };
        Self { wall, is_upper, rise_m, mirror: face.mirror, wedge }
    }

    /// The ways to it, shortest first. Left out are those too long or weak for any way back.
    fn arms<'a>(&self, paths: &Paths, lit: &'a [Lit]) -> Vec<Arm<'a>> {
        let settings = &paths.settings;
        let images = || std::iter::once(&Image::NONE).chain(paths.images.iter()).zip(0..);
        let mut arms: Vec<Arm> = lit
            .iter()
            .flat_map(|lit| images().filter_map(|(image, index)| self.arm(lit, image, index)))
            .filter(|arm| 2.0 * arm.gain >= settings.floor && arm.least_m <= settings.max_path_m)
            .collect();
        arms.sort_by(|one, other| one.least_m.total_cmp(&other.least_m));
        arms
    }

    /// None from within the wall's own plane.
    fn arm<'a>(&self, lit: &'a Lit, image: &Image, index: u16) -> Option<Arm<'a>> {
        let before_m = self.mirror.height_m(lit.beam.image);
        if before_m.abs() <= TIE_M {
            return None;
        }
        let below_m = self.rise_m - image.rise_m;
        let off_m = before_m.hypot(below_m);
        let foot_m = self.mirror.normal.perp().dot(lit.beam.image);
        let [low_m, high_m] = lit.span_m;
        let beside_m = (low_m - foot_m).max(foot_m - high_m).max(0.0);
        let along_face_m = if self.is_upper { below_m } else { -below_m };
        Some(Arm {
            lit,
            image: index,
            gain: lit.beam.gain * image.gain,
            climb_m: image.climb_m(self.rise_m),
            off_m,
            foot_m,
            around_rad: before_m.atan2(along_face_m).rem_euclid(TAU),
            least_m: off_m.hypot(beside_m),
        })
    }

    fn place(&self, place_m: f64) -> DVec2 {
        self.mirror.offset_m * self.mirror.normal + place_m * self.mirror.normal.perp()
    }
}

impl Arm<'_> {
    fn lights(&self, place_m: f64) -> bool {
        let [low_m, high_m] = self.lit.span_m;
        (low_m - TIE_M..=high_m + TIE_M).contains(&place_m)
    }
}

/// What is asked of a rim.
struct Search<'a> {
    paths: &'a Paths,
    trees: &'a Trees,
    law: EdgeLaw,
    line: Line,
}

impl Search<'_> {
    /// Out on one arm and back on another or the same: each pair in both directions.
    fn pairs(&self, arms: &[Arm]) -> Vec<(Echo, Rim)> {
        let mut found = Vec::new();
        for (i, out) in arms.iter().enumerate() {
            for (j, back) in arms.iter().enumerate().skip(i) {
                if self.is_too_long(out, back) {
                    break;
                }
                let Some((echo, rim)) = self.way(out, back) else { continue };
                found.push((echo, rim));
                if i != j {
                    found.push(reversed(&echo, &rim));
                }
            }
        }
        found
    }

    /// Out on an arm from the transmitter and back on one from the receiver.
    fn pairs_between(&self, outs: &[Arm], backs: &[Arm]) -> Vec<(Echo, Rim)> {
        let mut found = Vec::new();
        for out in outs {
            let near = backs.iter().take_while(|back| !self.is_too_long(out, back));
            found.extend(near.filter_map(|back| self.way(out, back)));
        }
        found
    }

    fn is_too_long(&self, out: &Arm, back: &Arm) -> bool {
        out.least_m + back.least_m > self.paths.settings.max_path_m
    }

    /// The way on Keller's cone, if both arms light the place where it bends, it is strong enough and
    /// nothing is in its way.
    fn way(&self, out: &Arm, back: &Arm) -> Option<(Echo, Rim)> {
        let across_m = out.off_m + back.off_m;
        let place_m = (out.foot_m * back.off_m + back.foot_m * out.off_m) / across_m;
        if !(out.lights(place_m) && back.lights(place_m)) {
            return None;
        }
        let length_m = across_m.hypot(out.foot_m - back.foot_m);
        let field = self.field(out, back, length_m)?;
        let place = self.line.place(place_m);
        let [to, from] = [out, back].map(|arm| arm.lit.beam.ray_to(place));
        let legs = [Leg::from(&to), Leg::from(&from)];
        let trees = self.trees;
        if !(self.is_clear(&trees.out, trees.ends[0], out, legs[0], place)
            && self.is_clear(trees.back(), trees.ends[1], back, legs[1], place))
        {
            return None;
        }
        let rise_rad = |arm: &Arm, ray: &Ray| arm.climb_m.atan2(ray.run.length());
        let echo = Echo {
            length_m,
            amplitude: field.norm(),
            phase_rad: field.arg(),
            departure: to.departure,
            arrival: from.departure,
            rise_rad: [rise_rad(out, &to), rise_rad(back, &from)],
            image: 0,
            via: Via::Rim { rim: 0 },
        };
        let Line { wall, is_upper, .. } = self.line;
        Some((echo, Rim { wall, is_upper, legs, images: [out.image, back.image] }))
    }

    /// Relative field of such a way, `None` if it is below the floor or longer than any that is asked for.
    fn field(&self, out: &Arm, back: &Arm, length_m: f64) -> Option<Complex64> {
        let settings = &self.paths.settings;
        let order = out.lit.beam.order + back.lit.beam.order;
        if length_m > settings.max_path_m || !settings.allows(order) {
            return None;
        }
        let strength = out.gain * back.gain * settings.air_gain(length_m);
        // No law gives more than a wall's echo and the image behind it that its rim replaces.
        if 2.0 * strength < settings.floor {
            return None;
        }
        let slant = (out.off_m + back.off_m) / length_m;
        let aspect = Aspect {
            in_rad: out.around_rad,
            out_rad: back.around_rad,
            distance_m: distance_parameter_m(out.off_m, back.off_m) * slant,
        };
        let (wedge, k) = (&self.line.wedge, settings.wave_number_per_m);
        if strength * self.law.bound(wedge, &aspect, k) < settings.floor {
            return None;
        }
        let field = strength * self.law.echo(wedge, &aspect, k);
        (field.norm() >= settings.floor).then_some(field)
    }

    /// Whether nothing stands in the way of a leg from one of the starts.
    fn is_clear(&self, tree: &Tree, start: DVec2, arm: &Arm, leg: Leg, place: DVec2) -> bool {
        let mut contacts = self.paths.part_contacts(tree, Part::Flat(leg), place);
        let Line { wall, is_upper, .. } = self.line;
        contacts.push((place, Mechanism::Diffraction(Bend::Level { wall, is_upper })));
        let ends = Ends { start, end: None, rise_m: arm.climb_m };
        self.paths.is_way_clear(&contacts, &ends)
    }
}

/// The same way run through backwards.
fn reversed(echo: &Echo, rim: &Rim) -> (Echo, Rim) {
    let [leaves_rad, comes_rad] = echo.rise_rad;
    let echo = Echo {
        departure: echo.arrival,
        arrival: echo.departure,
        rise_rad: [comes_rad, leaves_rad],
        ..*echo
    };
    let ([out, back], [first, last]) = (rim.legs, rim.images);
    (echo, Rim { legs: [back, out], images: [last, first], ..*rim })
}

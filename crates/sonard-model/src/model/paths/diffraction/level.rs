//! Diffraction at level edges: the top edges of low walls, the bottom edges of hanging ones.
//!
//! Such an edge is a straight line at one height over its wall's run in the plan. Sound arrives
//! from an image of the ranger in the walls (a beam of the plan that illuminates the wall's line)
//! and in floor and ceiling ([`height`](crate::model::paths::height)), and returns to one. Every
//! pair of a path out and a path back is an echo, as at an upright edge, and its reverse another.
//!
//! # Keller's cone
//!
//! The shortest path over the line leaves as steeply as it arrives (Keller, JOSA 52, 1962). Let the
//! images be at distances `p'` and `p` from the line, with their feet at positions `x'` and `x`
//! along it. With both turned into one plane about the line, the path is straight:
//!
//! ```text
//! bends at (x' p + x p') / (p' + p)
//! length   sqrt((p' + p)^2 + (x' - x)^2)
//! sin b    (p' + p) / length
//! ```
//!
//! Beams illuminate only a part of the line; if that point is not in both parts there is no such
//! path.
//!
//! # Strength
//!
//! The wall is thin: across the edge it is a half plane below an upper edge or above a lower one.
//! With legs `s' = p' / sin b` and `s = p / sin b`, Kouyoumjian and Pathak's coefficient is
//! `1 / sin b` of the head-on one at the distance parameter `L = s' s sin^2 b / (s' + s)`. The
//! field relative to a head-on wall's is that times `sqrt((s' + s) / (s' s)) = sin b / sqrt(L)`, so
//! it equals the head-on one at `L = p' p sin b / (p' + p)`. It takes over by halves where the
//! wall's own echo ends, and where sound that passes over the wall begins to be blocked: when the
//! ranger rises past an edge, nothing jumps. The laws without an aspect are for head-on sound and
//! have no slant; they receive the same `L`, by which they also grow as `1 / sqrt(sin b)`.
//!
//! Paths by cylinders to a level edge, the end points of level edges, and double diffraction are
//! omitted. Where sound grazes an edge both on its way out and on its way back, as it does straight
//! over a low wall and back, both halves are subtracted, where less would be correct.

mod edge;

use num_complex::Complex64;

use self::edge::{EdgeBeam, LevelEdge};
use super::edge_ray::distance_parameter_m;
use crate::{
    acoustics::edge::{Aspect, EdgeLaw},
    geometry::DVec2,
    model::{
        Diffractor, Mechanism, SearchPart,
        paths::{
            beams::{Beams, LitWall, RayLeg, UnfoldedRay},
            echo::{PathEcho, Via, drop_repeats},
            floor::{ALL_SLOPES, TracingPlan},
            height::{Heights, PathEnds},
            rays::wall_contacts,
            tolerance::{SAME_M, SAME_RAD},
        },
    },
};

/// A path by a level edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LevelDiffraction {
    pub(crate) wall: u32,
    /// `true` for the wall's top edge, `false` for its bottom edge.
    pub(crate) is_upper: bool,
    /// Rays to the point of diffraction from transmitter and receiver, and the images by floor and
    /// ceiling where they start, counted as in [`PathEcho::image`].
    pub(crate) legs: [RayLeg; 2],
    pub(crate) images: [u16; 2],
}

/// Beams from one start, and the parts of walls with level edges that they illuminate.
pub(crate) struct LevelEdgeBeams<'a> {
    start: DVec2,
    beams: &'a Beams,
    /// Illuminated parts, sorted by wall.
    lit: Vec<LitWall>,
}

impl<'a> LevelEdgeBeams<'a> {
    pub(crate) fn new(start: DVec2, beams: &'a Beams, mut lit: Vec<LitWall>) -> Self {
        lit.sort_by_key(|lit| lit.wall);
        Self { start, beams, lit }
    }
}

/// Scene data of the search.
#[derive(Clone, Copy)]
pub(crate) struct LevelScene<'a> {
    pub(crate) plan: &'a TracingPlan,
    pub(crate) heights: &'a Heights,
    pub(crate) law: EdgeLaw,
}

/// Finds the echoes of all level edges visible from transmitter and receiver, and their paths, by
/// number in [`Via::LevelEdge`].
pub(crate) fn echoes(
    scene: LevelScene,
    out: &LevelEdgeBeams,
    back: Option<&LevelEdgeBeams>,
) -> (Vec<PathEcho>, Vec<LevelDiffraction>) {
    let mut all: Vec<(PathEcho, LevelDiffraction)> = Vec::new();
    for outs in out.lit.chunk_by(|a, b| a.wall == b.wall) {
        let wall = outs[0].wall;
        let backs = back.map(|back| of_wall(&back.lit, wall));
        for (rise_m, is_upper) in scene.heights.level_edges(wall) {
            let edge = LevelEdge::new(scene.plan, wall, rise_m, is_upper);
            let search = LevelSearch { scene, ends: [out, back.unwrap_or(out)], edge };
            let outs = edge.beams(scene, out.beams, outs);
            let mut found = match backs {
                None => search.pairs(&outs),
                Some(backs) => {
                    let beams = back.map_or(out.beams, |back| back.beams);
                    search.pairs_between(&outs, &edge.beams(scene, beams, backs))
                }
            };
            found.sort_by(|(a, _), (b, _)| a.length_m.total_cmp(&b.length_m));
            drop_repeats(&mut found, |(echo, _)| echo.length_m, is_same);
            all.append(&mut found);
        }
    }
    let paths = all.iter().map(|(_, path)| *path).collect();
    let numbered = all.iter().zip(0..);
    let number = |((echo, _), level): (&(PathEcho, LevelDiffraction), u32)| PathEcho {
        via: Via::LevelEdge { level },
        ..*echo
    };
    (numbered.map(number).collect(), paths)
}

/// Returns the spans of one wall; `lit` must be sorted by wall.
fn of_wall(lit: &[LitWall], wall: u32) -> &[LitWall] {
    let from = lit.partition_point(|lit| lit.wall < wall);
    let count = lit[from..].partition_point(|lit| lit.wall == wall);
    &lit[from..from + count]
}

/// Returns `true` for the two copies of a path that hits a level edge on the border of two beams.
fn is_same(
    (first, path): &(PathEcho, LevelDiffraction),
    (second, its_path): &(PathEcho, LevelDiffraction),
) -> bool {
    let is_near = |a: DVec2, b: DVec2| a.distance_squared(b) < SAME_RAD * SAME_RAD;
    let first_leg_m = |path: &LevelDiffraction| path.legs[0].run.length();
    is_near(first.departure, second.departure)
        && is_near(first.arrival, second.arrival)
        && path.images == its_path.images
        && (first_leg_m(path) - first_leg_m(its_path)).abs() < SAME_M
}

/// Pairs beams at one level edge.
struct LevelSearch<'a> {
    scene: LevelScene<'a>,
    /// Beams from transmitter and receiver.
    ends: [&'a LevelEdgeBeams<'a>; 2],
    edge: LevelEdge,
}

impl LevelSearch<'_> {
    /// Finds paths out on one beam and back on another or the same: each pair in both directions.
    fn pairs(&self, beams: &[EdgeBeam]) -> Vec<(PathEcho, LevelDiffraction)> {
        let mut found = Vec::new();
        for (i, out) in beams.iter().enumerate() {
            for (j, back) in beams.iter().enumerate().skip(i) {
                if self.is_too_long(out, back) {
                    break;
                }
                let Some((echo, path)) = self.path(out, back) else { continue };
                found.push((echo, path));
                if i != j {
                    found.push(reversed(&echo, &path));
                }
            }
        }
        found
    }

    /// Finds paths out on a beam from the transmitter and back on one from the receiver.
    fn pairs_between(
        &self,
        outs: &[EdgeBeam],
        backs: &[EdgeBeam],
    ) -> Vec<(PathEcho, LevelDiffraction)> {
        let mut found = Vec::new();
        for out in outs {
            let near = backs.iter().take_while(|back| !self.is_too_long(out, back));
            found.extend(near.filter_map(|back| self.path(out, back)));
        }
        found
    }

    /// Returns `true` if a pair and all later ones are too long, or the effort is exceeded.
    fn is_too_long(&self, out: &EdgeBeam, back: &EdgeBeam) -> bool {
        let TracingPlan { settings, effort, .. } = self.scene.plan;
        out.min_m + back.min_m > settings.max_path_m || !effort.step(SearchPart::LevelEdges, 1)
    }

    /// Returns the path on Keller's cone if both beams illuminate the point of diffraction, the
    /// path is strong enough and nothing blocks it.
    fn path(&self, out: &EdgeBeam, back: &EdgeBeam) -> Option<(PathEcho, LevelDiffraction)> {
        let across_m = out.off_m + back.off_m;
        let along_m = (out.foot_m * back.off_m + back.foot_m * out.off_m) / across_m;
        if !(out.lights(along_m) && back.lights(along_m)) {
            return None;
        }
        let [from, to] = self.ends.map(|from| from.beams);
        if !(out.climbs_to(from, along_m) && back.climbs_to(to, along_m)) {
            return None;
        }
        let lateral_m = out.foot_m - back.foot_m;
        let length_m = (across_m * across_m + lateral_m * lateral_m).sqrt();
        let field = self.field(out, back, length_m)?;
        let point = self.edge.point(along_m);
        let [to, from] = [out, back].map(|beam| beam.lit.beam.ray_to(point));
        let legs = [RayLeg::from(&to), RayLeg::from(&from)];
        let is_clear = |end: usize, beam| self.is_clear(self.ends[end], beam, legs[end], point);
        if !(is_clear(0, out) && is_clear(1, back)) {
            return None;
        }
        let rise_rad = |beam: &EdgeBeam, ray: &UnfoldedRay| beam.climb_m.atan2(ray.run.length());
        let echo = PathEcho {
            length_m,
            amplitude: field.norm(),
            phase_rad: field.arg(),
            departure: to.departure,
            arrival: from.departure,
            rise_rad: [rise_rad(out, &to), rise_rad(back, &from)],
            image: 0,
            slopes: [ALL_SLOPES; 2],
            is_repeated: false,
            via: Via::LevelEdge { level: 0 },
        };
        let LevelEdge { wall, is_upper, .. } = self.edge;
        self.scene.plan.effort.keep::<(PathEcho, LevelDiffraction)>(4);
        Some((echo, LevelDiffraction { wall, is_upper, legs, images: [out.image, back.image] }))
    }

    /// Relative field of the path, `None` if it is below the floor or above the maximum length.
    fn field(&self, out: &EdgeBeam, back: &EdgeBeam, length_m: f64) -> Option<Complex64> {
        let settings = &self.scene.plan.settings;
        if length_m > settings.max_path_m || !settings.allows(out.order + back.order) {
            return None;
        }
        let strength = out.gain * back.gain * settings.air_gain(length_m);
        // No law exceeds a wall's echo and the image behind it that its edge replaces.
        if 2.0 * strength < settings.floor {
            return None;
        }
        let slant = (out.off_m + back.off_m) / length_m;
        let aspect = Aspect {
            in_rad: out.around_rad,
            out_rad: back.around_rad,
            distance_m: distance_parameter_m(out.off_m, back.off_m) * slant,
        };
        let (wedge, k) = (&self.edge.wedge, settings.wave_number_per_m);
        if strength * self.scene.law.bound(wedge, &aspect, k) < settings.floor {
            return None;
        }
        let field = strength * self.scene.law.echo(wedge, &aspect, k);
        (field.norm() >= settings.floor).then_some(field)
    }

    /// Returns `true` if nothing blocks a ray from one of the ends to the point of diffraction.
    fn is_clear(&self, from: &LevelEdgeBeams, beam: &EdgeBeam, leg: RayLeg, point: DVec2) -> bool {
        let LevelScene { plan, heights, .. } = self.scene;
        let mut contacts = wall_contacts(from.beams, plan, leg, point);
        let LevelEdge { wall, is_upper, .. } = self.edge;
        contacts.push((point, Mechanism::Diffraction(Diffractor::Level { wall, is_upper })));
        let ends = PathEnds { start: from.start, end: None, rise_m: beam.climb_m };
        heights.is_path_clear(&plan.cylinders, &contacts, &ends)
    }
}

/// Returns the path in the opposite direction.
fn reversed(echo: &PathEcho, path: &LevelDiffraction) -> (PathEcho, LevelDiffraction) {
    let [leaves_rad, comes_rad] = echo.rise_rad;
    let echo = PathEcho {
        departure: echo.arrival,
        arrival: echo.departure,
        rise_rad: [comes_rad, leaves_rad],
        ..*echo
    };
    let ([out, back], [first, last]) = (path.legs, path.images);
    (echo, LevelDiffraction { legs: [back, out], images: [last, first], ..*path })
}

//! Diffraction at level edges: the top edges of low walls, the bottom edges of hanging ones.
//!
//! Such an edge is a straight line at one height over its wall's run in the plan. Sound comes to it from
//! an image of the ranger in the walls (a beam of the plan that lights the wall's line) and in floor and
//! ceiling ([`height`](crate::model::paths::height)), and goes back to one: every pair of a path out and a
//! path back is an echo, as at an upright edge, and its reverse another.
//!
//! # Keller's cone
//!
//! The shortest path over the line leaves it as steeply as it comes to it (Keller, JOSA 52, 1962). With
//! the images at distances `p'` and `p` from the line and abreast of its positions `x'` and `x`, both
//! turned into one plane about the line, it runs straight:
//!
//! ```text
//! bends at (x' p + x p') / (p' + p)      is sqrt((p' + p)^2 + (x' - x)^2) long      sin b = (p' + p) / length
//! ```
//!
//! Beams light a part of the line only, and where that point is not in both there is no such path.
//!
//! # Strength
//!
//! The wall is thin: across the edge it is a half plane, which hangs from an upper edge and stands on a
//! lower one. With legs `s' = p' / sin b` and `s = p / sin b`, Kouyoumjian and Pathak's coefficient is
//! `1 / sin b` of the one head-on at the distance parameter `L = s' s sin^2 b / (s' + s)`, and the field
//! beside a head-on wall's is that by `sqrt((s' + s) / (s' s)) = sin b / sqrt(L)`: so it is the head-on one
//! at `L = p' p sin b / (p' + p)`. It takes over by halves where the wall's own echo ends, and where sound
//! that passes over the wall begins to be barred: when the ranger rises past an edge, nothing jumps. The laws
//! without an aspect are for head-on sound and know no slant; they get the same `L`, by which they too
//! grow as `1 / sqrt(sin b)`.
//!
//! Left out are paths by cylinders to a level edge, the points where level edges end, and double diffraction.
//! Where sound grazes an edge both on its way out and on its way back, as it does straight over a low wall and
//! back, both halves are taken away, where less would be.

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
            beams::{Beams, Leg, LitSpan, Ray},
            echo::{Echo, Via, drop_repeats},
            height::{Ends, Heights},
            plan::{ALL_SLOPES, Plan},
            rays::wall_contacts,
            tolerance::{SAME_M, SAME_RAD},
        },
    },
};

/// A path by a level edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LevelDiffraction {
    pub(crate) wall: u32,
    /// Whether it is the wall's top edge (else the bottom).
    pub(crate) is_upper: bool,
    /// The rays to the point of diffraction from transmitter and receiver, and the images by floor and ceiling
    /// that they come from, counted as in [`Echo::image`].
    pub(crate) legs: [Leg; 2],
    pub(crate) images: [u16; 2],
}

/// Beams from one start, and what they light of walls with level edges.
pub(crate) struct From<'a> {
    start: DVec2,
    beams: &'a Beams,
    /// Sorted by wall.
    lit: Vec<LitSpan>,
}

impl<'a> From<'a> {
    pub(crate) fn new(start: DVec2, beams: &'a Beams, mut lit: Vec<LitSpan>) -> Self {
        lit.sort_by_key(|lit| lit.wall);
        Self { start, beams, lit }
    }
}

/// The scene, as a search needs it.
#[derive(Clone, Copy)]
pub(crate) struct Surroundings<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) heights: &'a Heights,
    pub(crate) law: EdgeLaw,
}

/// The echoes of all level edges in sight from transmitter and receiver, and their paths, by number in
/// [`Via::LevelEdge`].
pub(crate) fn echoes(
    scene: Surroundings,
    out: &From,
    back: Option<&From>,
) -> (Vec<Echo>, Vec<LevelDiffraction>) {
    let mut all: Vec<(Echo, LevelDiffraction)> = Vec::new();
    for outs in out.lit.chunk_by(|one, other| one.wall == other.wall) {
        let wall = outs[0].wall;
        let backs = back.map(|back| of_wall(&back.lit, wall));
        for (rise_m, is_upper) in scene.heights.level_edges(wall) {
            let edge = LevelEdge::new(scene.plan, wall, rise_m, is_upper);
            let search = Search { scene, ends: [out, back.unwrap_or(out)], edge };
            let outs = edge.beams(scene, out.beams, outs);
            let mut found = match backs {
                None => search.pairs(&outs),
                Some(backs) => {
                    let beams = back.map_or(out.beams, |back| back.beams);
                    search.pairs_between(&outs, &edge.beams(scene, beams, backs))
                }
            };
            found.sort_by(|(one, _), (other, _)| one.length_m.total_cmp(&other.length_m));
            drop_repeats(&mut found, |(echo, _)| echo.length_m, is_same);
            all.append(&mut found);
        }
    }
    let paths = all.iter().map(|(_, path)| *path).collect();
    let numbered = all.iter().zip(0..);
    let number = |((echo, _), level): (&(Echo, LevelDiffraction), u32)| Echo {
        via: Via::LevelEdge { level },
        ..*echo
    };
    (numbered.map(number).collect(), paths)
}

/// The part of one wall, of spans that are sorted by wall.
fn of_wall(lit: &[LitSpan], wall: u32) -> &[LitSpan] {
    let from = lit.partition_point(|lit| lit.wall < wall);
    let count = lit[from..].partition_point(|lit| lit.wall == wall);
    &lit[from..from + count]
}

/// Whether two paths by a level edge are one that meets it on the border of two beams and was found in both.
fn is_same(
    (one, path): &(Echo, LevelDiffraction),
    (other, its_path): &(Echo, LevelDiffraction),
) -> bool {
    let is_near = |a: DVec2, b: DVec2| a.distance_squared(b) < SAME_RAD * SAME_RAD;
    let first_leg_m = |path: &LevelDiffraction| path.legs[0].run.length();
    is_near(one.departure, other.departure)
        && is_near(one.arrival, other.arrival)
        && path.images == its_path.images
        && (first_leg_m(path) - first_leg_m(its_path)).abs() < SAME_M
}

/// Pairs of beams at one level edge.
struct Search<'a> {
    scene: Surroundings<'a>,
    /// Transmitter and receiver.
    ends: [&'a From<'a>; 2],
    edge: LevelEdge,
}

impl Search<'_> {
    /// Out on one beam and back on another or the same: each pair in both directions.
    fn pairs(&self, beams: &[EdgeBeam]) -> Vec<(Echo, LevelDiffraction)> {
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

    /// Out on a beam from the transmitter and back on one from the receiver.
    fn pairs_between(
        &self,
        outs: &[EdgeBeam],
        backs: &[EdgeBeam],
    ) -> Vec<(Echo, LevelDiffraction)> {
        let mut found = Vec::new();
        for out in outs {
            let near = backs.iter().take_while(|back| !self.is_too_long(out, back));
            found.extend(near.filter_map(|back| self.path(out, back)));
        }
        found
    }

    /// Whether a pair and all that follow it are too long, or would cost too much.
    fn is_too_long(&self, out: &EdgeBeam, back: &EdgeBeam) -> bool {
        let Plan { settings, effort, .. } = self.scene.plan;
        out.least_m + back.least_m > settings.max_path_m || !effort.step(SearchPart::LevelEdges, 1)
    }

    /// The path on Keller's cone, if both beams light the point of diffraction, it is strong enough and
    /// nothing is in its way.
    fn path(&self, out: &EdgeBeam, back: &EdgeBeam) -> Option<(Echo, LevelDiffraction)> {
        let across_m = out.off_m + back.off_m;
        let along_m = (out.foot_m * back.off_m + back.foot_m * out.off_m) / across_m;
        if !(out.lights(along_m) && back.lights(along_m)) {
            return None;
        }
        let [from, to] = self.ends.map(|from| from.beams);
        if !(out.climbs_to(from, along_m) && back.climbs_to(to, along_m)) {
            return None;
        }
        let beside_m = out.foot_m - back.foot_m;
        let length_m = (across_m * across_m + beside_m * beside_m).sqrt();
        let field = self.field(out, back, length_m)?;
        let point = self.edge.point(along_m);
        let [to, from] = [out, back].map(|beam| beam.lit.beam.ray_to(point));
        let legs = [Leg::from(&to), Leg::from(&from)];
        let is_clear = |end: usize, beam| self.is_clear(self.ends[end], beam, legs[end], point);
        if !(is_clear(0, out) && is_clear(1, back)) {
            return None;
        }
        let rise_rad = |beam: &EdgeBeam, ray: &Ray| beam.climb_m.atan2(ray.run.length());
        let echo = Echo {
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
        self.scene.plan.effort.keep::<(Echo, LevelDiffraction)>(4);
        Some((echo, LevelDiffraction { wall, is_upper, legs, images: [out.image, back.image] }))
    }

    /// Relative field of such a path, `None` if it is below the floor or longer than any that is asked for.
    fn field(&self, out: &EdgeBeam, back: &EdgeBeam, length_m: f64) -> Option<Complex64> {
        let settings = &self.scene.plan.settings;
        if length_m > settings.max_path_m || !settings.allows(out.order + back.order) {
            return None;
        }
        let strength = out.gain * back.gain * settings.air_gain(length_m);
        // No law gives more than a wall's echo and the image behind it that its edge replaces.
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

    /// Whether nothing stands in the way of a ray from one of the ends to the point of diffraction.
    fn is_clear(&self, from: &From, beam: &EdgeBeam, leg: Leg, point: DVec2) -> bool {
        let Surroundings { plan, heights, .. } = self.scene;
        let mut contacts = wall_contacts(from.beams, plan, leg, point);
        let LevelEdge { wall, is_upper, .. } = self.edge;
        contacts.push((point, Mechanism::Diffraction(Diffractor::Level { wall, is_upper })));
        let ends = Ends { start: from.start, end: None, rise_m: beam.climb_m };
        heights.is_path_clear(&plan.cylinders, &contacts, &ends)
    }
}

/// The same path run through backwards.
fn reversed(echo: &Echo, path: &LevelDiffraction) -> (Echo, LevelDiffraction) {
    let [leaves_rad, comes_rad] = echo.rise_rad;
    let echo = Echo {
        departure: echo.arrival,
        arrival: echo.departure,
        rise_rad: [comes_rad, leaves_rad],
        ..*echo
    };
    let ([out, back], [first, last]) = (path.legs, path.images);
    (echo, LevelDiffraction { legs: [back, out], images: [last, first], ..*path })
}

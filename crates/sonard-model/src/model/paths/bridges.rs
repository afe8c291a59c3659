//! Sound that bends at two edges.
//!
//! The ways from edge to edge depend on the scene alone: a tree of beams from each edge that is met,
//! grown when it is first asked for and kept for all places. Each way out to one edge, each way on
//! from there to another (or by walls back to the same) and each way back from that is an echo; what
//! it is the reverse of is another.
//!
//! # Strength
//!
//! Over legs `s'`, `t`, `s` the wave that left the first edge is cylindrical about it in the plan, and
//! what the second edge makes of that is a coefficient of its own (Kouyoumjian and Pathak 1974, whose
//! section on ray-optical fields takes any such wave):
//!
//! ```text
//! D1 D2 / sqrt(s' t s)      with D1 at L1 = s' t / (s' + t), D2 at L2 = t s / (t + s)
//! ```
//!
//! beside a straight way's `1 / sqrt(s' + t + s)`; upright, where the front's other radius goes on
//! growing, spreading adds the same to both. It reads the same backwards. The product holds while
//! neither edge lies in the other's transition region: where transmitter (or receiver) and both
//! edges are nearly in line, what comes to the second edge is no ray-optical field, and the product
//! errs by some decibels there.
//!
//! # Along a wall
//!
//! Two ends of one wall see each other along its faces. On a rigid face what comes along it is the
//! incident wave and its mirror image in one, of which the second coefficient counts each: half of it
//! is incident (the same, section on grazing incidence). Of a face with reflectance `R` the share is
//! `1 / (1 + R)`. A free-standing plate has two such ways, one on each side, of one length, and they
//! are one echo.

use std::sync::OnceLock;

use num_complex::Complex64;
use smallvec::SmallVec;

use super::{
    Echo, Paths, Settings, Trees, Via,
    beam::Ray,
    echo::SAME_M,
    edges::{ALONG_RAD, Arm, Corner, Facing, Flank, distance_parameter_m, is_same_departure},
    mesh::Mesh,
    trace::Tree,
};
use crate::acoustics::edge::{Aspect, EdgeLaw};

/// Past the width of a tie at a boundary, radians.
const INTO_SHADOW_RAD: f64 = 2e-9;

/// Trees of beams from the edges of a scene, by point.
#[derive(Debug, Default)]
pub(super) struct Bridges {
    spans: Vec<OnceLock<Spans>>,
    /// The triangles around each point and which corner of each it is, counter-clockwise.
    around: Vec<SmallVec<[(u32, u8); 6]>>,
    max_path_m: f64,
}

/// The rays from an edge to edges.
#[derive(Debug)]
struct Spans {
    /// Its `to_edges` lie side by side by edge, shortest first.
    tree: Tree,
    /// Of each ray, whether it left in the air on its left and on its right: along a wall it may have
    /// gone on one side only.
    flanks: Vec<[bool; 2]>,
}

/// A way by two edges.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bridged {
    /// The edges' points, in order.
    pub(super) points: [u32; 2],
    /// The ray from one to the other, in the first one's tree.
    pub(super) leg: u32,
    /// Rays to the first edge and, from the receiver, to the second; see [`Tree::part`].
    pub(super) out: u32,
    pub(super) back: u32,
}

impl Bridges {
    pub(super) fn new(mesh: &Mesh, settings: &Settings) -> Self {
        let spans = mesh.points.iter().map(|_| OnceLock::new()).collect();
        Self { spans, around: mesh.around_points(), max_path_m: settings.max_path_m }
    }

    /// The rays from an edge to edges.
    pub(super) fn tree(&self, paths: &Paths, point: u32) -> &Tree {
        &self.spans(paths, point).tree
    }

    fn spans(&self, paths: &Paths, point: u32) -> &Spans {
        let grow = || {
            let paths = paths.within(self.max_path_m);
            Spans::grow(&paths, point, &self.around[point as usize])
        };
        self.spans[point as usize].get_or_init(grow)
    }
}

impl Spans {
    fn grow(paths: &Paths, point: u32, around: &[(u32, u8)]) -> Self {
        let mut tree = Tree::grow_from_corner(paths, point, around);
        let rays = std::mem::take(&mut tree.to_edges);
        let side = |ray: &Ray| {
            let (triangle, corner) = *around.get(tree.root_slot(&paths.faces, ray.into()))?;
            let mesh = paths.mesh.as_ref()?;
            let place = mesh.corner(triangle, corner as usize);
            // What runs along its right border has it on the left.
            Some([1, 2].map(|next| {
                let border = mesh.corner(triangle, (corner as usize + next) % 3) - place;
                let off_m = border.perp_dot(ray.departure).abs();
                border.dot(ray.departure) > 0.0 && off_m <= ALONG_RAD * border.length()
            }))
        };
        let mut found: Vec<(u32, Ray, [bool; 2])> =
            rays.iter().map(|(edge, ray)| (*edge, *ray, side(ray).unwrap_or_default())).collect();
        found.sort_by(|(one, a, _), (other, b, _)| {
            one.cmp(other).then(a.run.length_squared().total_cmp(&b.run.length_squared()))
        });
        let mut flanks: Vec<[bool; 2]> = Vec::with_capacity(found.len());
        for (edge, ray, sides) in found {
            match known(&tree.to_edges, edge, &ray) {
                // One that touches a corner, or runs along a wall, is found on both sides of it.
                Some(place) => {
                    let known = &mut flanks[place];
                    *known = [known[0] | sides[0], known[1] | sides[1]];
                }
                None => {
                    tree.to_edges.push((edge, ray));
                    flanks.push(sides);
                }
            }
        }
        Self { tree, flanks }
    }
}

/// Where among rays that are sorted by edge and length one is already.
fn known(rays: &[(u32, Ray)], edge: u32, ray: &Ray) -> Option<usize> {
    let length_m = ray.run.length();
    rays.iter()
        .enumerate()
        .rev()
        .take_while(|(_, (to, other))| *to == edge && length_m - other.run.length() < SAME_M)
        .find(|(_, (_, other))| is_same_departure(ray, other))
        .map(|(place, _)| place)
}

/// All echoes by way of two edges; their ways go to [`Trees::bridged`]. The trees are sorted by edge.
pub(super) fn echoes(paths: &Paths, trees: &mut Trees, law: EdgeLaw) -> Vec<Echo> {
    if !paths.settings.double_diffraction {
        return Vec::new();
    }
    let mut found = Found { settings: &paths.settings, law, ways: Vec::new(), echoes: Vec::new() };
    let outs = arms(paths, &trees.out);
    let apart = trees.back.as_ref().map(|back| arms(paths, back));
    let backs = apart.as_ref().unwrap_or(&outs);
    for (first, corner, outs) in &outs {
        let Spans { tree, flanks } = paths.bridges.spans(paths, *first);
        for (second, far_corner, backs) in backs {
            let (from, rays) = tree.flat_to(*second);
            for (leg, (_, ray)) in (from..).zip(rays) {
                let flanks = flanks[leg as usize];
                let bridge = Bridge { points: [*first, *second], leg, ray, flanks };
                if !found.join(&bridge, [corner, far_corner], [outs, backs]) {
                    break;
                }
            }
        }
    }
    trees.bridged = found.ways;
    found.echoes
}

/// The edges that a tree comes to, and its rays to each.
fn arms<'a>(paths: &'a Paths, tree: &'a Tree) -> Vec<(u32, &'a Corner, Vec<Arm<'a>>)> {
    let known = |point| Some((point, paths.edges.corner(point)?));
    let edges = tree.edges().into_iter().filter_map(known);
    edges.map(|(point, corner)| (point, corner, corner.arms(tree, point))).collect()
}

/// A way from edge to edge.
struct Bridge<'a> {
    points: [u32; 2],
    leg: u32,
    ray: &'a Ray,
    /// See [`Spans`].
    flanks: [bool; 2],
}

struct Found<'a> {
    settings: &'a Settings,
    law: EdgeLaw,
    ways: Vec<Bridged>,
    echoes: Vec<Echo>,
}

/// How the way between two edges leaves one of them and comes to the other, on one of its sides.
struct Passage {
    ends: [Facing; 2],
    /// What of the wave along a face counts as incident.
    share: f64,
}

/// What an edge makes of an arm on each passage; nothing where it is not in the same air.
type Passed = SmallVec<[Complex64; 2]>;

impl Found<'_> {
    /// Out to one corner, over a bridge, and back from the other corner. False if the bridge, and
    /// with it all longer ones, is too long.
    fn join(&mut self, bridge: &Bridge, corners: [&Corner; 2], [outs, backs]: [&[Arm]; 2]) -> bool {
        let leg_m = bridge.ray.run.length();
        let (Some(out), Some(back)) = (outs.first(), backs.first()) else { return true };
        if out.length_m + leg_m + back.length_m > self.settings.max_path_m {
            return false;
        }
        let passages = self.passages(bridge, corners);
        let passed = |end: usize, arms: &[Arm]| -> Vec<Passed> {
            arms.iter().map(|arm| self.passed(corners[end], end, arm, &passages, leg_m)).collect()
        };
        let (from_outs, from_backs) = (passed(0, outs), passed(1, backs));
        let norm = |field: &Passed| field.iter().map(|part| part.norm()).sum::<f64>();
        let most = from_backs.iter().map(norm).fold(0.0, f64::max) * bridge.ray.gain;
        for (out, from_out) in outs.iter().zip(&from_outs) {
            if norm(from_out) * most < self.settings.floor {
                continue;
            }
            for (back, from_back) in backs.iter().zip(&from_backs) {
                let length_m = out.length_m + leg_m + back.length_m;
                if length_m > self.settings.max_path_m {
                    break;
                }
                let parts = passages.iter().zip(from_out.iter().zip(from_back));
                let field: Complex64 = parts.map(|(way, (a, b))| way.share * a * b).sum();
                self.add(bridge, out, back, length_m, field * spreading(out, back, leg_m));
            }
        }
        true
    }

    fn add(&mut self, bridge: &Bridge, out: &Arm, back: &Arm, length_m: f64, field: Complex64) {
        let settings = self.settings;
        let gain = bridge.ray.gain * settings.air_gain(length_m);
        let amplitude = gain * field.norm();
        let order = out.ray.order + bridge.ray.order + back.ray.order;
        if amplitude < settings.floor || !settings.allows(order) {
            return;
        }
        self.echoes.push(Echo {
            length_m,
            amplitude,
            phase_rad: field.arg(),
            departure: out.ray.departure,
            arrival: back.ray.departure,
            rise_rad: [0.0; 2],
            image: 0,
            via: Via::Edges { way: self.ways.len() as u32 },
        });
        let Bridge { points, leg, .. } = *bridge;
        self.ways.push(Bridged { points, leg, out: out.number, back: back.number });
    }

    /// The sides on which a ray runs from one corner to another: one, or along a wall's faces two.
    fn passages(&self, bridge: &Bridge, corners: [&Corner; 2]) -> SmallVec<[Passage; 2]> {
        let ray = bridge.ray;
        let [mut here, there] = [corners[0].facings(ray.departure), corners[1].facings(-ray.run)];
        here.retain(|facing| match facing.flank {
            Flank::Open => true,
            Flank::Left => bridge.flanks[0],
            Flank::Right => bridge.flanks[1],
        });
        // Seen from the far end left is right, and through an odd number of mirrors right is left.
        let is_turned = ray.order.is_multiple_of(2);
        let fits = |one: &Facing, other: &Facing| match (one.flank, other.flank) {
            (Flank::Open, _) | (_, Flank::Open) => true,
            (a, b) => (a == b) != is_turned,
        };
        let pairs = here.iter().flat_map(|one| there.iter().map(move |other| [*one, *other]));
        pairs
            .filter(|[one, other]| fits(one, other))
            .map(|ends| Passage { ends, share: self.share(&ends) })
            .collect()
    }

    fn share(&self, ends: &[Facing; 2]) -> f64 {
        let along = ends.iter().filter_map(|end| end.face_reflectance);
        let (count, sum) = along.fold((0.0, 0.0), |(n, sum), r| (n + 1.0, sum + r));
        match self.law {
            _ if count == 0.0 => 1.0,
            EdgeLaw::Utd => 1.0 / (1.0 + sum / count),
            // Without an aspect, the two sides of a wall are one.
            EdgeLaw::KucSiegel | EdgeLaw::BozmaKuc { .. } => 0.5,
        }
    }

    /// An edge's coefficient over the root of its distance parameter, between an arm and one end of
    /// each passage, with what the arm's walls leave.
    fn passed(
        &self,
        corner: &Corner,
        end: usize,
        arm: &Arm,
        passages: &[Passage],
        leg_m: f64,
    ) -> Passed {
        let distance_m = distance_parameter_m(arm.radius_m, leg_m);
        let through = |passage: &Passage| {
            let facing = &passage.ends[end];
            if facing.sector != arm.sector {
                return Complex64::ZERO;
            }
            // Where an arm goes on along the wall the near end counts as in the shadow: what the far
            // end sends straight on is not counted there either.
            let in_rad = match facing.flank {
                Flank::Open => arm.from_rad,
                Flank::Left => arm.from_rad + INTO_SHADOW_RAD,
                Flank::Right => arm.from_rad - INTO_SHADOW_RAD,
            };
            let aspect = Aspect { in_rad, out_rad: facing.from_rad, distance_m };
            let wedge = corner.wedge(arm.sector);
            arm.ray.gain * self.law.echo(wedge, &aspect, self.settings.wave_number_per_m)
        };
        passages.iter().map(through).collect()
    }
}

/// The legs' spreading beside a straight way's and the roots of the distance parameters:
/// `sqrt(L1 L2 (s' + t + s) / (w' t w))` for arms that cylinders have widened to `w'` and `w`.
fn spreading(out: &Arm, back: &Arm, leg_m: f64) -> f64 {
    let distance_m = |arm: &Arm| distance_parameter_m(arm.radius_m, leg_m);
    let length_m = out.length_m + leg_m + back.length_m;
    let widths = out.width_m * leg_m * back.width_m;
    (distance_m(out) * distance_m(back) * length_m / widths).sqrt()
}

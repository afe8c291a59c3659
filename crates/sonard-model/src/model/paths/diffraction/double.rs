//! Double diffraction: sound from one upright edge to another.
//!
//! The rays from edge to edge depend on the scene alone. A tree of beams from each edge in use is
//! grown on first use and kept for all observation points. An echo consists of a ray out to one
//! edge, a ray on from there to another edge (or by walls back to the same) and a ray back from
//! that edge. Its reverse is another echo.
//!
//! # Strength
//!
//! Over legs `s'`, `t`, `s` the wave that left the first edge is cylindrical about it in the plan.
//! The second edge diffracts that wave with a coefficient of its own (Kouyoumjian and Pathak 1974,
//! whose section on ray-optical fields admits any such wave):
//!
//! ```text
//! D1 D2 / sqrt(s' t s)      with D1 at L1 = s' t / (s' + t), D2 at L2 = t s / (t + s)
//! ```
//!
//! compared with a straight path's `1 / sqrt(s' + t + s)`. In the upright direction, where the
//! front's other radius keeps growing, spreading adds the same to both. The expression is symmetric
//! under reversal. The product holds while neither edge lies in the other's transition region.
//! Where transmitter (or receiver) and both edges are nearly in line, the field at the second edge
//! is not ray-optical, and the product errs by some decibels.
//!
//! # Along a wall
//!
//! Two ends of one wall see each other along its faces. On a rigid face the wave along it is the
//! incident wave and its mirror image in one, and the second coefficient counts each: half of it is
//! incident (same paper, section on grazing incidence). For a face with reflectance `R` the share
//! is `1 / (1 + R)`. A free-standing plate has two such paths, one on each side and of equal
//! length, and they are one echo.

use num_complex::Complex64;
use smallvec::SmallVec;

use super::{
    edge_ray::{EdgeRay, distance_parameter_m, floor},
    edge_to_edge::EdgeToEdge,
};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw},
    model::{
        SearchPart,
        paths::{
            beams::UnfoldedRay,
            echo::{PathEcho, Via},
            floor::{Facing, Flank, PlanCorner, TracingPlan},
            rays::Rays,
            settings::PathSettings,
        },
    },
};

/// Offset beyond the width of a tie at a boundary, radians.
const INTO_SHADOW_RAD: f64 = 2e-9;

/// A path by two edges.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DoubleDiffraction {
    /// Points of the edges, in order.
    pub(crate) points: [u32; 2],
    /// Ray between the edges, in the first edge's tree of [`EdgeToEdge`].
    pub(crate) leg: u32,
    /// Rays to the first edge and, from the receiver, to the second; see [`Rays::to_edge`].
    pub(crate) out: u32,
    pub(crate) back: u32,
}

/// Finds all echoes with two diffractions and their paths, by number in [`Via::Edges`]. The rays
/// must be sorted by edge.
pub(crate) fn echoes(
    plan: &TracingPlan,
    edge_to_edge: &EdgeToEdge,
    law: EdgeLaw,
    out: &Rays,
    back: Option<&Rays>,
) -> (Vec<PathEcho>, Vec<DoubleDiffraction>) {
    if !plan.settings.double_diffraction {
        return Default::default();
    }
    let mut search =
        DoubleSearch { plan, settings: &plan.settings, law, paths: Vec::new(), echoes: Vec::new() };
    let outs = rays_to_edges(plan, out);
    let apart = back.map(|back| rays_to_edges(plan, back));
    let backs = apart.as_ref().unwrap_or(&outs);
    for (first, corner, outs) in &outs {
        let from = edge_to_edge.at(plan, *first);
        if plan.effort.is_over() || edge_to_edge.effort.is_over() {
            break;
        }
        for (second, far_corner, backs) in backs {
            let (number, rays) = from.beams.rays_to_edge(*second);
            for (leg, (_, ray)) in (number..).zip(rays) {
                let flanks = from.flanks[leg as usize];
                let pair = EdgePair { points: [*first, *second], leg, ray, flanks };
                if !search.connect(&pair, [corner, far_corner], [outs, backs]) {
                    break;
                }
            }
        }
    }
    (search.echoes, search.paths)
}

/// Returns the edges that rays reach, and the rays to each.
fn rays_to_edges<'a>(
    plan: &'a TracingPlan,
    rays: &'a Rays,
) -> Vec<(u32, &'a PlanCorner, Vec<EdgeRay<'a>>)> {
    let known = |point| Some((point, plan.corners.corner(point)?));
    let edges = rays.edges().into_iter().filter_map(known);
    edges.map(|(point, corner)| (point, corner, EdgeRay::all(corner, rays, point))).collect()
}

/// A ray from edge to edge.
struct EdgePair<'a> {
    points: [u32; 2],
    leg: u32,
    ray: &'a UnfoldedRay,
    /// See [`FromEdge`](super::edge_to_edge::FromEdge).
    flanks: [bool; 2],
}

/// Connects rays out, from edge to edge and back.
struct DoubleSearch<'a> {
    plan: &'a TracingPlan,
    settings: &'a PathSettings,
    law: EdgeLaw,
    paths: Vec<DoubleDiffraction>,
    echoes: Vec<PathEcho>,
}

/// Departure and arrival of the ray between two edges, on one of its sides.
struct EdgePassage {
    ends: [Facing; 2],
    /// Share of the wave along a face that counts as incident.
    share: f64,
}

/// Diffracted field of a ray on each passage; zero in a different sector of air.
type Passed = SmallVec<[Complex64; 2]>;

impl DoubleSearch<'_> {
    /// Connects rays out to one corner, on to the other, and back from there. Returns `false` if
    /// the ray between them, and with it all longer ones, is too long.
    ///
    /// The field is `sum of share D1 D2` over the passages, times spreading. Each factor is
    /// computed once for each ray out and each ray back, and only their products for each pair.
    fn connect(
        &mut self,
        pair: &EdgePair,
        corners: [&PlanCorner; 2],
        [outs, backs]: [&[EdgeRay]; 2],
    ) -> bool {
        let leg_m = pair.ray.run.length();
        let (Some(out), Some(back)) = (outs.first(), backs.first()) else { return true };
        if out.length_m + leg_m + back.length_m > self.settings.max_path_m {
            return false;
        }
        if !self.plan.effort.step(SearchPart::TwoEdges, 4 * (outs.len() + backs.len())) {
            return false;
        }
        let passages = self.passages(pair, corners);
        let passed = |end: usize, rays: &[EdgeRay]| -> Vec<Passed> {
            rays.iter().map(|ray| self.passed(corners[end], end, ray, &passages, leg_m)).collect()
        };
        let (from_outs, from_backs) = (passed(0, outs), passed(1, backs));
        let norm = |field: &Passed| field.iter().map(|part| part.norm()).sum::<f64>();
        let bound = from_backs.iter().map(norm).fold(0.0, f64::max) * pair.ray.gain;
        for (out, from_out) in outs.iter().zip(&from_outs) {
            let raised = self.plan.raised.by_edges(out.length_m + leg_m + back.length_m);
            if norm(from_out) * bound * raised < self.settings.floor {
                continue;
            }
            for (back, from_back) in backs.iter().zip(&from_backs) {
                let length_m = out.length_m + leg_m + back.length_m;
                if length_m > self.settings.max_path_m
                    || !self.plan.effort.step(SearchPart::TwoEdges, 1)
                {
                    break;
                }
                let parts = passages.iter().zip(from_out.iter().zip(from_back));
                let field: Complex64 = parts.map(|(passage, (a, b))| passage.share * a * b).sum();
                self.add(pair, out, back, length_m, field * spreading(out, back, leg_m));
            }
        }
        true
    }

    fn add(
        &mut self,
        pair: &EdgePair,
        out: &EdgeRay,
        back: &EdgeRay,
        length_m: f64,
        field: Complex64,
    ) {
        let settings = self.settings;
        let gain = pair.ray.gain * settings.air_gain(length_m);
        let amplitude = gain * field.norm();
        let order = out.ray.order + pair.ray.order + back.ray.order;
        let bound = amplitude * self.plan.raised.by_edges(length_m);
        if bound < floor(settings, out, back, length_m) || !settings.allows(order) {
            return;
        }
        self.plan.effort.keep::<(PathEcho, PathEcho, DoubleDiffraction)>(1);
        self.echoes.push(PathEcho {
            length_m,
            amplitude,
            phase_rad: field.arg(),
            departure: out.ray.departure,
            arrival: back.ray.departure,
            rise_rad: [0.0; 2],
            image: 0,
            slopes: [out.slopes, back.slopes],
            is_repeated: out.is_spread || back.is_spread,
            via: Via::Edges { double: self.paths.len() as u32 },
        });
        let EdgePair { points, leg, .. } = *pair;
        self.paths.push(DoubleDiffraction { points, leg, out: out.number, back: back.number });
    }

    /// Sides on which a ray runs from one corner to another: one, or two along a wall's faces.
    fn passages(&self, pair: &EdgePair, corners: [&PlanCorner; 2]) -> SmallVec<[EdgePassage; 2]> {
        let ray = pair.ray;
        let [mut here, there] = [corners[0].facings(ray.departure), corners[1].facings(-ray.run)];
        here.retain(|facing| match facing.flank {
            Flank::Open => true,
            Flank::Left => pair.flanks[0],
            Flank::Right => pair.flanks[1],
        });
        // Seen from the far end left is right, and through an odd number of mirrors right is left.
        let is_turned = ray.order.is_multiple_of(2);
        let fits = |first: &Facing, second: &Facing| match (first.flank, second.flank) {
            (Flank::Open, _) | (_, Flank::Open) => true,
            (a, b) => (a == b) != is_turned,
        };
        let pairs = here.iter().flat_map(|first| there.iter().map(move |second| [*first, *second]));
        pairs
            .filter(|[first, second]| fits(first, second))
            .map(|ends| EdgePassage { ends, share: self.share(&ends) })
            .collect()
    }

    /// Share of the wave along a wall's face that counts as incident; see the module's description.
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

    /// Coefficient of an edge over the root of its distance parameter, between a ray and one end of
    /// each passage, including the reflection losses of the ray.
    fn passed(
        &self,
        corner: &PlanCorner,
        end: usize,
        ray: &EdgeRay,
        passages: &[EdgePassage],
        leg_m: f64,
    ) -> Passed {
        let distance_m = distance_parameter_m(ray.radius_m, leg_m);
        let through = |passage: &EdgePassage| {
            let facing = &passage.ends[end];
            if facing.sector != ray.sector {
                return Complex64::ZERO;
            }
            // A ray that continues along the wall counts as in the shadow of the near end. The far
            // end does not count the straight continuation either.
            let in_rad = match facing.flank {
                Flank::Open => ray.from_rad,
                Flank::Left => ray.from_rad + INTO_SHADOW_RAD,
                Flank::Right => ray.from_rad - INTO_SHADOW_RAD,
            };
            let aspect = Aspect { in_rad, out_rad: facing.from_rad, distance_m };
            let k = self.settings.wave_number_per_m;
            ray.ray.gain * corner.echo(self.law, ray.sector, &aspect, k)
        };
        passages.iter().map(through).collect()
    }
}

/// Spreading of the legs compared with a straight path and the roots of the distance parameters:
/// `sqrt(L1 L2 (s' + t + s) / (w' t w))` for rays that cylinders have widened to `w'` and `w`.
fn spreading(out: &EdgeRay, back: &EdgeRay, leg_m: f64) -> f64 {
    let distance_m = |ray: &EdgeRay| distance_parameter_m(ray.radius_m, leg_m);
    let length_m = out.length_m + leg_m + back.length_m;
    let widths = out.width_m * leg_m * back.width_m;
    (distance_m(out) * distance_m(back) * length_m / widths).sqrt()
}

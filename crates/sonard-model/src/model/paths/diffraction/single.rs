//! Echoes with one diffraction at an upright edge.

use std::cell::OnceCell;

use num_complex::Complex64;

use super::edge_ray::{EdgeRay, distance_parameter_m, floor};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw, EdgeView, LitImages},
    geometry::DVec2,
    model::{
        SearchPart,
        paths::{
            echo::{PathEcho, Via, sorted},
            effort::Effort,
            floor::{PlanCorner, TracingPlan},
            rays::Rays,
            settings::PathSettings,
            tolerance::{SAME_M, SAME_RAD, TIE_M},
        },
    },
    reading::PathKind,
};

/// Angle and distance within which the search for mirror images may decide differently about an
/// image's boundary than the law of diffraction does: several times the tolerances of ties.
const NEAR_RAD: f64 = 10.0 * SAME_RAD;
const NEAR_M: f64 = 10.0 * TIE_M;

/// Finds all echoes with one diffraction: out on one ray to an edge, back on another or the same.
/// The rays must be sorted by edge; `mirrored` are the echoes by mirror reflections alone.
pub(crate) fn echoes(
    plan: &TracingPlan,
    law: EdgeLaw,
    out: &Rays,
    back: Option<&Rays>,
    mirrored: &Mirrored,
) -> Vec<PathEcho> {
    let (settings, effort) = (&plan.settings, &plan.effort);
    let search = SingleSearch { law, plan, settings, effort, mirrored };
    let mut echoes = Vec::new();
    for point in out.edges() {
        let Some(corner) = plan.corners.corner(point) else { continue };
        let outs = EdgeRay::all(corner, out, point);
        match back {
            None => search.pairs(corner, point, &outs, &mut echoes),
            Some(back) => {
                let backs = EdgeRay::all(corner, back, point);
                search.pairs_between(corner, point, [&outs, &backs], &mut echoes);
            }
        }
    }
    echoes
}

/// Aspect of the edge of an echo with one diffraction, seen from the path's ends. `None` for other
/// echoes, by way of a cylinder, for a narrow strip or a post, and for laws without an aspect.
pub(crate) fn view(
    plan: &TracingPlan,
    out: &Rays,
    back: &Rays,
    echo: &PathEcho,
) -> Option<EdgeView> {
    let Via::Edge { point, out: there, back: here, lit } = echo.via else { return None };
    let is_utd = plan.settings.edge_law == Some(EdgeLaw::Utd);
    let is_edge = |corner: &&PlanCorner| is_utd && !corner.is_whole();
    let corner = plan.corners.corner(point).filter(is_edge)?;
    let rays = [out.to_edge_by_walls(there)?, back.to_edge_by_walls(here)?];
    let [out, back] = rays.map(|ray| EdgeRay::by_walls(corner, ray, 0));
    let (out, back) = (out?, back?);
    Some(EdgeView {
        wedge: *corner.wedge(out.sector),
        aspect: aspect(&out, &back),
        lit,
        wave_number_per_m: plan.settings.wave_number_per_m,
        legs_m: [out.length_m, back.length_m],
        swapped: rays.map(|ray| ray.order % 2 == 1),
    })
}

/// Distance, metres, by which the pulse of an echo arrives earlier than along its path. The surface
/// of a post reflects, but path lengths are to its axis. 0 for other echoes, and by way of
/// cylinders.
pub(crate) fn lead_m(plan: &TracingPlan, out: &Rays, back: &Rays, echo: &PathEcho) -> f64 {
    let Via::Edge { point, out: there, back: here, .. } = echo.via else { return 0.0 };
    let lead = || {
        let corner = plan.corners.corner(point).filter(|corner| corner.is_whole())?;
        let rays = [out.to_edge_by_walls(there)?, back.to_edge_by_walls(here)?];
        let [out, back] = rays.map(|ray| EdgeRay::by_walls(corner, ray, 0));
        Some(echo.rise_rad[0].cos() * corner.lead_m(&aspect(&out?, &back?)))
    };
    lead().unwrap_or(0.0)
}

/// Echoes by mirror reflections alone, each once.
pub(crate) struct Mirrored<'a> {
    echoes: &'a [PathEcho],
    sorted: OnceCell<Vec<PathEcho>>,
}

impl<'a> Mirrored<'a> {
    /// Creates the set from echoes of the plan, in any order and with repeats.
    pub(crate) fn new(echoes: &'a [PathEcho]) -> Self {
        Self { echoes, sorted: OnceCell::new() }
    }

    /// Sum of the amplitudes of the echoes that run as one does by an edge, within `near_rad`.
    fn amplitude_near(&self, out: &EdgeRay, back: &EdgeRay, near_rad: f64) -> f64 {
        let sorted = self.sorted.get_or_init(|| sorted(self.echoes));
        let length_m = out.length_m + back.length_m;
        let from = sorted.partition_point(|echo| echo.length_m < length_m - SAME_M);
        let is_along = |a: DVec2, b: DVec2| a.distance_squared(b) < (2.0 * near_rad).powi(2);
        sorted[from..]
            .iter()
            .take_while(|echo| echo.length_m < length_m + SAME_M)
            .filter(|echo| echo.via.kind() == PathKind::Specular)
            .filter(|echo| is_along(echo.departure, out.ray.departure))
            .filter(|echo| is_along(echo.arrival, back.ray.departure))
            .map(|echo| echo.amplitude)
            .sum()
    }
}

/// Pairs rays at one edge.
struct SingleSearch<'a> {
    law: EdgeLaw,
    plan: &'a TracingPlan,
    settings: &'a PathSettings,
    effort: &'a Effort,
    mirrored: &'a Mirrored<'a>,
}

impl SingleSearch<'_> {
    /// Adds echoes out on one ray and back on another or the same: each pair in both directions.
    fn pairs(&self, corner: &PlanCorner, point: u32, rays: &[EdgeRay], echoes: &mut Vec<PathEcho>) {
        for (i, out) in rays.iter().enumerate() {
            for (j, back) in rays.iter().enumerate().skip(i) {
                // Sorted by length.
                if out.length_m + back.length_m > self.settings.max_path_m
                    || !self.effort.step(SearchPart::UprightEdges, 1)
                {
                    break;
                }
                let Some(echo) = self.echo(corner, point, out, back) else { continue };
                if let Via::Edge { lit, .. } = echo.via
                    && i != j
                {
                    let lit = lit.reversed();
                    echoes.push(PathEcho {
                        departure: echo.arrival,
                        arrival: echo.departure,
                        slopes: [back.slopes, out.slopes],
                        via: Via::Edge { point, out: back.number, back: out.number, lit },
                        ..echo
                    });
                }
                echoes.push(echo);
            }
        }
    }

    /// Adds echoes out on a ray from the transmitter and back on one from the receiver.
    fn pairs_between(
        &self,
        corner: &PlanCorner,
        point: u32,
        [outs, backs]: [&[EdgeRay]; 2],
        echoes: &mut Vec<PathEcho>,
    ) {
        for out in outs {
            for back in backs {
                if out.length_m + back.length_m > self.settings.max_path_m
                    || !self.effort.step(SearchPart::UprightEdges, 1)
                {
                    break;
                }
                echoes.extend(self.echo(corner, point, out, back));
            }
        }
    }

    fn echo(
        &self,
        corner: &PlanCorner,
        point: u32,
        out: &EdgeRay,
        back: &EdgeRay,
    ) -> Option<PathEcho> {
        let (field, lit) = self.field(corner, out, back)?;
        self.effort.keep::<PathEcho>(2);
        Some(PathEcho {
            length_m: out.length_m + back.length_m,
            amplitude: field.norm(),
            phase_rad: field.arg(),
            departure: out.ray.departure,
            arrival: back.ray.departure,
            rise_rad: [0.0; 2],
            image: 0,
            slopes: [out.slopes, back.slopes],
            is_repeated: out.is_spread || back.is_spread,
            via: Via::Edge { point, out: out.number, back: back.number, lit },
        })
    }

    /// Relative field of the echo out and back on two rays, and the edge's images beside it. `None`
    /// if it is below the floor, also by way of floor and ceiling.
    ///
    /// Cheapest test first: a mirror's echo after the losses at walls and in air, then the law's
    /// bound at this aspect, then the law.
    fn field(
        &self,
        corner: &PlanCorner,
        out: &EdgeRay,
        back: &EdgeRay,
    ) -> Option<(Complex64, LitImages)> {
        let Self { law, settings, .. } = self;
        if out.sector != back.sector || !settings.allows(out.ray.order + back.ray.order) {
            return None;
        }
        let length_m = out.length_m + back.length_m;
        let strength = out.ray.gain * back.ray.gain * settings.air_gain(length_m);
        let floor = floor(settings, out, back, length_m) / self.plan.raised.by_edge(length_m);
        let aspect = aspect(out, back);
        let strength = strength * spreading(out, back, &aspect);
        // No law exceeds a wall's echo and the images that its edge replaces; right before it a
        // post may.
        if !corner.is_whole() && 2.0 * strength < floor {
            return None;
        }
        let k = settings.wave_number_per_m;
        if strength * corner.bound(*law, out.sector, &aspect, k) < floor {
            return None;
        }
        let lit = self.lit_images(corner, out, back, &aspect, strength);
        let field = strength * corner.echo_beside(*law, out.sector, &aspect, lit, k);
        (field.norm() >= floor).then_some((field, lit))
    }

    /// Images of an edge that the search found, or counts as visible. `strength` is the amplitude of
    /// a perfect mirror's echo by the same rays.
    fn lit_images(
        &self,
        corner: &PlanCorner,
        out: &EdgeRay,
        back: &EdgeRay,
        aspect: &Aspect,
        strength: f64,
    ) -> LitImages {
        if self.law != EdgeLaw::Utd || corner.is_whole() {
            return LitImages::default();
        }
        let near_rad = NEAR_RAD + NEAR_M / aspect.distance_m;
        let order = u32::from(out.ray.order + back.ray.order);
        // The direct path may not be listed.
        let min_order = u32::from(order == 0 && !self.settings.direct);
        let max_order = self.settings.max_order.map_or(u32::MAX, |max| u32::from(max) - order);
        let found = || self.mirrored.amplitude_near(out, back, near_rad) / strength;
        corner.wedge(out.sector).lit_as_found(aspect, near_rad, &(min_order..=max_order), found)
    }
}

/// Aspect of an edge, in on one ray and out on another.
fn aspect(out: &EdgeRay, back: &EdgeRay) -> Aspect {
    Aspect {
        in_rad: out.from_rad,
        out_rad: back.from_rad,
        distance_m: distance_parameter_m(out.radius_m, back.radius_m),
    }
}

/// Factor of the field at an edge due to cylinders on the path, relative to fronts that only flat
/// walls turned: those decrease by `sqrt((s + s') / (s s'))`. The distance parameter of the
/// transition is that of the fronts' radii of curvature in the plan (Kouyoumjian and Pathak 1974,
/// equations (24) and (33); their other radius, along the edge, is not changed by cylinders).
fn spreading(out: &EdgeRay, back: &EdgeRay, aspect: &Aspect) -> f64 {
    let length_m = out.length_m + back.length_m;
    (aspect.distance_m * length_m / (out.width_m * back.width_m)).sqrt()
}

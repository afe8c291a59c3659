//! Echoes that one upright edge diffracts.

use num_complex::Complex64;

use super::edge_ray::{EdgeRay, distance_parameter_m, floor};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw, EdgeView},
    model::{
        SearchPart,
        paths::{
            echo::{Echo, Via},
            effort::Effort,
            plan::{Corner, Plan},
            rays::Rays,
            settings::Settings,
        },
    },
};

/// All echoes with one diffraction: out on one ray to an edge, back on another or the same. The rays are
/// sorted by edge.
pub(crate) fn echoes(plan: &Plan, law: EdgeLaw, out: &Rays, back: Option<&Rays>) -> Vec<Echo> {
    let search = Search { law, plan, settings: &plan.settings, effort: &plan.effort };
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

/// The aspect of the edge of an echo with one diffraction, from where the echo begins and ends; `None` of
/// other echoes, by way of a cylinder, of a narrow strip or a post, and by laws that know no aspect.
pub(crate) fn view(plan: &Plan, out: &Rays, back: &Rays, echo: &Echo) -> Option<EdgeView> {
    let Via::Edge { point, out: there, back: here } = echo.via else { return None };
    let is_utd = plan.settings.edge_law == Some(EdgeLaw::Utd);
    let is_edge = |corner: &&Corner| is_utd && !corner.is_whole();
    let corner = plan.corners.corner(point).filter(is_edge)?;
    let rays = [out.to_edge_by_walls(there)?, back.to_edge_by_walls(here)?];
    let [out, back] = rays.map(|ray| EdgeRay::by_walls(corner, ray, 0));
    let (out, back) = (out?, back?);
    Some(EdgeView {
        wedge: *corner.wedge(out.sector),
        aspect: aspect(&out, &back),
        wave_number_per_m: plan.settings.wave_number_per_m,
        legs_m: [out.length_m, back.length_m],
        swapped: rays.map(|ray| ray.order % 2 == 1),
    })
}

/// By how much the pulse of an echo comes earlier than along its path, metres: by the surface of a post, to whose axis
/// paths are told. 0 of other echoes, and by way of cylinders.
pub(crate) fn lead_m(plan: &Plan, out: &Rays, back: &Rays, echo: &Echo) -> f64 {
    let Via::Edge { point, out: there, back: here } = echo.via else { return 0.0 };
    let lead = || {
        let corner = plan.corners.corner(point).filter(|corner| corner.is_whole())?;
        let rays = [out.to_edge_by_walls(there)?, back.to_edge_by_walls(here)?];
        let [out, back] = rays.map(|ray| EdgeRay::by_walls(corner, ray, 0));
        Some(echo.rise_rad[0].cos() * corner.lead_m(&aspect(&out?, &back?)))
    };
    lead().unwrap_or(0.0)
}

/// Pairs of rays at one edge.
struct Search<'a> {
    law: EdgeLaw,
    plan: &'a Plan,
    settings: &'a Settings,
    effort: &'a Effort,
}

impl Search<'_> {
    /// Out on one ray and back on another or the same: each pair in both directions.
    fn pairs(&self, corner: &Corner, point: u32, rays: &[EdgeRay], echoes: &mut Vec<Echo>) {
        for (i, out) in rays.iter().enumerate() {
            for (j, back) in rays.iter().enumerate().skip(i) {
                // Sorted by length.
                if out.length_m + back.length_m > self.settings.max_path_m
                    || !self.effort.step(SearchPart::UprightEdges, 1)
                {
                    break;
                }
                let Some(echo) = self.echo(corner, point, out, back) else { continue };
                if i != j {
                    echoes.push(Echo {
                        departure: echo.arrival,
                        arrival: echo.departure,
                        slopes: [back.slopes, out.slopes],
                        via: Via::Edge { point, out: back.number, back: out.number },
                        ..echo
                    });
                }
                echoes.push(echo);
            }
        }
    }

    /// Out on a ray from the transmitter and back on one from the receiver.
    fn pairs_between(
        &self,
        corner: &Corner,
        point: u32,
        [outs, backs]: [&[EdgeRay]; 2],
        echoes: &mut Vec<Echo>,
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

    fn echo(&self, corner: &Corner, point: u32, out: &EdgeRay, back: &EdgeRay) -> Option<Echo> {
        let field = self.field(corner, out, back)?;
        self.effort.keep::<Echo>(2);
        Some(Echo {
            length_m: out.length_m + back.length_m,
            amplitude: field.norm(),
            phase_rad: field.arg(),
            departure: out.ray.departure,
            arrival: back.ray.departure,
            rise_rad: [0.0; 2],
            image: 0,
            slopes: [out.slopes, back.slopes],
            is_repeated: out.is_spread || back.is_spread,
            via: Via::Edge { point, out: out.number, back: back.number },
        })
    }

    /// Relative field of the echo out and back on two rays, `None` if it is below the floor and by way of floor and
    /// ceiling, too.
    ///
    /// Cheapest test first: what walls and air leave of a mirror's echo, then the law's bound at this aspect,
    /// then the law.
    fn field(&self, corner: &Corner, out: &EdgeRay, back: &EdgeRay) -> Option<Complex64> {
        let Self { law, settings, .. } = self;
        if out.sector != back.sector || !settings.allows(out.ray.order + back.ray.order) {
            return None;
        }
        let length_m = out.length_m + back.length_m;
        let strength = out.ray.gain * back.ray.gain * settings.air_gain(length_m);
        let floor = floor(settings, out, back, length_m) / self.plan.raised.by_edge(length_m);
        let aspect = aspect(out, back);
        let strength = strength * spreading(out, back, &aspect);
        // No law gives more than a wall's echo and the images that its edge replaces; right before it a post may.
        if !corner.is_whole() && 2.0 * strength < floor {
            return None;
        }
        let k = settings.wave_number_per_m;
        if strength * corner.bound(*law, out.sector, &aspect, k) < floor {
            return None;
        }
        let field = strength * corner.echo(*law, out.sector, &aspect, k);
        (field.norm() >= floor).then_some(field)
    }
}

/// In on one ray, out on another.
fn aspect(out: &EdgeRay, back: &EdgeRay) -> Aspect {
    Aspect {
        in_rad: out.from_rad,
        out_rad: back.from_rad,
        distance_m: distance_parameter_m(out.radius_m, back.radius_m),
    }
}

/// The share that cylinders on the path leave of the field at an edge, beside fronts that flat walls
/// turned: these fall by `sqrt((s + s') / (s s'))`, and the distance parameter of the
/// transition is that of the fronts' radii of curvature in the plan (Kouyoumjian and Pathak
/// 1974, equations (24) and (33), whose other radius, along the edge, no cylinder changes).
fn spreading(out: &EdgeRay, back: &EdgeRay, aspect: &Aspect) -> f64 {
    let length_m = out.length_m + back.length_m;
    (aspect.distance_m * length_m / (out.width_m * back.width_m)).sqrt()
}

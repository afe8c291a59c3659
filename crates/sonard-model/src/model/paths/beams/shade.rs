//! Shadows of cylinders in beams.

use std::f64::consts::TAU;

use smallvec::{SmallVec, smallvec};

use super::{
    beam::{RayBeam, reaches_well},
    lit::LitCylinder,
};
use crate::{
    geometry::{DVec2, signed_angle_rad},
    model::paths::floor::{AngleSpan, Cylinders, PlanCircle, SurfaceArc},
};

/// Returns the parts of a beam that pass the cylinders in its triangle, from right to left. The
/// parts that the cylinders cut out go to `views`.
///
/// Invariant: the passing parts and the parts cut out by opaque cylinders together are the beam,
/// each of its rays in one of them. Ties go to both neighbours.
pub(crate) fn shade(
    cylinders: &Cylinders,
    beam: &RayBeam,
    views: &mut Vec<LitCylinder>,
) -> SmallVec<[RayBeam; 2]> {
    let mut left = smallvec![*beam];
    let mut arcs: SmallVec<[SurfaceArc; 4]> = cylinders.in_triangle(beam.triangle).into();
    // Of two circles that do not overlap, a ray first hits the one with the smaller power: the line
    // of equal power lies between them.
    let power = |arc: &SurfaceArc| cylinders.circles[arc.cylinder as usize].power(beam.image);
    arcs.sort_by(|a, b| power(a).total_cmp(&power(b)));
    for arc in &arcs {
        let circle = &cylinders.circles[arc.cylinder as usize];
        left = left.iter().flat_map(|beam| shade_by_arc(circle, beam, arc, views)).collect();
    }
    left
}

/// Returns the parts of a beam that pass an arc of a circle, from right to left.
fn shade_by_arc(
    circle: &PlanCircle,
    beam: &RayBeam,
    arc: &SurfaceArc,
    views: &mut Vec<LitCylinder>,
) -> SmallVec<[RayBeam; 2]> {
    let Some(lit) = lit_by(circle, beam) else { return smallvec![*beam] };
    let mut passing = SmallVec::new();
    let mut rest = *beam;
    // From right to left, angles on the circle decrease.
    for span in lit.common(&arc.span).into_iter().rev() {
        let [mut left, mut right] =
            [span.from_rad, span.to_rad].map(|at| circle.point(at) - beam.image);
        // At the ends of the illuminated part, the beam's own borders are exact where they are
        // within a tie.
        if span.to_rad == lit.to_rad && !reaches_well(beam.right, right) {
            right = beam.right;
        }
        if span.from_rad == lit.from_rad && !reaches_well(left, beam.left) {
            left = beam.left;
        }
        if !reaches_well(right, left) {
            continue;
        }
        let beam = RayBeam { right, left, ..rest };
        views.push(LitCylinder { cylinder: arc.cylinder, span, beam });
        if circle.is_opaque {
            if reaches_well(rest.right, right) {
                passing.push(RayBeam { left: right, ..rest });
            }
            rest.right = left;
        }
    }
    if reaches_well(rest.right, rest.left) {
        passing.push(rest);
    }
    passing
}

/// Part of a circle that a beam illuminates, regardless of the beam's triangle.
///
/// By the law of sines a ray at `off` from the axis (image to centre, at distance `d`) hits the
/// circle of radius `r` at `off - asin(d sin off / r)` around the centre from the image's
/// direction.
fn lit_by(circle: &PlanCircle, beam: &RayBeam) -> Option<AngleSpan> {
    let to_image = beam.image - circle.center;
    let sine = circle.radius_m / to_image.length();
    if sine >= 1.0 {
        return None;
    }
    let tangent_rad = sine.asin();
    let off_axis = |border: DVec2| signed_angle_rad(-to_image, border);
    let (mut right, mut left) = (off_axis(beam.right), off_axis(beam.left));
    if right > left {
        // The beam contains the direction away from the circle, and at most one side of the circle.
        if left > -tangent_rad { right -= TAU } else { left += TAU }
    }
    if right >= tangent_rad || left <= -tangent_rad {
        return None;
    }
    // A ray off the axis to the left hits the circle on the clockwise side of the image.
    let around_rad = |off: f64| {
        let off = off.clamp(-tangent_rad, tangent_rad);
        off - (off.sin() / sine).clamp(-1.0, 1.0).asin()
    };
    let middle = to_image.to_angle();
    Some(AngleSpan { from_rad: middle + around_rad(left), to_rad: middle + around_rad(right) })
}

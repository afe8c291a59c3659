//! Stationary contact of two half-paths.
//!
//! Along a surface the length of a half-path is convex: `L'' = r cos i + r^2 cos^2 i / R`. The sum
//! of two is stationary at one angle at most (Fermat: there the reflection is specular), and
//! Newton's method finds it.

use super::{
    contact::Contact,
    half_path::{HalfPath, HalfPathTracer},
    root::{End, cubic, zero_between, zero_near},
};
use crate::{geometry::wrap_pi, model::paths::tolerance::TIE_M};

/// Tolerance by which two ranges of slopes may miss each other.
pub(crate) const SLACK: f64 = 1e-9;

/// Maximum number of Newton steps; four are usual.
const MAX_STEPS: usize = 40;

/// Agreement of both half-paths at which a contact counts as found, radians.
const SAME_ANGLE_RAD: f64 = 1e-11;

/// Angles around a cylinder that two half-paths both reach.
pub(crate) struct AngleOverlap {
    /// Middle angle of each half-path.
    middles: [f64; 2],
    /// Whole turns from the second half-path's angles to those of the first.
    turn: f64,
    low: f64,
    high: f64,
}

/// Returns the angles that two half-paths with these ends both reach, if any.
pub(crate) fn overlap(a: &[Contact; 2], b: &[Contact; 2]) -> Option<AngleOverlap> {
    let middles = [a, b].map(|[from, to]| 0.5 * (from.angle_rad + to.angle_rad));
    let [middle, others] = middles;
    let turn = middle + wrap_pi(others - middle) - others;
    let low = a[0].angle_rad.max(b[0].angle_rad + turn);
    let high = a[1].angle_rad.min(b[1].angle_rad + turn);
    (high >= low).then_some(AngleOverlap { middles, turn, low, high })
}

/// Finds the mirror reflection between two half-paths: the contact of each, and the angle around
/// the cylinder. `None` if there is none.
///
/// At this angle the slopes (`sin i`) of both add up to 0. Each step approximates both half-paths
/// as parabolas in the angle, with the slope's derivative `cos i + r cos^2 i g / w`, and moves each
/// to the angle where the parabolas cancel. Invariant: the angle stays between `low` and `high`,
/// which both half-paths reach.
pub(crate) fn stationary_contact(
    first: &HalfPathTracer,
    second: &HalfPathTracer,
    radius_m: f64,
) -> Option<([Contact; 2], f64)> {
    let [a, b] = [&first.half_path.ends, &second.half_path.ends];
    let AngleOverlap { middles: [middle, others], turn, low, high } = overlap(a, b)?;
    // Cubics through the ends as initial guess.
    let sum = |angle: f64| {
        let ((t, derivative), (u, other_derivative)) =
            (slope_near(a, angle, radius_m), slope_near(b, angle - turn, radius_m));
        End { at: angle, value: t + u, slope: derivative + other_derivative }
    };
    let start = zero_near([sum(low), sum(high)]).max(low).min(high);
    let mut at = [guess(a, start), guess(b, start - turn)];
    for _ in 0..MAX_STEPS {
        let p = first.contact(at[0], middle);
        let mut q = second.contact(at[1], others);
        q.angle_rad += turn;
        let derivatives = [&p, &q].map(|contact| slope_derivative(contact, radius_m));
        let sum = derivatives[0] * p.angle_rad + derivatives[1] * q.angle_rad - p.slope - q.slope;
        let best = sum / (derivatives[0] + derivatives[1]);
        let angle = best.max(low).min(high);
        let miss = (angle - p.angle_rad).abs().max((angle - q.angle_rad).abs());
        if miss < SAME_ANGLE_RAD {
            let is_inside = (best - angle).abs() * radius_m <= TIE_M;
            return is_inside.then_some(([p, q], angle));
        }
        at[0] = step(first.half_path, &p, angle);
        at[1] = step(second.half_path, &q, angle);
    }
    within(first, second, [low, high], [middle, others, turn], radius_m)
}

/// Finds the stationary contact by bracketed steps between `low` and `high`, for the few angles
/// between which Newton's steps oscillate.
fn within(
    first: &HalfPathTracer,
    second: &HalfPathTracer,
    [low, high]: [f64; 2],
    [middle, others, turn]: [f64; 3],
    radius_m: f64,
) -> Option<([Contact; 2], f64)> {
    let at = |angle: f64| {
        let p = first.contact_at(angle, middle);
        let mut q = second.contact_at(angle - turn, others);
        q.angle_rad += turn;
        [p, q]
    };
    let sum = |angle: f64| {
        let [p, q] = at(angle);
        let slope = slope_derivative(&p, radius_m) + slope_derivative(&q, radius_m);
        End { at: angle, value: p.slope + q.slope, slope }
    };
    let ends = [low, high].map(sum);
    if ends[0].value > SLACK || ends[1].value < -SLACK {
        return None;
    }
    let angle = zero_between(ends, SAME_ANGLE_RAD, |angle| {
        let End { value, slope, .. } = sum(angle);
        (value, slope)
    });
    Some((at(angle), angle))
}

/// Derivative of a contact's slope with respect to the angle around a cylinder.
fn slope_derivative(contact: &Contact, radius_m: f64) -> f64 {
    let Contact { cosine, growth, width_m, .. } = contact;
    cosine + radius_m * cosine * cosine * growth / width_m
}

/// Approximate slope of a half-path at an angle, and its derivative.
fn slope_near(ends: &[Contact; 2], angle: f64, radius_m: f64) -> (f64, f64) {
    let [from, to] = ends;
    let derivatives = ends.each_ref().map(|end| slope_derivative(end, radius_m));
    let share = (angle - from.angle_rad) / (to.angle_rad - from.angle_rad);
    let slopes = [from.slope, to.slope];
    let slope = cubic([from.angle_rad, to.angle_rad], slopes, derivatives, angle);
    (slope, derivatives[0] + share * (derivatives[1] - derivatives[0]))
}

/// Approximate contact with the first cylinder of the ray to an angle.
fn guess(ends: &[Contact; 2], angle: f64) -> f64 {
    let [from, to] = ends;
    let angles = [from.angle_rad, to.angle_rad];
    let (values, derivatives) =
        ([from.at_rad, to.at_rad], [from, to].map(|end| end.angle_derivative.recip()));
    let near = cubic(angles, values, derivatives, angle);
    let [low, high] = [from.at_rad.min(to.at_rad), from.at_rad.max(to.at_rad)];
    if low <= near && near <= high {
        return near;
    }
    let share = (angle - from.angle_rad) / (to.angle_rad - from.angle_rad);
    from.at_rad + share.clamp(0.0, 1.0) * (to.at_rad - from.at_rad)
}

/// Improves the contact with the first cylinder by one step from a ray nearby.
fn step(half_path: &HalfPath, contact: &Contact, angle_rad: f64) -> f64 {
    let next = contact.at_rad + (angle_rad - contact.angle_rad) / contact.angle_derivative;
    next.max(half_path.span.from_rad).min(half_path.span.to_rad)
}

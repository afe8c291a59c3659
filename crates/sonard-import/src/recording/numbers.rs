//! Numbers as they were written, before they came through four bytes or were turned back and forth.

/// The shortest number that is this one in four bytes: what was written before it became one.
pub(super) fn as_written(number: f32) -> f64 {
    number.to_string().parse().unwrap_or_else(|_| f64::from(number))
}

/// Degrees of an angle that came through four bytes.
pub(super) fn plain_deg(angle_rad: f64) -> f64 {
    (angle_rad.to_degrees() * 1e4).round() / 1e4
}

/// Without the last digits that turning back and forth leaves.
pub(super) fn billionths(number: f64) -> f64 {
    (number * 1e9).round() / 1e9 + 0.0
}

//! Removal of the rounding errors of single precision and of rotations.

/// Returns the shortest decimal number that has this single-precision value, probably the original
/// one.
pub(super) fn as_written(number: f32) -> f64 {
    number.to_string().parse().unwrap_or_else(|_| f64::from(number))
}

/// Converts an angle of single precision to degrees, rounded accordingly.
pub(super) fn plain_deg(angle_rad: f64) -> f64 {
    (angle_rad.to_degrees() * 1e4).round() / 1e4
}

/// Rounds to billionths, to remove rounding errors of rotations.
pub(super) fn billionths(number: f64) -> f64 {
    (number * 1e9).round() / 1e9 + 0.0
}

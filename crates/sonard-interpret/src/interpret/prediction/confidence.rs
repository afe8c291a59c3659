//! Confidences and how they combine.

/// Confidence of a reading that a feature contradicts which it should have heard: the closer to
/// perpendicular, the less. `part` is the angle from the feature's normal over `omega`, 0 to 1;
/// the result is 0.25 to 0.5.
#[must_use]
pub fn of_angle(part: f64) -> f64 {
    (1.0 + part.clamp(0.0, 1.0)) / 4.0
}

/// Confidence of a reading that a feature contradicts which it could not hear: the nearer the
/// feature, the more space behind it would wrongly be called free. `part` is the distance of the
/// feature over the range of the reading, 0 to 1; the result is 0 to 0.5.
#[must_use]
pub fn of_distance(part: f64, exponent: f64) -> f64 {
    part.clamp(0.0, 1.0).powf(exponent) / 2.0
}

/// Two confidences as one; 0.5 changes nothing.
#[must_use]
pub fn combine(one: f64, other: f64) -> f64 {
    let both = one * other;
    let neither = (1.0 - one) * (1.0 - other);
    if both + neither > 0.0 { both / (both + neither) } else { 0.5 }
}

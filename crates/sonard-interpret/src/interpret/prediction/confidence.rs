//! Confidences and their combination.

/// Confidence of a reading contradicted by a feature that it should have detected; lowest at the
/// perpendicular. `part` is the angle from the feature's normal over `omega`, 0 to 1;
/// the result is 0.25 to 0.5.
#[must_use]
pub fn confidence_by_angle(part: f64) -> f64 {
    (1.0 + part.clamp(0.0, 1.0)) / 4.0
}

/// Confidence of a reading contradicted by a feature that it could not detect; lower for nearer
/// features, behind which more space would wrongly be mapped as free. `part` is the distance of
/// the feature over the range of the reading, 0 to 1; the result is 0 to 0.5.
#[must_use]
pub fn confidence_by_distance(part: f64, exponent: f64) -> f64 {
    part.clamp(0.0, 1.0).powf(exponent) / 2.0
}

/// Combines two confidences by Bayes' rule; 0.5 is neutral.
#[must_use]
pub fn combine(a: f64, b: f64) -> f64 {
    let both = a * b;
    let neither = (1.0 - a) * (1.0 - b);
    if both + neither > 0.0 { both / (both + neither) } else { 0.5 }
}

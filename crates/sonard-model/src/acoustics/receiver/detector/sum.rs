//! Rules for the sum of overlapping pulses.

use num_complex::Complex64;

/// Rule by which overlapping pulses add up to an envelope.
pub(super) trait Summation {
    /// Envelope of the sum of complex amplitudes, which is amplified by `gain`, and noise.
    fn level(fields: impl Iterator<Item = Complex64>, gain: f64, noise: Complex64) -> f64;
}

/// Modulus without the overflow protection of [`Complex64::norm`], which costs as much as the rest
/// of the summation.
pub(super) fn modulus(number: Complex64) -> f64 {
    number.norm_sqr().sqrt()
}

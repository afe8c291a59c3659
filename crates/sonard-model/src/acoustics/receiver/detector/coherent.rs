//! Coherent sum: pulses of known phase.

use num_complex::Complex64;

use super::sum::{Summation, modulus};

/// Sum of fields with their phases.
pub(super) struct CoherentSum;

impl Summation for CoherentSum {
    #[inline]
    fn level(fields: impl Iterator<Item = Complex64>, gain: f64, noise: Complex64) -> f64 {
        modulus(fields.fold(Complex64::ZERO, |sum, field| sum + field) * gain + noise)
    }
}

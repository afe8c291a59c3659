//! Sum of powers: pulses of unknown phase.

use num_complex::Complex64;

use super::sum::{Summation, modulus};

/// Sum of the fields' powers, the average over their phases.
pub(super) struct PowerSum;

impl Summation for PowerSum {
    #[inline]
    fn level(fields: impl Iterator<Item = Complex64>, gain: f64, noise: Complex64) -> f64 {
        let level = fields.map(|field| field.norm_sqr()).sum::<f64>().sqrt() * gain;
        if noise == Complex64::ZERO { level } else { modulus(noise).hypot(level) }
    }
}

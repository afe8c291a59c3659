//! Time-of-flight noise: normal, with a longer tail towards far ranges.

use rand::{Rng, RngExt as _};
use rand_distr::{Distribution as _, Exp1, StandardNormal};

/// Random error of repeated readings of one echo.
///
/// Dudek, Jenkin, Milios and Wilkes (section 1) describe the error of a single echo as normal with
/// a far tail slightly longer than the near one. Here a random share of the readings is delayed by
/// an exponentially distributed time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TofNoise {
    /// Standard deviation of the normal part, microseconds.
    pub sigma_us: f64,
    /// Share of readings in the far tail, 0 to 1.
    pub tail_share: f64,
    /// Mean extra time of a reading in the tail, microseconds.
    pub tail_us: f64,
}

impl TofNoise {
    /// Noise-free time of flight.
    pub const NONE: Self = Self { sigma_us: 0.0, tail_share: 0.0, tail_us: 0.0 };

    /// Noise with a normal standard deviation of `sigma_mm` of range. One reading in ten is in the
    /// tail, whose mean is twice that value.
    #[must_use]
    pub fn from_range_sigma_mm(sigma_mm: f64, sound_speed_m_s: f64) -> Self {
        let sigma_us = 2.0 * sigma_mm * 1e3 / sound_speed_m_s;
        Self { sigma_us, tail_share: 0.1, tail_us: 2.0 * sigma_us }
    }

    /// Draws one error, microseconds.
    pub fn sample_us(&self, rng: &mut impl Rng) -> f64 {
        let normal: f64 = StandardNormal.sample(rng);
        // The tail is always drawn, so that the random sequence does not depend on the share.
        let tail: f64 = Exp1.sample(rng);
        let late = rng.random_bool(self.tail_share.clamp(0.0, 1.0));
        self.sigma_us * normal + if late { self.tail_us * tail } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng as _;
    use rand_pcg::Pcg64;

    #[test]
    fn far_tail_is_longer() {
        let noise = TofNoise::from_range_sigma_mm(1.0, 343.0);
        let mut rng = Pcg64::seed_from_u64(5);
        let errors: Vec<f64> = (0..200_000).map(|_| noise.sample_us(&mut rng)).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        // Only the tail shifts the mean, by its share times its mean.
        let expected = noise.tail_share * noise.tail_us;
        assert!((mean - expected).abs() < 0.05 * noise.sigma_us, "{mean} {expected}");
        let beyond = |sign: f64| {
            errors.iter().filter(|&&e| sign * (e - mean) > 3.0 * noise.sigma_us).count()
        };
        assert!(beyond(1.0) > 3 * beyond(-1.0), "{} {}", beyond(1.0), beyond(-1.0));
    }
}

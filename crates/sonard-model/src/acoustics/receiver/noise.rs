//! Receiver noise. Disabled by default; the caller supplies the random numbers.

use std::f64::consts::PI;

use num_complex::Complex64;
use rand::Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::characteristics::Receiver;
use crate::acoustics::{Sensor, pulse::filter_sigma_us};

/// Noise parameters of a receiver.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReceiverNoise {
    /// Root mean square of the noise envelope at the receiver's input, as the amplitude of an echo
    /// from 1 m. The gain raises it with range: it counts ten times as much at 10 m.
    pub floor: f64,
    /// Standard deviation of ECHO's time in addition to the effect of the noise floor,
    /// microseconds.
    pub jitter_us: f64,
}

impl ReceiverNoise {
    /// Receiver without noise and jitter.
    pub const NONE: Self = Self { floor: 0.0, jitter_us: 0.0 };

    /// Draws the noise of one firing.
    pub(super) fn track(&self, receiver: &Receiver, rng: &mut impl Rng) -> NoiseTrack {
        let spacing_us = receiver.noise_sigma_us;
        let count = (receiver.window_us() / spacing_us) as usize + 2 * NoiseTrack::REACH;
        // A sum of Gaussians one standard deviation apart, each of random phase and strength, has
        // the mean square sum(exp(-n^2)) = sqrt(pi) of theirs.
        let scale = self.floor / (2.0 * PI.sqrt()).sqrt();
        let draw = |_| {
            let (re, im): (f64, f64) = (StandardNormal.sample(rng), StandardNormal.sample(rng));
            scale * Complex64::new(re, im)
        };
        let first_us = -(NoiseTrack::REACH as f64) * spacing_us;
        let half_m_per_us = 0.5e-6 * receiver.sound_speed_m_s;
        NoiseTrack { grains: (0..count).map(draw).collect(), first_us, spacing_us, half_m_per_us }
    }

    pub(super) fn jitter(&self, rng: &mut impl Rng) -> f64 {
        let normal: f64 = StandardNormal.sample(rng);
        self.jitter_us * normal
    }
}

/// White noise after the band filter, over one firing.
pub(super) struct NoiseTrack {
    grains: Vec<Complex64>,
    first_us: f64,
    spacing_us: f64,
    half_m_per_us: f64,
}

impl NoiseTrack {
    /// Grains farther away than this many spacings contribute less than 1e-5.
    const REACH: usize = 5;

    /// Noise envelope at a time after firing, after the gain that compensates spreading.
    pub(super) fn at(&self, t_us: f64) -> Complex64 {
        let place = (t_us - self.first_us) / self.spacing_us;
        let middle = place.round().max(0.0) as usize;
        let near = middle.saturating_sub(Self::REACH)..=middle + Self::REACH;
        let sum: Complex64 = near
            .filter_map(|i| {
                let off = place - i as f64;
                Some((-0.5 * off * off).exp() * self.grains.get(i)?)
            })
            .sum();
        sum * (self.half_m_per_us * t_us)
    }
}

/// Standard deviation of the receiver's impulse response, microseconds.
pub(super) fn sigma_us(sensor: &Sensor) -> f64 {
    filter_sigma_us(sensor.pulse.bandwidth_hz())
}

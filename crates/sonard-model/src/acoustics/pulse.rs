//! Envelope of an echo: the transmit pulse filtered by transducer and receiver.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use num_complex::Complex64;

use super::{Pulse, Sensor};

/// Complex envelope of an isolated echo versus time. The echo is the real part of `envelope * exp(i
/// omega t)` at the carrier; the maximum modulus is 1.
///
/// Time 0 is the nominal time of flight: the onset of a burst, the centre of a Gaussian pulse. The
/// band filter has no delay, so an echo begins slightly earlier. The receiver corrects ranges for
/// this lead.
#[derive(Debug, Clone, PartialEq)]
pub struct EchoShape {
    first_us: f64,
    step_us: f64,
    steps_per_us: f64,
    samples: Vec<Complex64>,
    /// For a real envelope: each sample and the increment to the next; empty for a complex
    /// envelope.
    real: Vec<[f64; 2]>,
    /// For levels in steps of 1/[`RISE_LEVELS`] of the peak: number of samples before the modulus
    /// first reaches the level.
    rises: Vec<u32>,
    /// Maximum modulus up to each sample, and from each sample on.
    so_far: Vec<f64>,
    to_come: Vec<f64>,
    /// Maximum slope, per microsecond.
    steepest: f64,
}

/// Sample spacing, microseconds: 1/45 of a 7 kHz filter's standard deviation.
const STEP_US: f64 = 0.5;

/// Number whose neighbours differ by 1, so that a number of smaller magnitude added to it is
/// rounded to an integer, in its last bits: 1.5 times 2 to the power of 52.
const INTEGER_BITS: f64 = 6_755_399_441_055_744.0;

/// Number of tabulated levels of the rise.
const RISE_LEVELS: usize = 64;

/// Truncation of a Gaussian on each side, in standard deviations; `exp(-10)` is left at the end.
const SIGMAS_KEPT: f64 = 4.5;

/// Standard deviation in time, microseconds, of the impulse response of a Gaussian band filter of
/// standard deviation `bandwidth_hz`: `1 / (2 pi s)`.
#[must_use]
pub(super) fn filter_sigma_us(bandwidth_hz: f64) -> f64 {
    1e6 / (TAU * bandwidth_hz)
}

impl EchoShape {
    /// Echo on the axis of a sensor's transducer.
    ///
    /// A filtered burst is the difference of two error functions. A chirp, whose parts differ in
    /// frequency, is convolved with the filter numerically, with continuous phase across its parts.
    #[must_use]
    pub fn for_sensor(sensor: &Sensor) -> Self {
        match &sensor.pulse {
            Pulse::Burst { cycles, bandwidth_hz } => {
                let (length_us, sigma_us) =
                    (1e6 * cycles / sensor.frequency_hz, filter_sigma_us(*bandwidth_hz));
                let edge = |from_us: f64| {
                    libm::erf(from_us / filter_sigma_us(*bandwidth_hz) * FRAC_1_SQRT_2)
                };
                Self::tabulated(length_us, sigma_us, |t_us| {
                    Complex64::from(0.5 * (edge(t_us) - edge(t_us - length_us)))
                })
            }
            Pulse::Gaussian { sigma_us } => Self::tabulated(0.0, *sigma_us, |t_us| {
                Complex64::from((-0.5 * (t_us / sigma_us).powi(2)).exp())
            }),
            Pulse::Chirp { parts, bandwidth_hz } => {
                let chirp = Chirp::new(parts, sensor.frequency_hz);
                let sigma_us = filter_sigma_us(*bandwidth_hz);
                Self::tabulated(chirp.length_us(), sigma_us, |t_us| chirp.filtered(t_us, sigma_us))
            }
        }
    }

    /// Creates a shape from evenly spaced samples.
    #[must_use]
    pub(super) fn from_samples(first_us: f64, step_us: f64, samples: Vec<Complex64>) -> Self {
        let mut so_far: Vec<f64> = samples.iter().map(|sample| sample.norm()).collect();
        let mut to_come = so_far.clone();
        for i in 1..samples.len() {
            so_far[i] = so_far[i].max(so_far[i - 1]);
        }
        for i in (1..samples.len()).rev() {
            to_come[i - 1] = to_come[i - 1].max(to_come[i]);
        }
        let steps = samples.windows(2).map(|pair| (pair[1] - pair[0]).norm());
        let steepest = steps.fold(0.0, f64::max) / step_us;
        let is_real = samples.iter().all(|sample| sample.im == 0.0);
        let steps = samples.windows(2).take_while(|_| is_real);
        let real = steps.map(|pair| [pair[0].re, pair[1].re - pair[0].re]).collect();
        let peak = so_far.last().copied().unwrap_or(0.0);
        let level = |at: usize| at as f64 / RISE_LEVELS as f64 * peak;
        let before = |at: usize| so_far.partition_point(|so_far| *so_far < level(at)) as u32;
        let rises = (0..=RISE_LEVELS).map(before).collect();
        Self {
            first_us,
            step_us,
            steps_per_us: step_us.recip(),
            samples,
            real,
            rises,
            so_far,
            to_come,
            steepest,
        }
    }

    fn tabulated(length_us: f64, sigma_us: f64, at: impl Fn(f64) -> Complex64) -> Self {
        let margin_us = SIGMAS_KEPT * sigma_us;
        let count = ((length_us + 2.0 * margin_us) / STEP_US).ceil() as usize + 1;
        let mut samples: Vec<Complex64> =
            (0..count).map(|i| at(i as f64 * STEP_US - margin_us)).collect();
        let peak = samples.iter().map(|sample| sample.norm()).fold(0.0, f64::max);
        for sample in &mut samples {
            *sample /= peak;
        }
        Self::from_samples(-margin_us, STEP_US, samples)
    }

    /// Complex envelope at a time, microseconds.
    #[must_use]
    #[inline]
    pub fn at(&self, t_us: f64) -> Complex64 {
        let place = (t_us - self.first_us) * self.steps_per_us;
        if place < 0.0 || place >= (self.samples.len() - 1) as f64 {
            return Complex64::ZERO;
        }
        let below = place as usize;
        let part = place - below as f64;
        let (low, high) = (self.samples[below], self.samples[below + 1]);
        low + part * (high - low)
    }

    /// Returns `true` if the envelope is real: its phase is that of the carrier.
    #[must_use]
    pub(super) fn is_real(&self) -> bool {
        !self.real.is_empty()
    }

    /// Envelope at a time, microseconds, if the shape [is real](Self::is_real).
    #[must_use]
    #[inline]
    pub(super) fn real_at(&self, t_us: f64) -> f64 {
        let place = (t_us - self.first_us) * self.steps_per_us;
        // The last bits of `shifted` are the integer below `place`: a conversion takes more
        // instructions than all other arithmetic here.
        let shifted = place - 0.5 + INTEGER_BITS;
        let below = shifted.to_bits().wrapping_sub(INTEGER_BITS.to_bits());
        match self.real.get(below as usize) {
            Some([low, step]) if place >= 0.0 => low + (place - (shifted - INTEGER_BITS)) * step,
            _ => 0.0,
        }
    }

    /// Start of the echo, microseconds.
    #[must_use]
    pub fn first_us(&self) -> f64 {
        self.first_us
    }

    /// End of the echo, microseconds.
    #[must_use]
    pub fn last_us(&self) -> f64 {
        self.first_us + self.step_us * (self.samples.len() - 1) as f64
    }

    /// Maximum modulus of the envelope.
    #[must_use]
    pub fn peak(&self) -> f64 {
        self.so_far.last().copied().unwrap_or(0.0)
    }

    /// Maximum slope of the envelope, per microsecond.
    #[must_use]
    pub fn max_slope(&self) -> f64 {
        self.steepest
    }

    /// Maximum modulus up to a time.
    #[must_use]
    pub fn max_until(&self, t_us: f64) -> f64 {
        let place = (t_us - self.first_us) / self.step_us;
        if place < 0.0 {
            return 0.0;
        }
        self.so_far.get(place as usize + 1).copied().unwrap_or_else(|| self.peak())
    }

    /// Time of the first crossing of `level` by the modulus, microseconds; `None` if there is none.
    #[must_use]
    pub fn rise_us(&self, level: f64) -> Option<f64> {
        let above = self.before_rise(level);
        let high = *self.so_far.get(above)?;
        let low = if above == 0 { return Some(self.first_us) } else { self.so_far[above - 1] };
        Some(self.first_us + self.step_us * (above as f64 - (high - level) / (high - low)))
    }

    /// Number of samples before the modulus first reaches `level`.
    fn before_rise(&self, level: f64) -> usize {
        // The table brackets the level: a level between two tabulated ones is crossed between
        // theirs.
        let place = (level / self.peak() * RISE_LEVELS as f64) as usize;
        let tabulated = |place: usize| self.rises.get(place).map(|at| *at as usize);
        // One step of margin to each side covers rounding of the level.
        let from = tabulated(place.saturating_sub(1)).unwrap_or(0);
        let to = tabulated(place + 2).unwrap_or(self.so_far.len());
        from + self.so_far[from..to].partition_point(|so_far| *so_far < level)
    }

    /// Time of the last crossing of `level` by the modulus, microseconds; `None` if there is none.
    #[must_use]
    pub fn fall_us(&self, level: f64) -> Option<f64> {
        let below = self.to_come.partition_point(|to_come| *to_come >= level);
        let above = below.checked_sub(1)?;
        let high = self.to_come[above];
        let low = self.to_come.get(below).copied().unwrap_or(0.0);
        let part = if high > low { (high - level) / (high - low) } else { 0.0 };
        Some(self.first_us + self.step_us * (above as f64 + part))
    }

    /// Maximum modulus from a time on; the inverse of [`fall_us`](Self::fall_us).
    #[must_use]
    pub fn max_from(&self, t_us: f64) -> f64 {
        let place = (t_us - self.first_us) / self.step_us;
        if place < 0.0 {
            return self.peak();
        }
        let below = place as usize;
        let Some(&low) = self.to_come.get(below) else { return 0.0 };
        let high = self.to_come.get(below + 1).copied().unwrap_or(0.0);
        low + (place - below as f64) * (high - low)
    }

    /// Samples with their times, microseconds.
    pub(super) fn samples(&self) -> impl Iterator<Item = (f64, Complex64)> {
        self.samples
            .iter()
            .enumerate()
            .map(|(i, sample)| (self.first_us + self.step_us * i as f64, *sample))
    }

    pub(super) fn step_us(&self) -> f64 {
        self.step_us
    }
}

/// Bursts of several frequencies with continuous phase.
struct Chirp {
    /// Start, end (microseconds), frequency offset from the carrier (cycles per microsecond), phase
    /// at the start (cycles).
    parts: Vec<(f64, f64, f64, f64)>,
}

impl Chirp {
    fn new(parts: &[super::ChirpPart], carrier_hz: f64) -> Self {
        let (mut from_us, mut phase) = (0.0, 0.0);
        let parts = parts
            .iter()
            .map(|part| {
                let length_us = 1e6 * part.cycles / part.frequency_hz;
                let above = 1e-6 * (part.frequency_hz - carrier_hz);
                let placed = (from_us, from_us + length_us, above, phase);
                from_us += length_us;
                phase += above * length_us;
                placed
            })
            .collect();
        Self { parts }
    }

    fn length_us(&self) -> f64 {
        self.parts.last().map_or(0.0, |part| part.1)
    }

    fn at(&self, t_us: f64) -> Complex64 {
        let part = self.parts.iter().find(|part| (part.0..part.1).contains(&t_us));
        part.map_or(Complex64::ZERO, |(from_us, _, above, phase)| {
            Complex64::cis(TAU * (phase + above * (t_us - from_us)))
        })
    }

    /// Convolution with a Gaussian of unit area.
    fn filtered(&self, t_us: f64, sigma_us: f64) -> Complex64 {
        let count = 720;
        let step = 2.0 * SIGMAS_KEPT / f64::from(count);
        let weight = |z: f64| (-0.5 * z * z).exp() * step / TAU.sqrt();
        (0..=count)
            .map(|i| f64::from(i) * step - SIGMAS_KEPT)
            .map(|z| weight(z) * self.at(t_us - z * sigma_us))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acoustics::ChirpPart;

    fn sensor(pulse: Pulse) -> Sensor {
        Sensor { pulse, ..Sensor::preset("senscomp-6500").expect("a preset") }
    }

    const BURST: Pulse = Pulse::Burst { cycles: 16.0, bandwidth_hz: 7000.0 };

    /// Full-wave reference: a head-on wall crosses 0.02 of its peak 8.0 mm of range early, 0.05 at
    /// 6.36 mm and 0.1 at 4.94 mm (tests/data/fullwave, `onset_lead_m`).
    #[test]
    fn burst_rise_matches_full_wave() {
        let shape = EchoShape::for_sensor(&sensor(BURST));
        for (level, lead_mm) in [(0.02, 8.00), (0.05, 6.36), (0.1, 4.94)] {
            let rise_us = shape.rise_us(level).expect("it gets there");
            // The reference's band ends 20 kHz off the carrier, and its samples are 2 us (0.34 mm)
            // apart.
            assert!((rise_us * 343.2e-3 / 2.0 + lead_mm).abs() < 0.1, "{level}: {rise_us}");
            let fall_us = shape.fall_us(level).expect("it gets there");
            // Symmetric about the middle.
            assert!((rise_us + fall_us - 16e6 / 49.4e3).abs() < 0.01, "{level}");
        }
        assert!((shape.at(0.0).norm() - 0.5).abs() < 1e-6, "half way up at the onset");
        assert!(shape.rise_us(1.01).is_none() && shape.fall_us(1.01).is_none());
        // The remaining maximum falls to each level when that level is crossed for the last time.
        for level in [0.02, 0.3, 0.99] {
            let fall_us = shape.fall_us(level).expect("it gets there");
            assert!((shape.max_from(fall_us) - level).abs() < 1e-9, "{level}");
        }
        assert_eq!((shape.max_from(-1e3), shape.max_from(1e4)), (1.0, 0.0));
    }

    #[test]
    fn single_tone_chirp_is_a_burst() {
        let parts = vec![
            ChirpPart { cycles: 6.0, frequency_hz: 49.4e3 },
            ChirpPart { cycles: 10.0, frequency_hz: 49.4e3 },
        ];
        let chirp = EchoShape::for_sensor(&sensor(Pulse::Chirp { parts, bandwidth_hz: 7000.0 }));
        let burst = EchoShape::for_sensor(&sensor(BURST));
        for i in -80..400 {
            let t_us = f64::from(i);
            assert!((chirp.at(t_us) - burst.at(t_us)).norm() < 6e-3, "{t_us}");
        }
    }

    /// The phase advances with the frequency offset from the carrier, and the filter attenuates by
    /// `exp(-(f - f0)^2 / (2 s^2))`.
    #[test]
    fn off_carrier_part_is_attenuated() {
        let part = |frequency_hz: f64| ChirpPart { cycles: 40.0, frequency_hz };
        let shape =
            |parts| EchoShape::for_sensor(&sensor(Pulse::Chirp { parts, bandwidth_hz: 7000.0 }));
        let both = shape(vec![part(49.4e3), part(56.4e3)]);
        let [early, late] = [both.at(400.0), both.at(1200.0)];
        assert!((late.norm() / early.norm() - (-0.5_f64).exp()).abs() < 1e-3);
        let turned = (both.at(1210.0) / late).arg();
        assert!((turned - TAU * 7e3 * 10e-6).abs() < 1e-3, "{turned}");
    }
}

//! The transducer's face: how strong a sound leaves or arrives at an angle to its axis.

use std::{
    cell::RefCell,
    collections::VecDeque,
    f64::consts::{FRAC_PI_2, PI, TAU},
    sync::Arc,
};

use num_complex::Complex64;

use super::{Aperture, EchoShape, Pulse, Sensor, aperture::points, sensor::level_at};

/// Table spacing: 0.05 degrees. For a 19 mm face at 50 kHz a straight line between entries errs by
/// less than 2e-5 in the main lobe, and by less than 4e-4 where a side lobe's steady part overtakes
/// the transient and the pattern has a kink (there is a test).
const STEP_RAD: f64 = FRAC_PI_2 / 1800.0;

/// Entries from the axis to straight backwards.
const TABLE_LENGTH: usize = 3601;

/// One-way amplitude against the angle from the axis, 1 on the axis and 0 behind the face.
#[derive(Debug, Clone)]
pub struct BeamPattern(Shape);

#[derive(Debug, Clone)]
enum Shape {
    /// The face's response to the pulse, from 0 degrees to straight backwards.
    Table(Arc<[f64]>),
    /// `exp(-2 theta^2 / half_angle^2)`.
    Gaussian { half_angle_rad: f64 },
}

/// What a pattern follows from.
#[derive(Debug, Clone, PartialEq)]
struct Origin {
    aperture: Aperture,
    pulse: Pulse,
    frequency_hz: f64,
    sound_speed_m_s: f64,
}

/// How many patterns a thread remembers.
const REMEMBERED: usize = 4;

thread_local! {
    /// The patterns that were asked for last. A fit asks for those of the same few apertures hundreds of times while
    /// thresholds and poses change, and a table takes a millisecond or two.
    static REMEMBERED_PATTERNS: RefCell<VecDeque<(Origin, BeamPattern)>> = const { RefCell::new(VecDeque::new()) };
}

impl BeamPattern {
    /// The pattern of a sensor at a speed of sound in metres a second.
    ///
    /// A disc answers with Kuc and Siegel's impulse response convolved with the sensor's pulse:
    /// the peak of the envelope, relative to the axis. For a long pulse that is the piston's
    /// [`piston_directivity`] times `cos(theta)`; a short one fills the nulls.
    #[must_use]
    pub fn new(sensor: &Sensor, sound_speed_m_s: f64) -> Self {
        let origin = Origin {
            aperture: sensor.aperture.clone(),
            pulse: sensor.pulse.clone(),
            frequency_hz: sensor.frequency_hz,
            sound_speed_m_s,
        };
        REMEMBERED_PATTERNS.with_borrow_mut(|known| {
            if let Some((_, pattern)) = known.iter().find(|(of, _)| *of == origin) {
                return pattern.clone();
            }
            let pattern = Self::tabulated(sensor, sound_speed_m_s);
            known.truncate(REMEMBERED - 1);
            known.push_front((origin, pattern.clone()));
            pattern
        })
    }

    fn tabulated(sensor: &Sensor, sound_speed_m_s: f64) -> Self {
        let tabulated = |level: &dyn Fn(f64) -> f64| {
            let mut table: Vec<f64> = (0..TABLE_LENGTH)
                .map(|i| i as f64 * STEP_RAD)
                .take_while(|theta_rad| sensor.aperture.obliquity(*theta_rad) > 1e-12)
                .map(level)
                .collect();
            table.push(0.0);
            Shape::Table(table.into())
        };
        Self(match sensor.aperture {
            Aperture::Piston { .. } | Aperture::Line { .. } => {
                let face = Face::new(sensor, sound_speed_m_s);
                tabulated(&|theta_rad| face.peak(theta_rad))
            }
            Aperture::Table { ref points, .. } => {
                tabulated(&|theta_rad| level_at(points, theta_rad))
            }
            Aperture::Gaussian { half_angle_deg, .. } => {
                Shape::Gaussian { half_angle_rad: half_angle_deg.to_radians() }
            }
        })
    }

    /// Amplitude at an angle from the axis, radians from -pi to pi, relative to the axis.
    #[must_use]
    pub fn one_way(&self, theta_rad: f64) -> f64 {
        let theta_rad = theta_rad.abs();
        match &self.0 {
            Shape::Table(table) => {
                let place = theta_rad * (1.0 / STEP_RAD);
                let below = place as usize;
                let (Some(low), Some(high)) = (table.get(below), table.get(below + 1)) else {
                    return 0.0;
                };
                low + (place - below as f64) * (high - low)
            }
            Shape::Gaussian { .. } if theta_rad >= FRAC_PI_2 => 0.0,
            Shape::Gaussian { half_angle_rad } => {
                (-2.0 * (theta_rad / half_angle_rad).powi(2)).exp()
            }
        }
    }

    /// Integral over the angle of the two-way power, the pattern's fourth power, radians: how
    /// wide a strip of a surface that scatters counts as fully in the beam.
    #[must_use]
    pub fn two_way_power_rad(&self) -> f64 {
        const STEPS: usize = 1800;
        let step_rad = FRAC_PI_2 / STEPS as f64;
        let power = |i: usize| self.one_way(i as f64 * step_rad).powi(4);
        2.0 * step_rad * (0.5 + (1..STEPS).map(power).sum::<f64>())
    }

    /// The least angle from the axis, radians, at which the one-way amplitude is down to `level`
    /// (between 0 and 1); 90 degrees if it never is.
    #[must_use]
    pub fn angle_at(&self, level: f64) -> f64 {
        match &self.0 {
            Shape::Table(table) => {
                let falls = |pair: &[f64]| pair[1] <= level;
                let Some(at) = table.windows(2).position(falls) else { return FRAC_PI_2 };
                // Between entries the pattern is the straight line that `one_way` draws.
                let [low, high] = [table[at], table[at + 1]];
                let part = if low > high { ((low - level) / (low - high)).max(0.0) } else { 0.0 };
                ((at as f64 + part) * STEP_RAD).min(FRAC_PI_2)
            }
            Shape::Gaussian { half_angle_rad } => {
                (half_angle_rad * (-level.min(1.0).ln() / 2.0).sqrt()).min(FRAC_PI_2)
            }
        }
    }
}

/// Far-field amplitude of a circular piston in a baffle at one frequency, relative to its axis:
/// `2 J1(x)/x` with `x = k a sin(theta)`; negative in every other side lobe.
///
/// Morse and Ingard, Theoretical Acoustics, equation (7.4.17); ranges well beyond `a^2/lambda`.
#[must_use]
pub fn piston_directivity(ka: f64, theta_rad: f64) -> f64 {
    let x = ka * theta_rad.sin();
    if x.abs() < 1e-6 { 1.0 } else { 2.0 * libm::j1(x) / x }
}

/// Impulse response, 1/s, of a disc of radius `radius_m` to a plane wave at `theta_rad` from its
/// axis, at `delay_s` after the wave passes the disc's centre.
///
/// Kuc and Siegel, "Physically based simulation model for acoustic sensor robot navigation",
/// IEEE PAMI 9 (1987), as equation (1) of Dudek, Jenkin, Milios and Wilkes, with `t - 2z/c` as
/// the delay. Its integral is `cos(theta)`; at 0 it is a unit impulse, which has no value here.
/// Valid beyond `a^2/lambda`, `0 < |theta| <= pi/2`.
#[must_use]
pub fn kuc_siegel_response(
    delay_s: f64,
    radius_m: f64,
    theta_rad: f64,
    sound_speed_m_s: f64,
) -> f64 {
    let half_span_s = radius_m * theta_rad.sin().abs() / sound_speed_m_s;
    let place = delay_s / half_span_s;
    if place.abs() >= 1.0 {
        return 0.0;
    }
    2.0 * theta_rad.cos() / (PI * half_span_s) * (1.0 - place * place).sqrt()
}

/// A face that meets a pulse.
struct Face {
    aperture: Aperture,
    /// Radians a second.
    omega: f64,
    sound_speed_m_s: f64,
    /// `k a` of the face's half width.
    ka: f64,
    pulse: EchoShape,
    /// About which the pulse is even, if it is, microseconds.
    middle_us: Option<f64>,
}

/// Spacing at which the peak is looked for, microseconds.
const SEARCH_US: f64 = 6.0;

impl Face {
    fn new(sensor: &Sensor, sound_speed_m_s: f64) -> Self {
        let omega = TAU * sensor.frequency_hz;
        let ka = omega / sound_speed_m_s * sensor.half_width_m();
        let (aperture, pulse) = (sensor.aperture.clone(), EchoShape::of(sensor));
        let middle_us = match sensor.pulse {
            Pulse::Burst { .. } => Some(0.5e6 * sensor.pulse_s()),
            Pulse::Gaussian { .. } => Some(0.0),
            Pulse::Chirp { .. } => None,
        };
        Self { aperture, omega, sound_speed_m_s, ka, pulse, middle_us }
    }

    /// Peak over time of `|h * pulse|` at an angle, relative to the axis, with the skirts' power if there are any.
    fn peak(&self, theta_rad: f64) -> f64 {
        let alone = self.peak_of_face(theta_rad);
        let Aperture::Piston { skirts_db: Some(level_db), .. } = self.aperture else {
            return alone;
        };
        let skirts = 10f64.powf(level_db / 20.0) * self.aperture.obliquity(theta_rad);
        // Nothing is added on the axis.
        (alone * alone + (1.0 - alone * alone) * skirts * skirts).sqrt()
    }

    fn peak_of_face(&self, theta_rad: f64) -> f64 {
        let points = self.quadrature(theta_rad);
        let reach_us = points.iter().map(|point| point.0.abs()).fold(0.0, f64::max);
        // An even pulse has an even response: its first half will do.
        let first_us = self.pulse.first_us() - reach_us;
        let last_us = self.middle_us.unwrap_or_else(|| self.pulse.last_us() + reach_us);
        let steps = ((last_us - first_us) / SEARCH_US).ceil().max(2.0) as usize;
        let step_us = (last_us - first_us) / steps as f64;
        let at = |t_us: f64| self.magnitude(t_us.min(last_us), &points);
        let times: Vec<f64> = (0..=steps).map(|i| first_us + i as f64 * step_us).collect();
        let samples: Vec<f64> = times.iter().map(|&t_us| at(t_us)).collect();
        let highest_sample = samples.iter().copied().fold(0.0, f64::max);
        // Several peaks can be nearly as high: each that may be the highest is climbed.
        let peaks = (1..steps).filter(|&i| {
            samples[i] >= samples[i - 1].max(samples[i + 1]) && samples[i] > 0.8 * highest_sample
        });
        let peak = peaks.map(|i| highest(at, times[i - 1], times[i + 1])).fold(0.0, f64::max);
        // Rounding must not let any direction beat the axis.
        peak.max(highest_sample).min(1.0)
    }

    /// Delays (microseconds) and complex shares of the face's points.
    fn quadrature(&self, theta_rad: f64) -> Vec<(f64, Complex64)> {
        let sine = theta_rad.sin();
        // The phase runs over +-ka sin(theta); from half of that on, more points gain nothing
        // but the digits of the rest.
        let count = (0.5 * self.ka * sine).ceil() as usize + 14;
        let obliquity = self.aperture.obliquity(theta_rad);
        points(&self.aperture, count)
            .unwrap_or_default()
            .into_iter()
            .map(|(place_m, share)| {
                let delay_s = place_m * sine / self.sound_speed_m_s;
                (1e6 * delay_s, obliquity * share * Complex64::cis(-self.omega * delay_s))
            })
            .collect()
    }

    fn magnitude(&self, t_us: f64, points: &[(f64, Complex64)]) -> f64 {
        points
            .iter()
            .map(|(delay_us, share)| share * self.pulse.at(t_us - delay_us))
            .sum::<Complex64>()
            .norm()
    }
}

/// Maximum of a curve with one peak between two places, by golden section.
fn highest(curve: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const PART: f64 = 0.618_033_988_749_895;
    let mut left = high - PART * (high - low);
    let mut right = low + PART * (high - low);
    let (mut at_left, mut at_right) = (curve(left), curve(right));
    for _ in 0..8 {
        if at_left < at_right {
            (low, left, at_left) = (left, right, at_right);
            right = low + PART * (high - low);
            at_right = curve(right);
        } else {
            (high, right, at_right) = (right, left, at_left);
            left = high - PART * (high - low);
            at_left = curve(left);
        }
    }
    at_left.max(at_right)
}

#[cfg(test)]
mod tests;

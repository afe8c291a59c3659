//! The transducer's face: how strong a sound leaves or arrives at an angle to its axis.

mod face;

use std::{
    f64::consts::{FRAC_PI_2, PI, TAU},
    sync::Arc,
};

use self::face::FaceResponse;
use super::{Aperture, Sensor, sensor::level_at};

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

impl BeamPattern {
    /// The pattern of a sensor at a speed of sound in metres a second.
    ///
    /// A disc answers with Kuc and Siegel's impulse response convolved with the sensor's pulse:
    /// the peak of the envelope, relative to the axis. For a long pulse that is the piston's
    /// [`piston_directivity`] times `cos(theta)`; a short one fills the nulls.
    #[must_use]
    pub fn new(sensor: &Sensor, sound_speed_m_s: f64) -> Self {
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
                let ka = TAU * sensor.frequency_hz / sound_speed_m_s * sensor.half_width_m();
                let face = FaceResponse::of(sensor, ka);
                tabulated(&|theta_rad| {
                    let alone =
                        sensor.aperture.obliquity(theta_rad) * face.at(ka * theta_rad.sin().abs());
                    with_skirts(&sensor.aperture, alone, theta_rad)
                })
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

/// Amplitude at an angle of a face that has one alone, with the skirts' power if there are any.
fn with_skirts(aperture: &Aperture, alone: f64, theta_rad: f64) -> f64 {
    let Aperture::Piston { skirts_db: Some(level_db), .. } = *aperture else { return alone };
    let skirts = 10f64.powf(level_db / 20.0) * aperture.obliquity(theta_rad);
    // Nothing is added on the axis.
    (alone * alone + (1.0 - alone * alone) * skirts * skirts).sqrt()
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

#[cfg(test)]
mod tests;

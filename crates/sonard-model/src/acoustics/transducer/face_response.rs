//! Response of a face to its sensor's pulse: peak amplitude versus angle.
//!
//! A wave that leaves at an angle passes the face's points one after the other. The resulting
//! attenuation of a pulse depends only on its shape and the carrier phase from the centre of the
//! face to its rim, `k a sin(theta)`, not on face size or speed of sound separately. One table by
//! that phase therefore serves all faces of a shape, in any air.

use std::{cell::RefCell, collections::VecDeque, f64::consts::TAU, rc::Rc};

use num_complex::Complex64;

use crate::acoustics::{Aperture, EchoShape, Pulse, Sensor, aperture::points};

/// Peak of the pulse relative to the axis, without obliquity, tabulated by the phase at the rim.
pub(super) struct FaceResponse {
    step_rad: f64,
    /// Entries from 0 in steps of `step_rad`.
    table: Vec<f64>,
}

/// Spacing of the table: two thirds of the spacing of beam pattern entries near the axis of a 19 mm
/// face at 50 kHz.
const STEP_RAD: f64 = 0.01;

/// Maximum number of entries. The table of a face of tens of wavelengths has wider steps, which are
/// still a fraction of its beam pattern's.
const MAX_ENTRIES: f64 = 4000.0;

/// Cached responses per thread.
const CACHE_SIZE: usize = 4;

thread_local! {
    /// Most recently used responses with their keys, each up to the largest phase so far. A fit
    /// requests patterns for hundreds of speeds of sound and face sizes, and a table takes some ten
    /// milliseconds.
    static RESPONSE_CACHE: RefCell<VecDeque<(FaceKey, Rc<FaceResponse>)>> =
        const { RefCell::new(VecDeque::new()) };
}

impl FaceResponse {
    /// Response of a sensor's face to its pulse, up to a phase of at least `max_rad`; flat if the
    /// aperture is defined by its beam.
    pub(super) fn for_sensor(sensor: &Sensor, max_rad: f64) -> Rc<Self> {
        let step_rad =
            STEP_RAD * (max_rad / (MAX_ENTRIES * STEP_RAD)).log2().ceil().max(0.0).exp2();
        let face = FaceKey {
            aperture: unit_half_width(&sensor.aperture),
            pulse: sensor.pulse.clone(),
            frequency_hz: sensor.frequency_hz,
            step_rad,
        };
        RESPONSE_CACHE.with_borrow_mut(|cached| {
            let is_match =
                |(key, response): &&(FaceKey, Rc<Self>)| *key == face && response.reaches(max_rad);
            if let Some((_, response)) = cached.iter().find(is_match) {
                return Rc::clone(response);
            }
            cached.retain(|(key, _)| *key != face);
            let response =
                Rc::new(Self::tabulated(&PulsedFace::for_sensor(sensor), step_rad, max_rad));
            cached.truncate(CACHE_SIZE - 1);
            cached.push_front((face, Rc::clone(&response)));
            response
        })
    }

    fn tabulated(face: &PulsedFace, step_rad: f64, max_rad: f64) -> Self {
        // Cubic interpolation requires one entry beyond the next.
        let count = (max_rad / step_rad).ceil() as usize + 3;
        let on_axis = face.peak(0.0);
        let table = (0..count).map(|i| face.peak(i as f64 * step_rad) / on_axis).collect();
        Self { step_rad, table }
    }

    fn reaches(&self, rim_rad: f64) -> bool {
        rim_rad / self.step_rad <= (self.table.len() - 3) as f64
    }

    #[cfg(test)]
    pub(super) const fn entries(&self) -> usize {
        self.table.len()
    }

    /// Peak of the envelope for a phase at the rim, 0 to 1: cubic interpolation with two entries on
    /// each side.
    pub(super) fn at(&self, rim_rad: f64) -> f64 {
        let place = rim_rad / self.step_rad;
        let below = place as usize;
        let part = place - below as f64;
        // Symmetric about the axis.
        let before = if below == 0 { self.table[1] } else { self.table[below - 1] };
        let [low, high, after] = [0, 1, 2].map(|i| self.table[below + i]);
        let slope = 0.5 * (high - before);
        let bend = before - 2.5 * low + 2.0 * high - 0.5 * after;
        let twist = 0.5 * (after - before) + 1.5 * (low - high);
        // At a kink, where another part of the pulse becomes the maximum, the cubic overshoots.
        (low + part * (slope + part * (bend + part * twist))).clamp(0.0, 1.0)
    }
}

/// Cache key of a response.
#[derive(PartialEq)]
struct FaceKey {
    /// Shape of the face, from [`unit_half_width`].
    aperture: Aperture,
    pulse: Pulse,
    frequency_hz: f64,
    /// Spacing of the table.
    step_rad: f64,
}

/// Aperture with a half width of 1, without side-lobe floor and window.
fn unit_half_width(aperture: &Aperture) -> Aperture {
    let mut aperture = aperture.clone();
    match &mut aperture {
        Aperture::Piston { radius_m, skirts_db } => (*radius_m, *skirts_db) = (1.0, None),
        Aperture::Line { half_length_m, full_within_deg, none_beyond_deg } => {
            (*half_length_m, *full_within_deg, *none_beyond_deg) = (1.0, 90.0, 90.0);
        }
        Aperture::Gaussian { .. } | Aperture::Table { .. } => {}
    }
    aperture
}

/// Face of half width 1 with its incident pulse.
pub(super) struct PulsedFace {
    aperture: Aperture,
    /// Carrier, radians per microsecond.
    omega: f64,
    pulse: EchoShape,
    /// Centre of symmetry of the pulse, microseconds, if it is symmetric.
    middle_us: Option<f64>,
}

/// Initial sampling step of the peak search, microseconds.
const SEARCH_US: f64 = 6.0;

impl PulsedFace {
    pub(super) fn for_sensor(sensor: &Sensor) -> Self {
        let middle_us = match sensor.pulse {
            Pulse::Burst { .. } => Some(0.5e6 * sensor.pulse_s()),
            Pulse::Gaussian { .. } => Some(0.0),
            Pulse::Chirp { .. } => None,
        };
        let aperture = unit_half_width(&sensor.aperture);
        let omega = 1e-6 * TAU * sensor.frequency_hz;
        Self { aperture, omega, pulse: EchoShape::for_sensor(sensor), middle_us }
    }

    /// Peak over time of `|h * pulse|` for a phase at the rim, without the obliquity.
    pub(super) fn peak(&self, rim_rad: f64) -> f64 {
        let points = self.quadrature(rim_rad);
        let reach_us = points.iter().map(|point| point.0.abs()).fold(0.0, f64::max);
        // A symmetric pulse has a symmetric response: its first half suffices.
        let first_us = self.pulse.first_us() - reach_us;
        let last_us = self.middle_us.unwrap_or_else(|| self.pulse.last_us() + reach_us);
        let steps = ((last_us - first_us) / SEARCH_US).ceil().max(2.0) as usize;
        let step_us = (last_us - first_us) / steps as f64;
        let at = |t_us: f64| self.magnitude(t_us.min(last_us), &points);
        let times: Vec<f64> = (0..=steps).map(|i| first_us + i as f64 * step_us).collect();
        let samples: Vec<f64> = times.iter().map(|&t_us| at(t_us)).collect();
        let highest_sample = samples.iter().copied().fold(0.0, f64::max);
        // Several peaks can have nearly the same height: each candidate is refined.
        let peaks = (1..steps).filter(|&i| {
            samples[i] >= samples[i - 1].max(samples[i + 1]) && samples[i] > 0.8 * highest_sample
        });
        let peak = peaks.map(|i| highest(at, times[i - 1], times[i + 1])).fold(0.0, f64::max);
        peak.max(highest_sample)
    }

    /// Delays (microseconds) and complex weights of the face's points.
    fn quadrature(&self, rim_rad: f64) -> Vec<(f64, Complex64)> {
        // More than half of the phase in points adds no accuracy.
        let count = (0.5 * rim_rad).ceil() as usize + 14;
        let placed = |(place, share): (f64, f64)| {
            (place * rim_rad / self.omega, share * Complex64::cis(-place * rim_rad))
        };
        points(&self.aperture, count).unwrap_or_default().into_iter().map(placed).collect()
    }

    fn magnitude(&self, t_us: f64, points: &[(f64, Complex64)]) -> f64 {
        let part = |(delay_us, share): &(f64, Complex64)| share * self.pulse.at(t_us - delay_us);
        points.iter().map(part).sum::<Complex64>().norm()
    }
}

/// Maximum of a unimodal function on an interval, by golden-section search.
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

//! A face that meets its sensor's pulse: how strong the pulse leaves at an angle.
//!
//! A wave that leaves at an angle passes the face's points one after the other. How much that weakens a pulse is a matter
//! of its carrier's phase from the middle of the face to its rim, `k a sin(theta)`, and of nothing else: not of the size of the
//! face or the speed of sound by themselves. So one table by that phase serves all faces of a shape, in any air.

use std::{cell::RefCell, collections::VecDeque, f64::consts::TAU, rc::Rc};

use num_complex::Complex64;

use crate::acoustics::{Aperture, EchoShape, Pulse, Sensor, aperture::points};

/// What a lone face makes of a pulse by the phase to its rim, relative to the axis, as a table.
pub(super) struct FaceResponse {
    step_rad: f64,
    /// In such steps from 0.
    table: Vec<f64>,
}

/// Spacing of the table: two thirds of how far the entries of a beam pattern are apart near the axis of a 19 mm face at
/// 50 kHz.
const STEP_RAD: f64 = 0.01;

/// No table has more entries than these: that of a face of tens of wavelengths has wider steps, which
/// are still a fraction of its beam pattern's.
const ENTRIES: f64 = 4000.0;

/// How many responses a thread remembers.
const REMEMBERED: usize = 4;

thread_local! {
    /// The responses that were asked for last, each up to the largest phase so far, with what they follow from. A fit asks for patterns at hundreds of speeds of
    /// sound and sizes of the face, and a table takes some ten milliseconds.
    static REMEMBERED_RESPONSES: RefCell<VecDeque<(Face, Rc<FaceResponse>)>> = const { RefCell::new(VecDeque::new()) };
}

impl FaceResponse {
    /// Of a sensor's face to its pulse, up to a phase of `most_rad` at least; flat where the aperture is given by its beam.
    pub(super) fn of(sensor: &Sensor, most_rad: f64) -> Rc<Self> {
        let step_rad = STEP_RAD * (most_rad / (ENTRIES * STEP_RAD)).log2().ceil().max(0.0).exp2();
        let face = Face {
            aperture: of_width_one(&sensor.aperture),
            pulse: sensor.pulse.clone(),
            frequency_hz: sensor.frequency_hz,
            step_rad,
        };
        REMEMBERED_RESPONSES.with_borrow_mut(|known| {
            let serves =
                |(of, response): &&(Face, Rc<Self>)| *of == face && response.reaches(most_rad);
            if let Some((_, response)) = known.iter().find(serves) {
                return Rc::clone(response);
            }
            known.retain(|(of, _)| *of != face);
            let response = Rc::new(Self::tabulated(&MetFace::of(sensor), step_rad, most_rad));
            known.truncate(REMEMBERED - 1);
            known.push_front((face, Rc::clone(&response)));
            response
        })
    }

    fn tabulated(met: &MetFace, step_rad: f64, most_rad: f64) -> Self {
        // The cubic through four entries asks for one beyond the next.
        let count = (most_rad / step_rad).ceil() as usize + 3;
        let on_axis = met.peak(0.0);
        let table = (0..count).map(|i| met.peak(i as f64 * step_rad) / on_axis).collect();
        Self { step_rad, table }
    }

    fn reaches(&self, rim_rad: f64) -> bool {
        rim_rad / self.step_rad <= (self.table.len() - 3) as f64
    }

    #[cfg(test)]
    pub(super) const fn entries(&self) -> usize {
        self.table.len()
    }

    /// Peak of the envelope at a phase to the rim, 0 to 1: the cubic through the entries on both sides, two each.
    pub(super) fn at(&self, rim_rad: f64) -> f64 {
        let place = rim_rad / self.step_rad;
        let below = place as usize;
        let part = place - below as f64;
        // Even about the axis.
        let before = if below == 0 { self.table[1] } else { self.table[below - 1] };
        let [low, high, after] = [0, 1, 2].map(|i| self.table[below + i]);
        let slope = 0.5 * (high - before);
        let bend = before - 2.5 * low + 2.0 * high - 0.5 * after;
        let twist = 0.5 * (after - before) + 1.5 * (low - high);
        // Where another part of the pulse becomes the highest there is a kink, which a cubic overshoots.
        (low + part * (slope + part * (bend + part * twist))).clamp(0.0, 1.0)
    }
}

/// What a response follows from.
#[derive(PartialEq)]
struct Face {
    /// [`of_width_one`].
    aperture: Aperture,
    pulse: Pulse,
    frequency_hz: f64,
    /// Of the table.
    step_rad: f64,
}

/// The shape of a face alone: with a half width of 1, without skirts and windows.
fn of_width_one(aperture: &Aperture) -> Aperture {
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

/// A face of half width 1 and the pulse that it meets.
pub(super) struct MetFace {
    aperture: Aperture,
    /// Radians a microsecond.
    omega: f64,
    pulse: EchoShape,
    /// About which the pulse is even, if it is, microseconds.
    middle_us: Option<f64>,
}

/// Spacing at which the peak is looked for, microseconds.
const SEARCH_US: f64 = 6.0;

impl MetFace {
    pub(super) fn of(sensor: &Sensor) -> Self {
        let middle_us = match sensor.pulse {
            Pulse::Burst { .. } => Some(0.5e6 * sensor.pulse_s()),
            Pulse::Gaussian { .. } => Some(0.0),
            Pulse::Chirp { .. } => None,
        };
        let aperture = of_width_one(&sensor.aperture);
        let omega = 1e-6 * TAU * sensor.frequency_hz;
        Self { aperture, omega, pulse: EchoShape::of(sensor), middle_us }
    }

    /// Peak over time of `|h * pulse|` at a phase to the rim, but for the obliquity.
    pub(super) fn peak(&self, rim_rad: f64) -> f64 {
        let points = self.quadrature(rim_rad);
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
        peak.max(highest_sample)
    }

    /// Delays (microseconds) and complex shares of the face's points.
    fn quadrature(&self, rim_rad: f64) -> Vec<(f64, Complex64)> {
        // From half of the phase on, more points gain nothing but the digits of the rest.
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

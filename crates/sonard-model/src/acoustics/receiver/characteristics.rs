//! Characteristics of a receiver: blanking, threshold, gain, pulse and timing.

use std::f64::consts::TAU;

use super::{
    gain::{Sensitivity, gain_db},
    noise,
};
use crate::acoustics::{
    ApertureResponse, Detector, EchoShape, Gain, Image, Incidence, Response, Sensor,
};

/// Arrival at the transducer's face, reduced to the quantities that the receiver uses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PulseArrival {
    /// Round-trip path length, metres.
    pub length_m: f64,
    /// Strength after gain compensation and the beam pattern on departure and arrival. A head-on,
    /// perfectly reflecting wall without absorption gives 1.
    pub amplitude: f64,
    /// Carrier phase in addition to that of the path length, for `exp(+i omega t)`, radians.
    pub phase_rad: f64,
    /// Caller's index of the propagation path; ignored by the receiver.
    pub index: u32,
}

/// Combination of overlapping arrivals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Combining {
    /// Pulses with rise and decay; where they overlap they add up with their phases.
    #[default]
    Coherent,
    /// Pulses of unknown phase: where they overlap, their powers add up. Equals the average over
    /// positions that differ by a wavelength.
    Incoherent,
    /// Separate pulses, each at full strength immediately and for the nominal pulse length: the
    /// wide-band limit, for models without phases. The range is exactly half the path.
    Ideal,
}

/// Threshold detector that is enabled at the end of blanking.
#[derive(Debug, Clone)]
pub struct Receiver {
    /// Blanking time after firing, microseconds.
    pub blanking_us: f64,
    /// Hold-off time after an echo, microseconds.
    pub rearm_us: f64,
    /// Time for which the envelope has to stay above the threshold, microseconds.
    pub integration_us: f64,
    /// Detection threshold as an amplitude, for gain that compensates spreading, at range 0.
    pub threshold: f64,
    /// Resolution of reported ranges, metres; 0 for unquantized ranges.
    pub range_step_m: f64,
    /// Speed of sound, m/s.
    pub sound_speed_m_s: f64,
    /// Maximum range, metres: half the longest path in the detection window.
    pub max_range_m: f64,
    /// Combination of overlapping arrivals.
    pub combining: Combining,
    /// Detected signal. `Carrier` requires known phases and acts as `Envelope` otherwise.
    pub detector: Detector,
    pub(super) averaged_firings: u32,
    pub(super) gain: Gain,
    pub(super) sensitivity: Sensitivity,
    /// Carrier, radians per microsecond.
    pub(super) omega: f64,
    /// Nominal duration of the pulse, microseconds.
    pub(super) pulse_us: f64,
    pub(super) shape: EchoShape,
    pub(super) response: Option<ApertureResponse>,
    pub(super) noise_sigma_us: f64,
    /// Threshold crossing of the reference echo, microseconds from its nominal onset.
    pub(super) lead_us: f64,
    /// Delay from that crossing to the next carrier crest of the reference echo, microseconds.
    pub(super) crest_us: f64,
}

/// Arrival as required by the full aperture response of the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incident {
    /// Strength before the beam pattern.
    pub strength: f64,
    /// Incidence on the face.
    pub incidence: Incidence,
}

impl Combining {
    /// Returns `true` if pulses rise and decay: echoes then have time walk, and a minimum level
    /// above the threshold.
    const fn has_pulse_shapes(self) -> bool {
        !matches!(self, Self::Ideal)
    }
}

impl Receiver {
    /// Creates the receiver of a sensor for a speed of sound in m/s.
    #[must_use]
    pub fn new(sensor: &Sensor, sound_speed_m_s: f64) -> Self {
        let shape = EchoShape::for_sensor(sensor);
        let response = (sensor.response == Response::Full)
            .then(|| ApertureResponse::new(sensor, sound_speed_m_s))
            .flatten();
        Self {
            blanking_us: sensor.blanking_us,
            rearm_us: sensor.rearm_us,
            integration_us: sensor.integration_us,
            threshold: sensor.threshold,
            range_step_m: sensor.range_step_m,
            sound_speed_m_s,
            max_range_m: sensor.max_range_m,
            combining: Combining::Coherent,
            detector: sensor.detector,
            averaged_firings: sensor.averaged_firings,
            sensitivity: Sensitivity::for_sensor(sensor),
            gain: sensor.gain.clone(),
            omega: 1e-6 * TAU * sensor.frequency_hz,
            pulse_us: 1e6 * sensor.pulse_s(),
            shape,
            response,
            noise_sigma_us: noise::sigma_us(sensor),
            lead_us: 0.0,
            crest_us: 0.0,
        }
        .with_threshold(sensor.threshold)
    }

    /// Sets another threshold and removes the timing bias that belongs to it from all times.
    #[must_use]
    pub fn with_threshold(mut self, threshold: f64) -> Self {
        self.threshold = threshold;
        let reference = self.reference_echo();
        self.lead_us = reference.rise_us(threshold).unwrap_or(0.0);
        self.crest_us = self.until_crest_us(reference.at(self.lead_us).arg(), 0.0);
        self
    }

    /// Returns `true` if detection needs an [`Incident`] for each arrival.
    #[must_use]
    pub const fn needs_incidents(&self) -> bool {
        self.response.is_some() && self.combining.has_pulse_shapes()
    }

    /// Range of the end of blanking, metres.
    #[must_use]
    pub fn min_range_m(&self) -> f64 {
        self.range_m(self.blanking_us)
    }

    /// End of the detection window, microseconds after firing.
    #[must_use]
    pub fn window_us(&self) -> f64 {
        2e6 * self.max_range_m / self.sound_speed_m_s
    }

    /// Effective detection threshold at a time after firing, microseconds.
    #[must_use]
    pub fn threshold_at(&self, t_us: f64) -> f64 {
        self.sensitivity.threshold(self.threshold, t_us, self.range_m(t_us))
    }

    /// Gain at a time after firing, microseconds, in decibels re the gain that compensates the
    /// spreading from a wall at 1 m.
    #[must_use]
    pub fn gain_db(&self, t_us: f64) -> f64 {
        gain_db(&self.gain, t_us, self.range_m(t_us))
    }

    /// Time walk of an isolated echo that peaks `margin_db` above the effective threshold: range
    /// error in metres relative to the reference echo.
    #[must_use]
    pub fn time_walk_m(&self, margin_db: f64) -> f64 {
        if !self.combining.has_pulse_shapes() {
            return 0.0;
        }
        let level = 10f64.powf(-margin_db.max(0.0) / 20.0);
        self.range_m(self.shape.rise_us(level).map_or(0.0, |rise_us| rise_us - self.lead_us))
    }

    /// Minimum peak level of a detectable isolated echo, decibels above the effective threshold:
    /// the level at which the envelope stays above the threshold for the integration time.
    #[must_use]
    pub fn min_margin_db(&self) -> f64 {
        if !self.combining.has_pulse_shapes() {
            return 0.0;
        }
        let is_detected = |margin_db: f64| {
            let level = 10f64.powf(-margin_db / 20.0);
            let rise_us = self.shape.rise_us(level);
            rise_us.is_some_and(|us| self.shape.max_from(us + self.integration_us) >= level)
        };
        // Invariant: detected at the larger margin, not at the smaller one. A pulse shorter than
        // the integration time is never detected.
        let (mut low_db, mut high_db) = (0.0, 60.0);
        if is_detected(low_db) || !is_detected(high_db) {
            return low_db;
        }
        while high_db - low_db > 1e-6 {
            let middle_db = 0.5 * (low_db + high_db);
            *(if is_detected(middle_db) { &mut high_db } else { &mut low_db }) = middle_db;
        }
        high_db
    }

    /// Delay from a time (microseconds, on the echo time scale) to the next crest of a carrier with
    /// the given excess phase at that time.
    pub(super) fn until_crest_us(&self, phase_rad: f64, t_us: f64) -> f64 {
        let phase_rad = phase_rad + self.omega * (t_us + self.lead_us);
        (-phase_rad).rem_euclid(TAU) / self.omega
    }

    /// Echo that is timed without bias: a head-on, perfectly reflecting wall at 1 m.
    fn reference_echo(&self) -> EchoShape {
        let head_on =
            Incidence { leaving_rad: 0.0, arriving_rad: 0.0, length_m: 2.0, image: Image::Swapped };
        let full = self.response.as_ref().and_then(|response| response.echo(&head_on));
        full.unwrap_or_else(|| self.shape.clone())
    }

    pub(super) fn range_m(&self, t_us: f64) -> f64 {
        self.sound_speed_m_s * t_us * 1e-6 / 2.0
    }

    pub(super) fn tof_us(&self, arrival: &PulseArrival) -> f64 {
        self.arrives_us(arrival.length_m)
    }

    pub(super) fn arrives_us(&self, length_m: f64) -> f64 {
        length_m / self.sound_speed_m_s * 1e6
    }
}

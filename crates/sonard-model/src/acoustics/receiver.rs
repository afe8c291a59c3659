//! Receiver model: selects the arrivals at the transducer's face that raise ECHO, and times them.
//!
//! # Timing
//!
//! A pulse rises over some tens of microseconds. ECHO therefore rises before or after the nominal
//! arrival time, depending on the ratio of echo amplitude to threshold. The part of this offset
//! that all echoes share belongs to calibration and is left out here: times are counted so that a
//! head-on, perfectly reflecting wall is timed by its path alone and its range is its distance. A
//! weaker echo is late relative to that reference (time walk). With the 6500's 16 cycles and 7 kHz
//! of bandwidth the error is 1.3 mm of range at half the amplitude and 7 mm at a tenth.
//!
//! # Detection
//!
//! Overlapping arrivals add up with their phases. The detector compares the envelope of the sum
//! with the effective threshold: the sensor's threshold divided by the current gain. The envelope
//! has to stay above the threshold for the sensor's integration time. That delay is the same for
//! all echoes and is left out as well.

mod detection;
mod detector;
mod detector_bank;
mod gain;
mod noise;
mod trace;

#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

pub use self::{
    detection::Detection,
    detector_bank::{DetectorBank, EchoRise},
    noise::ReceiverNoise,
    trace::{EchoTrace, EnvelopePeak, TracePoint},
};

use self::{
    detector::Firing,
    gain::{Sensitivity, gain_db},
};
use super::{ApertureResponse, Detector, EchoShape, Gain, Incidence, Response, Sensor};
use crate::reading::PingStatus;

/// Behaviour of ECHO after it has risen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Latch {
    /// ECHO stays high until the next firing: only the first echo is timed.
    #[default]
    First,
    /// A pulse on BLNK resets ECHO after each echo, up to eight times.
    Rearmed,
}

/// Largest delay after the end of blanking, microseconds, at which ECHO is attributed to sound that
/// was already present: about one cycle at 50 kHz, 3.4 mm of range.
const BLANKING_TOLERANCE_US: f64 = 20.0;

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
    averaged_firings: u32,
    gain: Gain,
    sensitivity: Sensitivity,
    /// Carrier, radians per microsecond.
    omega: f64,
    /// Nominal duration of the pulse, microseconds.
    pulse_us: f64,
    shape: EchoShape,
    response: Option<ApertureResponse>,
    noise_sigma_us: f64,
    /// Threshold crossing of the reference echo, microseconds from its nominal onset.
    lead_us: f64,
    /// Delay from that crossing to the next carrier crest of the reference echo, microseconds.
    crest_us: f64,
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

    /// Detects the echoes of one firing. Arrivals are sorted by length; the detector is re-armed
    /// after each echo.
    ///
    /// An arrival that begins before the detector is ready and still lasts then raises ECHO at that
    /// moment. At the end of blanking this yields the minimum range, whatever the true distance.
    /// Sound that has ended by then is lost.
    #[must_use]
    pub fn detect(&self, arrivals: &[PulseArrival]) -> Detection {
        self.detect_at_face(arrivals, &|_| None, Latch::Rearmed)
    }

    /// Detects echoes with the full aperture response of the face, if the sensor has one.
    /// `incident` returns the incidence of an arrival on the face; for `None` the arrival's
    /// amplitude is used.
    #[must_use]
    pub fn detect_at_face(
        &self,
        arrivals: &[PulseArrival],
        incident: &dyn Fn(&PulseArrival) -> Option<Incident>,
        latch: Latch,
    ) -> Detection {
        self.detect_within(f64::INFINITY, arrivals, incident, latch, 0.0).0
    }

    /// Detects echoes as [`detect_at_face`](Self::detect_at_face) when only arrivals up to a
    /// round-trip length in metres are known and ECHO cannot rise before `ready_us`. If longer
    /// arrivals cannot change the detection, also returns the length, at most `length_m`, beyond
    /// which arrivals are irrelevant.
    #[must_use]
    pub fn detect_within(
        &self,
        length_m: f64,
        arrivals: &[PulseArrival],
        incident: &dyn Fn(&PulseArrival) -> Option<Incident>,
        latch: Latch,
        ready_us: f64,
    ) -> (Detection, Option<f64>) {
        let firing = Firing { known_m: length_m, ..Firing::new(self, arrivals, incident) };
        let (detection, needed_m) = self.detection(firing, latch, ready_us);
        (self.quantized(detection), needed_m)
    }

    /// Detects echoes in noise. For a module that averages, the first echo is the mean over its
    /// firings, if more than half of them detect one.
    #[must_use]
    pub fn detect_in_noise(
        &self,
        arrivals: &[PulseArrival],
        incident: &dyn Fn(&PulseArrival) -> Option<Incident>,
        noise: &ReceiverNoise,
        rng: &mut impl rand::Rng,
    ) -> Detection {
        let firings =
            (0..self.averaged_firings).map(|_| self.fire_in_noise(arrivals, incident, noise, rng));
        self.quantized(self.average(firings.collect()))
    }

    fn fire_in_noise(
        &self,
        arrivals: &[PulseArrival],
        incident: &dyn Fn(&PulseArrival) -> Option<Incident>,
        noise: &ReceiverNoise,
        rng: &mut impl rand::Rng,
    ) -> Detection {
        let track = noise.track(self, rng);
        let firing = Firing { noise: Some(&track), ..Firing::new(self, arrivals, incident) };
        let (mut detection, _) = self.detection(firing, Latch::Rearmed, 0.0);
        for (i, echo_us) in detection.echoes_us.iter_mut().enumerate() {
            let jitter_us = noise.jitter(rng);
            if i > 0 || detection.status != PingStatus::MinRange {
                *echo_us += jitter_us;
            }
        }
        if detection.status == PingStatus::Echo {
            detection.range_m = detection.echoes_us.first().map(|echo_us| self.range_m(*echo_us));
        }
        detection
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
    fn until_crest_us(&self, phase_rad: f64, t_us: f64) -> f64 {
        let phase_rad = phase_rad + self.omega * (t_us + self.lead_us);
        (-phase_rad).rem_euclid(TAU) / self.omega
    }

    /// Echo that is timed without bias: a head-on, perfectly reflecting wall at 1 m.
    fn reference_echo(&self) -> EchoShape {
        let head_on = Incidence {
            leaving_rad: 0.0,
            arriving_rad: 0.0,
            length_m: 2.0,
            image: super::Image::Swapped,
        };
        let full = self.response.as_ref().and_then(|response| response.echo(&head_on));
        full.unwrap_or_else(|| self.shape.clone())
    }

    fn range_m(&self, t_us: f64) -> f64 {
        self.sound_speed_m_s * t_us * 1e-6 / 2.0
    }

    fn tof_us(&self, arrival: &PulseArrival) -> f64 {
        self.arrives_us(arrival.length_m)
    }

    fn arrives_us(&self, length_m: f64) -> f64 {
        length_m / self.sound_speed_m_s * 1e6
    }
}

/// Status of a measured reading from its first time of flight, microseconds.
///
/// ECHO within one carrier cycle (20 us) of the end of blanking was raised by sound that was
/// already present. A real echo that begins in that span is indistinguishable from it.
#[must_use]
pub fn classify_tof(tof_us: Option<f64>, blanking_us: f64) -> PingStatus {
    match tof_us {
        None => PingStatus::NoEcho,
        Some(tof_us) if tof_us <= blanking_us + BLANKING_TOLERANCE_US => PingStatus::MinRange,
        Some(_) => PingStatus::Echo,
    }
}

//! The receiver: which of the arrivals at the transducer's face raise ECHO, and when.
//!
//! # When
//!
//! A pulse rises over some tens of microseconds, so ECHO rises before or after the arrival's nominal
//! arrival, depending on how far it passes the threshold. What is the same for all echoes is
//! calibration's business and left out here: times are counted so that a head-on, perfectly
//! reflecting wall is timed by its path alone, and its range is its distance. A weaker echo is
//! late against that: with the 6500's 16 cycles and 7 kHz of bandwidth 1.3 mm of range at half the
//! amplitude, 7 mm at a tenth of it (time walk).
//!
//! # What
//!
//! Arrivals that overlap add up with their phases. The detector watches the envelope of the sum
//! against the threshold that the gain of the moment makes of the sensor's. An envelope has to stay
//! above for the sensor's integration time; the time that takes is the same for all echoes and
//! left out as well.

mod detection;
mod gain;
mod hearing;
mod listening;
mod noise;
mod trace;

#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

pub use self::{
    detection::Detection,
    listening::{Listening, Rise},
    noise::ReceiverNoise,
    trace::{EchoTrace, EnvelopePeak, TracePoint},
};

use self::{
    gain::{Sensitivity, gain_db},
    hearing::Hearing,
};
use super::{ApertureResponse, Detector, EchoShape, Gain, Incidence, Response, Sensor};
use crate::reading::PingStatus;

/// Behaviour of ECHO after it has risen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Latch {
    /// It stays up until the next firing: only the first echo is timed.
    #[default]
    First,
    /// A pulse on BLNK lets it fall after each echo, up to eight times.
    Rearmed,
}

/// ECHO this soon after the end of blanking counts as raised by sound already there,
/// microseconds: about one cycle at 50 kHz, 3.4 mm of range.
const BLANKING_TOLERANCE_US: f64 = 20.0;

/// An arrival at the transducer's face, reduced to what the receiver notices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PulseArrival {
    /// Length of its path there and back, metres.
    pub length_m: f64,
    /// Strength after gain compensation and the beam pattern on departure and arrival; a head-on, perfectly
    /// reflecting wall without absorption gives 1.
    pub amplitude: f64,
    /// Phase of the carrier beside that of the path's length, for `exp(+i omega t)`, radians.
    pub phase_rad: f64,
    /// Which of the sender's paths it took; meaningless to the receiver.
    pub index: u32,
}

/// Combination of overlapping arrivals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Combining {
    /// As pulses that rise and fall and, where they overlap, add up with their phases.
    #[default]
    Coherent,
    /// As pulses whose phases nobody knows: where they overlap, their powers add up. So it is on average over places
    /// that differ by a wavelength.
    Incoherent,
    /// One at a time, each as strong at once as it will ever be, for as long as the pulse
    /// nominally lasts: the limit of a wide band, for models that know no phases. The range is half
    /// the path, exactly.
    Ideal,
}

/// A detector with a threshold that opens after the blanking.
#[derive(Debug, Clone)]
pub struct Receiver {
    /// From firing until it listens, microseconds.
    pub blanking_us: f64,
    /// Time for which it is held after an echo, microseconds.
    pub rearm_us: f64,
    /// Time for which the envelope has to stay above the threshold, microseconds.
    pub integration_us: f64,
    /// Least amplitude it notices where the gain makes up for the spreading, at range 0.
    pub threshold: f64,
    /// Whole steps in which ranges are told, metres; 0 for ranges as they are.
    pub range_step_m: f64,
    /// Speed of sound, metres a second.
    pub sound_speed_m_s: f64,
    /// Half the longest path it waits for, metres.
    pub max_range_m: f64,
    /// How overlapping arrivals are combined.
    pub combining: Combining,
    /// What it watches; phases that are not known have no crests.
    pub detector: Detector,
    averaged_firings: u32,
    gain: Gain,
    sensitivity: Sensitivity,
    /// Carrier, radians a microsecond.
    omega: f64,
    /// Nominal duration of the pulse, microseconds.
    pulse_us: f64,
    shape: EchoShape,
    response: Option<ApertureResponse>,
    noise_sigma_us: f64,
    /// When the reference echo passes the threshold, from its nominal onset, microseconds.
    lead_us: f64,
    /// How long after that the reference echo's carrier has its next crest, microseconds.
    crest_us: f64,
}

/// An arrival as the full response of the face needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incident {
    /// Strength before the beam pattern.
    pub strength: f64,
    /// Its incidence on the face.
    pub incidence: Incidence,
}

impl Receiver {
    /// The receiver of a sensor at a speed of sound in metres a second.
    #[must_use]
    pub fn new(sensor: &Sensor, sound_speed_m_s: f64) -> Self {
        let shape = EchoShape::of(sensor);
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
            sensitivity: Sensitivity::of(sensor),
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

    /// With another threshold, and the bias that goes with it left out of all times.
    #[must_use]
    pub fn with_threshold(mut self, threshold: f64) -> Self {
        self.threshold = threshold;
        let reference = self.reference_echo();
        self.lead_us = reference.rise_us(threshold).unwrap_or(0.0);
        self.crest_us = self.until_crest_us(reference.at(self.lead_us).arg(), 0.0);
        self
    }

    /// Whether it needs an [`Incident`] for each arrival.
    #[must_use]
    pub const fn asks_incidents(&self) -> bool {
        self.response.is_some() && !matches!(self.combining, Combining::Ideal)
    }

    /// Listens to the arrivals of one firing, which come in order of their length, and is made ready
    /// again after each echo.
    ///
    /// An arrival that begins before the detector is ready and still lasts then raises ECHO at that
    /// moment: at the end of blanking that is the minimum range, whatever is really there. A
    /// sound that is over by then is lost.
    #[must_use]
    pub fn detect(&self, arrivals: &[PulseArrival]) -> Detection {
        let mut hearing = Hearing::new(self, arrivals, &|_| None);
        self.told(self.detection(&mut hearing, Latch::Rearmed, 0.0))
    }

    /// The same with the face's full response, if the sensor asks for it: `incident` tells how a
    /// sound meets the face, and an arrival of which it tells nothing is taken by its amplitude.
    #[must_use]
    pub fn detect_at_face(
        &self,
        arrivals: &[PulseArrival],
        incident: &dyn Fn(&PulseArrival) -> Option<Incident>,
        latch: Latch,
    ) -> Detection {
        self.detect_within(f64::INFINITY, arrivals, incident, latch, 0.0).0
    }

    /// The same if only the arrivals up to a length there and back are known, in metres, and ECHO can't rise before
    /// `ready_us`. If longer ones can't change it, also the length, at most that one, beyond which they couldn't.
    #[must_use]
    pub fn detect_within(
        &self,
        length_m: f64,
        arrivals: &[PulseArrival],
        incident: &dyn Fn(&PulseArrival) -> Option<Incident>,
        latch: Latch,
        ready_us: f64,
    ) -> (Detection, Option<f64>) {
        let mut hearing = Hearing::new(self, arrivals, incident);
        hearing.hear_within(length_m);
        let detection = self.detection(&mut hearing, latch, ready_us);
        let needed_m = (!hearing.asked_beyond()).then(|| hearing.needed_m());
        (self.told(detection), needed_m)
    }

    /// The same in noise. Of a module that averages, the first echo is the mean of those of its firings, if more than half
    /// of them hear one.
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
        self.told(self.averaged(firings.collect()))
    }

    fn fire_in_noise(
        &self,
        arrivals: &[PulseArrival],
        incident: &dyn Fn(&PulseArrival) -> Option<Incident>,
        noise: &ReceiverNoise,
        rng: &mut impl rand::Rng,
    ) -> Detection {
        let track = noise.track(self, rng);
        let mut detection = self.detection(
            &mut Hearing::new(self, arrivals, incident).in_noise(&track),
            Latch::Rearmed,
            0.0,
        );
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

    /// The range that belongs to the end of blanking, metres.
    #[must_use]
    pub fn min_range_m(&self) -> f64 {
        self.range_m(self.blanking_us)
    }

    /// Time for which it listens, microseconds after firing.
    #[must_use]
    pub fn window_us(&self) -> f64 {
        2e6 * self.max_range_m / self.sound_speed_m_s
    }

    /// The least amplitude noticed at a time after firing, microseconds.
    #[must_use]
    pub fn threshold_at(&self, t_us: f64) -> f64 {
        self.sensitivity.threshold(self.threshold, t_us, self.range_m(t_us))
    }

    /// Gain at a time after firing, decibels above what makes up for the spreading from a wall
    /// at 1 m.
    #[must_use]
    pub fn gain_db(&self, t_us: f64) -> f64 {
        gain_db(&self.gain, t_us, self.range_m(t_us))
    }

    /// By how much later an echo is told that reaches so many decibels above the threshold in force than one that is
    /// timed without bias, metres of range (time walk); of a lone echo.
    #[must_use]
    pub fn time_walk_m(&self, margin_db: f64) -> f64 {
        if self.combining == Combining::Ideal {
            return 0.0;
        }
        let level = 10f64.powf(-margin_db.max(0.0) / 20.0);
        self.range_m(self.shape.rise_us(level).map_or(0.0, |rise_us| rise_us - self.lead_us))
    }

    /// How far a lone echo has to reach above the threshold in force to be told, decibels: so far that it stays above for the
    /// integration time.
    #[must_use]
    pub fn least_margin_db(&self) -> f64 {
        if self.combining == Combining::Ideal {
            return 0.0;
        }
        let is_told = |margin_db: f64| {
            let level = 10f64.powf(-margin_db / 20.0);
            let rise_us = self.shape.rise_us(level);
            rise_us.is_some_and(|us| self.shape.most_from(us + self.integration_us) >= level)
        };
        // Invariant: told at the larger margin, and not at the smaller one. A pulse too short for the integration never is.
        let (mut least_db, mut most_db) = (0.0, 60.0);
        if is_told(least_db) || !is_told(most_db) {
            return least_db;
        }
        while most_db - least_db > 1e-6 {
            let middle_db = 0.5 * (least_db + most_db);
            *(if is_told(middle_db) { &mut most_db } else { &mut least_db }) = middle_db;
        }
        most_db
    }

    /// How long after a time (microseconds, counted as echoes are) a carrier that then has a phase beside its own has its
    /// next crest.
    fn until_crest_us(&self, phase_rad: f64, t_us: f64) -> f64 {
        let phase_rad = phase_rad + self.omega * (t_us + self.lead_us);
        (-phase_rad).rem_euclid(TAU) / self.omega
    }

    /// The echo that is timed without bias: a head-on, perfectly reflecting wall at 1 m.
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

/// The status of a measured reading from its first time of flight, microseconds, if any.
///
/// ECHO within one carrier cycle (20 us) of the end of blanking was raised by sound already
/// there: a real echo that begins in that span can't be told from it.
#[must_use]
pub fn classify_tof(tof_us: Option<f64>, blanking_us: f64) -> PingStatus {
    match tof_us {
        None => PingStatus::NoEcho,
        Some(tof_us) if tof_us <= blanking_us + BLANKING_TOLERANCE_US => PingStatus::MinRange,
        Some(_) => PingStatus::Echo,
    }
}

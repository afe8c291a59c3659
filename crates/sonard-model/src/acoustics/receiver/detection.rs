//! Detection result of a firing: the first rise of ECHO and those after it, or no echo and the
//! strongest candidate.

use smallvec::SmallVec;

use super::{
    characteristics::{Incident, PulseArrival, Receiver},
    detector::firing::{EchoDetector, Firing},
    detector::start_detector,
    noise::ReceiverNoise,
};
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

/// Maximum number of echoes reported per firing.
const MAX_ECHOES: usize = 8;

/// The receiver's detection of a firing.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// `Echo`, `NoEcho` or `MinRange`.
    pub status: PingStatus,
    /// Half the detected path, metres; for `MinRange` the range of the end of blanking.
    pub range_m: Option<f64>,
    /// Arrival that raised ECHO, if it was sound; for `NoEcho` the strongest candidate.
    pub arrival: Option<PulseArrival>,
    /// Peak of the summed envelope during that arrival.
    pub amplitude: Option<f64>,
    /// Peak level above the effective threshold, decibels.
    pub margin_db: Option<f64>,
    /// Times at which ECHO rises, microseconds after firing; the first eight.
    pub echoes_us: SmallVec<[f64; MAX_ECHOES]>,
    /// ECHO rises again after the last of these times.
    pub has_more_echoes: bool,
}

impl Receiver {
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
        let firing = Firing::new(self, arrivals, incident);
        let firings = (0..self.averaged_firings).map(|_| self.fire_in_noise(firing, noise, rng));
        self.quantized(self.average(firings.collect()))
    }

    fn fire_in_noise(
        &self,
        firing: Firing,
        noise: &ReceiverNoise,
        rng: &mut impl rand::Rng,
    ) -> Detection {
        let track = noise.track(self, rng);
        let firing = Firing { noise: Some(&track), ..firing };
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

    /// Detects the echoes of a firing that cannot raise ECHO before `ready_us`. If longer arrivals
    /// than the known ones cannot change the detection, also returns the round-trip length, metres,
    /// beyond which arrivals are irrelevant.
    pub(super) fn detection(
        &self,
        firing: Firing,
        latch: Latch,
        ready_us: f64,
    ) -> (Detection, Option<f64>) {
        let mut detector = start_detector(firing);
        let detection = match detector.next_rise(self.scan_start_us(ready_us), f64::INFINITY) {
            Some(first_us) => self.echoes(detector.as_mut(), first_us, latch),
            None => self.no_echo(detector.as_mut(), firing.arrivals),
        };
        (detection, detector.needed_m())
    }

    /// Reports the echoes from the first rise on.
    fn echoes(&self, detector: &mut dyn EchoDetector, first_us: f64, latch: Latch) -> Detection {
        let mut echoes_us = SmallVec::new();
        let status = self.status_at(first_us);
        let is_min_range = status == PingStatus::MinRange;
        let reported_us = first_us + if is_min_range { 0.0 } else { detector.delay_us(first_us) };
        let cause = detector.cause(first_us);
        let (peak, margin_db) = self.peak(detector, first_us, cause.as_ref());
        let mut last_us = first_us;
        echoes_us.push(reported_us);
        while latch == Latch::Rearmed
            && echoes_us.len() < MAX_ECHOES
            && let Some(next_us) = detector.next_rise(last_us + self.rearm_us, f64::INFINITY)
        {
            echoes_us.push(next_us + detector.delay_us(next_us));
            last_us = next_us;
        }
        let has_more_echoes = latch == Latch::Rearmed
            && echoes_us.len() == MAX_ECHOES
            && detector.next_rise(last_us + self.rearm_us, f64::INFINITY).is_some();
        Detection {
            status,
            range_m: Some(self.range_m(reported_us)),
            arrival: cause,
            amplitude: Some(peak),
            margin_db: Some(margin_db),
            echoes_us,
            has_more_echoes,
        }
    }

    /// Peak of the summed envelope for an echo that rose at `first_us`, and its level above the
    /// effective threshold at that time, decibels. Valid only before a search for the next rise.
    pub(super) fn peak(
        &self,
        detector: &mut dyn EchoDetector,
        first_us: f64,
        cause: Option<&PulseArrival>,
    ) -> (f64, f64) {
        let peak = match self.status_at(first_us) {
            PingStatus::MinRange => detector.level(first_us),
            _ => detector.peak(first_us, cause),
        };
        (peak, 20.0 * (peak / detector.threshold_at(first_us)).log10())
    }

    /// Start of the envelope scan for a detector that cannot be raised before `ready_us`. Time
    /// above the threshold shortly before `ready_us` counts towards the integration time.
    pub(super) fn scan_start_us(&self, ready_us: f64) -> f64 {
        (ready_us - 2.0 * self.integration_us).max(self.blanking_us)
    }

    /// Status of a first rise.
    pub(super) fn status_at(&self, first_us: f64) -> PingStatus {
        let is_min_range = first_us <= self.blanking_us + 1e-6;
        if is_min_range { PingStatus::MinRange } else { PingStatus::Echo }
    }

    /// Result of a module that averages several firings (at least one): a single echo at the mean
    /// of the first echoes, if more than half of the firings have one.
    pub(super) fn average(&self, mut firings: Vec<Detection>) -> Detection {
        if firings.len() == 1 {
            return firings.remove(0);
        }
        let is_echo = |firing: &&Detection| firing.status == PingStatus::Echo;
        let first_us: Vec<f64> = firings
            .iter()
            .filter(is_echo)
            .filter_map(|firing| firing.echoes_us.first().copied())
            .collect();
        let is_detected = 2 * first_us.len() > firings.len();
        let has_result = |firing: &Detection| (firing.status == PingStatus::Echo) == is_detected;
        let at = firings.iter().position(has_result).unwrap_or(0);
        let mut quantized = firings.swap_remove(at);
        if is_detected {
            let mean_us = first_us.iter().sum::<f64>() / first_us.len() as f64;
            quantized.range_m = Some(self.range_m(mean_us));
            quantized.echoes_us = SmallVec::from_slice(&[mean_us]);
            quantized.has_more_echoes = false;
        }
        quantized
    }

    /// Quantizes ranges to the module's resolution. The end of blanking is not quantized.
    pub(super) fn quantized(&self, mut detection: Detection) -> Detection {
        if self.range_step_m == 0.0 {
            return detection;
        }
        let us_per_m = 2e6 / self.sound_speed_m_s;
        let stepped_m = |range_m: f64| (range_m / self.range_step_m).round() * self.range_step_m;
        let blanked = usize::from(detection.status == PingStatus::MinRange);
        for echo_us in detection.echoes_us.iter_mut().skip(blanked) {
            *echo_us = us_per_m * stepped_m(self.range_m(*echo_us));
        }
        if detection.status == PingStatus::Echo {
            detection.range_m = detection.range_m.map(stepped_m);
        }
        detection
    }

    /// Result without an echo: the strongest arrival within the detection window.
    fn no_echo(&self, detector: &mut dyn EchoDetector, arrivals: &[PulseArrival]) -> Detection {
        let (echoes_us, window_us) = (SmallVec::new(), self.window_us());
        // Unknown arrivals may exceed the known ones.
        let known = if detector.needed_m().is_some() { arrivals } else { &[] };
        let relative =
            |arrival: &PulseArrival| arrival.amplitude / self.threshold_at(self.tof_us(arrival));
        let arrival = known
            .iter()
            .filter(|arrival| (self.blanking_us..=window_us).contains(&self.tof_us(arrival)))
            .filter(|arrival| arrival.amplitude > 0.0)
            .max_by(|a, b| relative(a).total_cmp(&relative(b)))
            .copied();
        let peak = arrival.map(|arrival| {
            detector.rewind_to(0.0);
            detector.peak(self.tof_us(&arrival), Some(&arrival))
        });
        Detection {
            status: PingStatus::NoEcho,
            range_m: None,
            arrival,
            amplitude: peak,
            // The peak may exceed the threshold for less than the integration time.
            margin_db: arrival.zip(peak).map(|(arrival, peak)| {
                let threshold = detector.threshold_at(self.tof_us(&arrival));
                (20.0 * (peak / threshold).log10()).min(0.0)
            }),
            echoes_us,
            has_more_echoes: false,
        }
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

//! Detection of one firing at several thresholds.

use super::{
    characteristics::{Incident, PulseArrival, Receiver},
    detector::{
        firing::{EchoDetector, Firing},
        start_detector,
    },
};
use crate::reading::PingStatus;

/// Receivers that differ only in their threshold, applied to one firing. The arrivals are summed
/// once for all of them.
pub struct DetectorBank<'a> {
    receiver: &'a Receiver,
    detector: Box<dyn EchoDetector + 'a>,
}

/// First rise of ECHO at one of the thresholds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoRise {
    /// Outcome: `Echo` or `MinRange`.
    pub status: PingStatus,
    /// Half the detected path, or the range of the end of blanking, metres.
    pub range_m: f64,
    /// Arrival that raised ECHO.
    pub arrival: Option<PulseArrival>,
    /// Threshold crossing of the envelope, microseconds after firing. A receiver with a higher
    /// threshold cannot rise earlier.
    pub passed_us: f64,
}

impl Receiver {
    /// Prepares the detection of one firing at several thresholds. Arrivals are known up to a
    /// round-trip length in metres; `incident` as for [`detect_at_face`](Self::detect_at_face).
    #[must_use]
    pub fn detector_bank<'a>(
        &'a self,
        length_m: f64,
        arrivals: &'a [PulseArrival],
        incident: &'a dyn Fn(&PulseArrival) -> Option<Incident>,
    ) -> DetectorBank<'a> {
        let firing = Firing { known_m: length_m, ..Firing::new(self, arrivals, incident) };
        DetectorBank { receiver: self, detector: start_detector(firing) }
    }
}

impl DetectorBank<'_> {
    /// First rise of a receiver with `factor` times the threshold that cannot be raised before
    /// `ready_us`, microseconds; `None` without an echo.
    #[must_use]
    pub fn first_rise(&mut self, factor: f64, ready_us: f64) -> Option<EchoRise> {
        self.first_rise_within(factor, ready_us, f64::INFINITY)
    }

    /// First rise as from [`first_rise`](Self::first_rise); `None` also for one after `until_us`,
    /// microseconds, as far as it has not been found by then.
    #[must_use]
    pub fn first_rise_within(
        &mut self,
        factor: f64,
        ready_us: f64,
        until_us: f64,
    ) -> Option<EchoRise> {
        let receiver = self.receiver;
        let from_us = receiver.scan_start_us(ready_us);
        self.detector.set_threshold_factor(factor);
        if let Some((passed_us, arrival)) = self.detector.next_isolated_rise(from_us) {
            let (status, arrival) = (PingStatus::Echo, Some(arrival));
            return Some(EchoRise {
                status,
                range_m: receiver.range_m(passed_us),
                arrival,
                passed_us,
            });
        }
        self.detector.rewind_to(from_us);
        let at_us = self.detector.next_rise(from_us, until_us)?;
        let status = receiver.status_at(at_us);
        // As in a detection: a carrier comparator rises at the following crest.
        let later_us = match status {
            PingStatus::Echo => self.detector.delay_us(at_us),
            _ => 0.0,
        };
        let range_m = receiver.range_m(at_us + later_us);
        let arrival = self.detector.cause(at_us);
        Some(EchoRise { status, range_m, arrival, passed_us: at_us })
    }

    /// Returns `true` if the last rise belongs to an isolated arrival. Its detection then follows
    /// from the pulse shape alone at all higher thresholds for which the margin suffices. Always
    /// `false` for detectors that do not use the envelope.
    #[must_use]
    pub fn is_isolated(&self) -> bool {
        self.detector.is_isolated()
    }

    /// Peak of the envelope for the last rise, and its level above the threshold, decibels.
    #[must_use]
    pub fn peak(&mut self, rise: &EchoRise) -> (f64, f64) {
        self.receiver.peak(self.detector.as_mut(), rise.passed_us, rise.arrival.as_ref())
    }

    /// Maximum round-trip length, metres, of arrivals that can influence the results so far; `None`
    /// if unknown longer ones could.
    #[must_use]
    pub fn max_relevant_length_m(&self) -> Option<f64> {
        self.detector.needed_m()
    }
}

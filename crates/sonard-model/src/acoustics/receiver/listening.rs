//! A firing that several receivers listen to, each with another threshold.

use super::{Incident, PulseArrival, Receiver, hearing::Hearing};
use crate::reading::PingStatus;

/// A firing listened to by receivers that differ in their threshold alone: what arrives is summed up once for all.
pub struct Listening<'a> {
    receiver: &'a Receiver,
    hearing: Hearing<'a>,
}

/// A rise of ECHO.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rise {
    /// `Echo` or `MinRange`.
    pub status: PingStatus,
    /// Half the detected path, or the range of the end of blanking, metres.
    pub range_m: f64,
    /// The arrival that drove the detector.
    pub arrival: Option<PulseArrival>,
    /// When the envelope passed the threshold, microseconds after firing: a receiver with a higher one can't be raised
    /// before.
    pub passed_us: f64,
}

impl Receiver {
    /// Listens to the arrivals of one firing, of which those up to a length there and back are known, in metres;
    /// `incident` as for [`detect_at_face`](Self::detect_at_face).
    #[must_use]
    pub fn listen<'a>(
        &'a self,
        length_m: f64,
        arrivals: &'a [PulseArrival],
        incident: &'a dyn Fn(&PulseArrival) -> Option<Incident>,
    ) -> Listening<'a> {
        let mut hearing = Hearing::new(self, arrivals, incident);
        hearing.hear_within(length_m);
        Listening { receiver: self, hearing }
    }
}

impl Listening<'_> {
    /// How the first echo is raised that a receiver with `factor` times the threshold detects, which can't be raised
    /// before `ready_us`, microseconds; `None` of silence.
    #[must_use]
    pub fn rise(&mut self, factor: f64, ready_us: f64) -> Option<Rise> {
        let receiver = self.receiver;
        let from_us = receiver.listens_from_us(ready_us);
        self.hearing.threshold_factor = factor;
        if let Some((passed_us, arrival)) = self.hearing.lone_rise_again(from_us) {
            let (status, arrival) = (PingStatus::Echo, Some(arrival));
            return Some(Rise { status, range_m: receiver.range_m(passed_us), arrival, passed_us });
        }
        self.hearing.rewind_to(from_us);
        let at_us = self.hearing.next_rise(from_us)?;
        let status = receiver.status_at(at_us);
        // As a detection tells it: a comparator of the carrier rises at the crest behind.
        let later_us = match status {
            PingStatus::Echo => self.hearing.crest_after_us(at_us),
            _ => 0.0,
        };
        let range_m = receiver.range_m(at_us + later_us);
        let arrival = self.hearing.cause(at_us);
        Some(Rise { status, range_m, arrival, passed_us: at_us })
    }

    /// Whether the rise that was told last is of an arrival with which nothing else sounds: it is told, as it rises alone, at
    /// all higher thresholds above which it reaches far enough. Never so of detectors that do not watch the envelope.
    #[must_use]
    pub fn is_lone(&self) -> bool {
        self.hearing.is_lone()
    }

    /// The most that the envelope reaches with the rise that was told last, and how far that is above its threshold,
    /// decibels.
    #[must_use]
    pub fn peak(&mut self, rise: &Rise) -> (f64, f64) {
        self.receiver.peak(&mut self.hearing, rise.passed_us, rise.arrival.as_ref())
    }

    /// Up to which length there and back arrivals matter to what was told so far, metres; `None` if longer ones than
    /// are known could.
    #[must_use]
    pub fn needed_m(&self) -> Option<f64> {
        (!self.hearing.asked_beyond()).then(|| self.hearing.needed_m())
    }
}

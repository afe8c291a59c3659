//! Oscilloscope trace of a firing.

use super::{
    characteristics::{Incident, PulseArrival, Receiver},
    detection::{Detection, Latch},
    detector::{firing::Firing, start_detector},
};

/// Signal of one firing versus time.
#[derive(Debug, Clone, PartialEq)]
pub struct EchoTrace {
    /// Evenly spaced samples from firing on.
    pub points: Vec<TracePoint>,
    /// Transmit pulse: times and envelope in the same units, clipped at 1.
    pub transmission: Vec<(f64, f64)>,
    /// Envelope peak of each arrival, shortest path first.
    pub peaks: Vec<EnvelopePeak>,
    /// Detection result for the firing.
    pub detection: Detection,
}

/// Sample of an [`EchoTrace`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// Time after firing, microseconds.
    pub t_us: f64,
    /// Envelope of the summed arrivals after gain compensation.
    pub envelope: f64,
    /// Effective detection threshold at that time.
    pub threshold: f64,
    /// Gain, decibels re the gain that compensates the spreading from a wall at 1 m.
    pub gain_db: f64,
}

/// Envelope peak of one arrival in a trace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnvelopePeak {
    /// Arrival that the peak belongs to.
    pub arrival: PulseArrival,
    /// Nominal time of flight, microseconds after firing.
    pub tof_us: f64,
    /// Peak of the arrival's own envelope and its time, microseconds after firing.
    pub peak: (f64, f64),
}

impl Receiver {
    /// Computes the trace of a firing up to `until_us`, in steps of `step_us` (at least 1
    /// microsecond).
    ///
    /// Arrivals are sorted by length; `incident` as for [`detect_at_face`](Self::detect_at_face).
    /// The transmit pulse is limited by the band filter only: ringing of the transducer is not
    /// modelled.
    #[must_use]
    pub fn trace(
        &self,
        arrivals: &[PulseArrival],
        incident: &dyn Fn(&PulseArrival) -> Option<Incident>,
        until_us: f64,
        step_us: f64,
    ) -> EchoTrace {
        let step_us = step_us.max(1.0);
        let count = (until_us.clamp(0.0, self.window_us()) / step_us) as usize;
        let mut detector = start_detector(Firing::new(self, arrivals, incident));
        let mut peaks = vec![(0.0, 0.0); arrivals.len()];
        let points = (0..=count)
            .map(|i| {
                let t_us = i as f64 * step_us;
                let envelope = detector.level(t_us);
                detector.visit_levels(t_us, &mut |index, level| {
                    if level > peaks[index].0 {
                        peaks[index] = (level, t_us);
                    }
                });
                let (threshold, gain_db) = (self.threshold_at(t_us), self.gain_db(t_us));
                TracePoint { t_us, envelope, threshold, gain_db }
            })
            .collect();
        let sent = (0..=count)
            .map(|i| i as f64 * step_us)
            .map(|t_us| (t_us, self.shape.at(t_us + self.lead_us).norm()))
            .take_while(|(t_us, sent)| *t_us < self.shape.last_us() && *sent > 1e-4);
        let reached = arrivals.iter().zip(&peaks).filter(|(_, peak)| peak.0 > 0.0);
        EchoTrace {
            points,
            transmission: sent.collect(),
            peaks: reached
                .map(|(arrival, &peak)| EnvelopePeak {
                    arrival: *arrival,
                    tof_us: self.tof_us(arrival),
                    peak,
                })
                .collect(),
            detection: self.detect_at_face(arrivals, incident, Latch::Rearmed),
        }
    }
}

//! The trace of a firing, as an oscilloscope would show it.

use super::{Detection, Incident, Latch, PulseArrival, Receiver, hearing::Hearing};

/// The signal of one firing against time.
#[derive(Debug, Clone, PartialEq)]
pub struct EchoTrace {
    /// At even spacing, from firing on.
    pub points: Vec<TracePoint>,
    /// The transmission: its envelope in the same units, cut off at 1, while it lasts.
    pub transmission: Vec<(f64, f64)>,
    /// The envelope of each arrival, shortest path first.
    pub peaks: Vec<EnvelopePeak>,
    /// The receiver's detection.
    pub detection: Detection,
}

/// A moment of a firing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// After firing, microseconds.
    pub t_us: f64,
    /// Envelope of all arrivals together, after gain compensation.
    pub envelope: f64,
    /// Least envelope that the detector notices then.
    pub threshold: f64,
    /// Gain, decibels above what makes up for the spreading from a wall at 1 m.
    pub gain_db: f64,
}

/// The envelope peak of one arrival in a trace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnvelopePeak {
    /// The arrival.
    pub arrival: PulseArrival,
    /// When it arrives by its path, microseconds after firing.
    pub tof_us: f64,
    /// The most of its own envelope, and when that is, microseconds after firing.
    pub peak: (f64, f64),
}

impl Receiver {
    /// The trace of a firing up to `until_us`, in steps of `step_us` (at least 1 microsecond).
    ///
    /// Arrivals come in order of their length; `incident` as for
    /// [`detect_at_face`](Self::detect_at_face). The transmission is the pulse as the band filter
    /// passes it: how the transducer rings after it is not modelled.
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
        let mut hearing = Hearing::new(self, arrivals, incident);
        let mut peaks = vec![(0.0, 0.0); arrivals.len()];
        let points = (0..=count)
            .map(|i| {
                let t_us = i as f64 * step_us;
                let envelope = hearing.level(t_us);
                for place in hearing.living() {
                    let share = hearing.share(place, t_us);
                    if share > peaks[place].0 {
                        peaks[place] = (share, t_us);
                    }
                }
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

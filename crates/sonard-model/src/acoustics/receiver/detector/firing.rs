//! Firings, and the interface of their detectors.

use num_complex::Complex64;

use super::super::{
    characteristics::{Incident, PulseArrival, Receiver},
    noise::NoiseTrack,
};

/// Tolerance for an echo at exactly the maximum range.
pub(in super::super) const WINDOW_SLACK_US: f64 = 1e-6;

/// Arrivals of one firing at a receiver.
#[derive(Clone, Copy)]
pub(in super::super) struct Firing<'a> {
    pub(in super::super) receiver: &'a Receiver,
    /// Arrivals, sorted by length.
    pub(in super::super) arrivals: &'a [PulseArrival],
    /// Incidence of an arrival on the face; `None` if its amplitude is used.
    pub(in super::super) incident: &'a dyn Fn(&PulseArrival) -> Option<Incident>,
    pub(in super::super) noise: Option<&'a NoiseTrack>,
    /// Round-trip length up to which all arrivals are in `arrivals`, metres.
    pub(in super::super) known_m: f64,
}

/// Detector during one firing. Times are microseconds after firing and do not decrease between
/// calls, except by [`rewind_to`](Self::rewind_to).
pub(in super::super) trait EchoDetector {
    /// Returns the next rise of ECHO for a detector that is ready from `ready_us` on, before the
    /// delay of its timing. The rise is immediate if a signal is present at that time. A rise after
    /// `until_us` may be left out.
    fn next_rise(&mut self, ready_us: f64, until_us: f64) -> Option<f64>;

    /// Delay of ECHO after a rise by the detector's timing, relative to that of the reference
    /// echo, microseconds.
    fn delay_us(&mut self, rise_us: f64) -> f64;

    /// Returns the arrival that causes a rise.
    fn cause(&mut self, rise_us: f64) -> Option<PulseArrival>;

    /// Returns the peak level during an arrival that begins at a time.
    fn peak(&mut self, t_us: f64, arrival: Option<&PulseArrival>) -> f64;

    /// Signal level at a time.
    fn level(&mut self, t_us: f64) -> f64;

    /// Effective threshold at a time.
    fn threshold_at(&self, t_us: f64) -> f64;

    /// Multiplies the receiver's threshold by a factor from now on.
    fn set_threshold_factor(&mut self, factor: f64);

    /// Rewinds to a time and discards the state of later times.
    fn rewind_to(&mut self, t_us: f64);

    /// Maximum round-trip length, metres, of arrivals that can influence the results so far;
    /// `None` if unknown arrivals beyond the known length could.
    fn needed_m(&self) -> Option<f64>;

    /// Calls `visit` with the index of each arrival in progress and its own level at a time.
    fn visit_levels(&self, t_us: f64, visit: &mut dyn FnMut(usize, f64));

    /// Returns the next rise and its arrival at a threshold not below the last one's, if both
    /// rises belong to the same isolated arrival. Earlier arrivals do not cross a higher threshold
    /// either. Returns `None` if [`next_rise`](Self::next_rise) is required.
    fn next_isolated_rise(&mut self, _from_us: f64) -> Option<(f64, PulseArrival)> {
        None
    }

    /// Returns `true` if the last rise belongs to an isolated arrival.
    fn is_isolated(&self) -> bool {
        false
    }
}

impl<'a> Firing<'a> {
    /// Firing of which all arrivals are known, without noise.
    pub(in super::super) fn new(
        receiver: &'a Receiver,
        arrivals: &'a [PulseArrival],
        incident: &'a dyn Fn(&PulseArrival) -> Option<Incident>,
    ) -> Self {
        Self { receiver, arrivals, incident, noise: None, known_m: f64::INFINITY }
    }

    /// Noise at a time.
    pub(super) fn noise_at(&self, t_us: f64) -> Complex64 {
        self.noise.map_or(Complex64::ZERO, |noise| noise.at(t_us))
    }
}

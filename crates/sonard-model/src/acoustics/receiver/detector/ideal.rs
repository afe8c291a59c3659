//! Ideal detector: separate arrivals, the wide-band limit.

use super::{
    firing::{EchoDetector, Firing, WINDOW_SLACK_US},
    pulse_track::PulseTrack,
    sum::modulus,
};
use crate::acoustics::receiver::characteristics::PulseArrival;

/// Detector to which each arrival is a separate pulse of full strength, from its nominal time on
/// and for the nominal pulse length.
pub(super) struct IdealDetector<'a> {
    /// Pulses, for the level in a trace.
    track: PulseTrack<'a>,
    threshold_factor: f64,
    /// Latest time on which a result depends.
    examined_us: f64,
}

impl<'a> IdealDetector<'a> {
    pub(super) fn new(firing: Firing<'a>) -> Self {
        Self { track: PulseTrack::new(firing), threshold_factor: 1.0, examined_us: 0.0 }
    }

    /// Arrivals that exceed the threshold individually.
    fn detectable(&self) -> impl Iterator<Item = &PulseArrival> {
        let Firing { receiver, arrivals, .. } = self.track.firing;
        let window_us = receiver.window_us() + WINDOW_SLACK_US;
        arrivals
            .iter()
            .take_while(move |arrival| receiver.tof_us(arrival) <= window_us)
            .filter(|arrival| arrival.amplitude >= self.threshold_at(receiver.tof_us(arrival)))
    }
}

impl EchoDetector for IdealDetector<'_> {
    fn next_rise(&mut self, ready_us: f64, _until_us: f64) -> Option<f64> {
        let receiver = self.track.firing.receiver;
        let lasts_until_us = |arrival: &PulseArrival| receiver.tof_us(arrival) + receiver.pulse_us;
        let found = self.detectable().find(|arrival| lasts_until_us(arrival) >= ready_us);
        let rise_us = found.map(|arrival| receiver.tof_us(arrival).max(ready_us));
        self.examined_us = self.examined_us.max(rise_us.unwrap_or(f64::MAX));
        rise_us
    }

    fn delay_us(&mut self, _rise_us: f64) -> f64 {
        0.0
    }

    /// Arrival at a time, or the strongest of those that last then.
    fn cause(&mut self, t_us: f64) -> Option<PulseArrival> {
        let receiver = self.track.firing.receiver;
        let lasting = || {
            let begun = self.detectable().take_while(|arrival| receiver.tof_us(arrival) <= t_us);
            begun.filter(|arrival| receiver.tof_us(arrival) + receiver.pulse_us >= t_us)
        };
        let strongest = || lasting().max_by(|a, b| a.amplitude.total_cmp(&b.amplitude));
        lasting().find(|arrival| receiver.tof_us(arrival) == t_us).or_else(strongest).copied()
    }

    fn peak(&mut self, _t_us: f64, arrival: Option<&PulseArrival>) -> f64 {
        arrival.map_or(0.0, |arrival| arrival.amplitude)
    }

    /// Level of the strongest pulse.
    fn level(&mut self, t_us: f64) -> f64 {
        self.track.advance(t_us);
        let mut greatest = modulus(self.track.firing.noise_at(t_us));
        self.track.visit_levels(t_us, &mut |_, level| greatest = greatest.max(level));
        greatest
    }

    fn threshold_at(&self, t_us: f64) -> f64 {
        self.threshold_factor * self.track.firing.receiver.threshold_at(t_us)
    }

    fn set_threshold_factor(&mut self, factor: f64) {
        self.threshold_factor = factor;
    }

    fn rewind_to(&mut self, t_us: f64) {
        self.track.rewind_to(t_us);
    }

    fn needed_m(&self) -> Option<f64> {
        let Firing { receiver, known_m, .. } = self.track.firing;
        let needed_m = self.examined_us * 1e-6 * receiver.sound_speed_m_s;
        (self.examined_us < receiver.arrives_us(known_m)).then_some(needed_m)
    }

    fn visit_levels(&self, t_us: f64, visit: &mut dyn FnMut(usize, f64)) {
        self.track.visit_levels(t_us, visit);
    }
}

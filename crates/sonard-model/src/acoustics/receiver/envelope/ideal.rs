//! Ideal receiver: separate arrivals, the wide-band limit.

use super::{EnvelopeSum, WINDOW_SLACK_US};
use crate::acoustics::PulseArrival;

impl EnvelopeSum<'_> {
    /// First arrival after `ready_us`, or one that lasts then.
    pub(super) fn next_rise_separate(&mut self, ready_us: f64) -> Option<f64> {
        let receiver = self.receiver;
        let lasts_until_us = |arrival: &PulseArrival| receiver.tof_us(arrival) + receiver.pulse_us;
        let found = self.detectable().find(|arrival| lasts_until_us(arrival) >= ready_us);
        let rise_us = found.map(|arrival| receiver.tof_us(arrival).max(ready_us));
        self.examined_us = self.examined_us.max(rise_us.unwrap_or(f64::MAX));
        rise_us
    }

    /// Arrival at a time, or the strongest of those that last then.
    pub(super) fn cause_separate(&self, t_us: f64) -> Option<PulseArrival> {
        let receiver = self.receiver;
        let lasting = || {
            let begun = self.detectable().take_while(|arrival| receiver.tof_us(arrival) <= t_us);
            begun.filter(|arrival| receiver.tof_us(arrival) + receiver.pulse_us >= t_us)
        };
        let strongest = || lasting().max_by(|a, b| a.amplitude.total_cmp(&b.amplitude));
        lasting().find(|arrival| receiver.tof_us(arrival) == t_us).or_else(strongest).copied()
    }

    /// Arrivals that exceed the threshold individually.
    fn detectable(&self) -> impl Iterator<Item = &PulseArrival> {
        let receiver = self.receiver;
        let window_us = receiver.window_us() + WINDOW_SLACK_US;
        self.arrivals
            .iter()
            .take_while(move |arrival| receiver.tof_us(arrival) <= window_us)
            .filter(|arrival| arrival.amplitude >= receiver.threshold_at(receiver.tof_us(arrival)))
    }
}

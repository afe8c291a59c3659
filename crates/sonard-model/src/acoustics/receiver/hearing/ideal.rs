//! Arrivals one at a time: the limit of a wide band.

use super::{Hearing, WINDOW_SLACK_US};
use crate::acoustics::PulseArrival;

impl Hearing<'_> {
    /// One arrival at a time: the first that comes after `ready_us`, or one that lasts then.
    pub(super) fn next_rise_of_one(&mut self, ready_us: f64) -> Option<f64> {
        let receiver = self.receiver;
        let lasts_until_us = |arrival: &PulseArrival| receiver.tof_us(arrival) + receiver.pulse_us;
        let found = self.loud().find(|arrival| lasts_until_us(arrival) >= ready_us);
        let rise_us = found.map(|arrival| receiver.tof_us(arrival).max(ready_us));
        self.asked_us = self.asked_us.max(rise_us.unwrap_or(f64::MAX));
        rise_us
    }

    /// The arrival that came at a time, or the strongest of those that last then.
    pub(super) fn cause_of_one(&self, t_us: f64) -> Option<PulseArrival> {
        let receiver = self.receiver;
        let lasting = || {
            let begun = self.loud().take_while(|arrival| receiver.tof_us(arrival) <= t_us);
            begun.filter(|arrival| receiver.tof_us(arrival) + receiver.pulse_us >= t_us)
        };
        let strongest = || lasting().max_by(|one, other| one.amplitude.total_cmp(&other.amplitude));
        lasting().find(|arrival| receiver.tof_us(arrival) == t_us).or_else(strongest).copied()
    }

    /// The arrivals that pass the threshold by themselves.
    fn loud(&self) -> impl Iterator<Item = &PulseArrival> {
        let receiver = self.receiver;
        let window_us = receiver.window_us() + WINDOW_SLACK_US;
        self.arrivals
            .iter()
            .take_while(move |arrival| receiver.tof_us(arrival) <= window_us)
            .filter(|arrival| arrival.amplitude >= receiver.threshold_at(receiver.tof_us(arrival)))
    }
}

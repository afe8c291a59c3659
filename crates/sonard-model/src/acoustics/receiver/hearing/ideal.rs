//! Sounds one at a time: the limit of a wide band.

use super::{Hearing, WINDOW_SLACK_US};
use crate::acoustics::Sound;

impl Hearing<'_> {
    /// One sound at a time: the first that comes after `ready_us`, or one that lasts then.
    pub(super) fn next_rise_of_one(&mut self, ready_us: f64) -> Option<f64> {
        let receiver = self.receiver;
        let lasts_until_us = |sound: &Sound| receiver.tof_us(sound) + receiver.pulse_us;
        let found = self.loud().find(|sound| lasts_until_us(sound) >= ready_us);
        let rise_us = found.map(|sound| receiver.tof_us(sound).max(ready_us));
        self.asked_us = self.asked_us.max(rise_us.unwrap_or(f64::MAX));
        rise_us
    }

    /// The sound that came at a time, or the strongest of those that last then.
    pub(super) fn cause_of_one(&self, t_us: f64) -> Option<Sound> {
        let receiver = self.receiver;
        let lasting = || {
            let begun = self.loud().take_while(|sound| receiver.tof_us(sound) <= t_us);
            begun.filter(|sound| receiver.tof_us(sound) + receiver.pulse_us >= t_us)
        };
        let strongest = || lasting().max_by(|one, other| one.amplitude.total_cmp(&other.amplitude));
        lasting().find(|sound| receiver.tof_us(sound) == t_us).or_else(strongest).copied()
    }

    /// The sounds that pass the threshold by themselves.
    fn loud(&self) -> impl Iterator<Item = &Sound> {
        let receiver = self.receiver;
        let window_us = receiver.window_us() + WINDOW_SLACK_US;
        self.sounds
            .iter()
            .take_while(move |sound| receiver.tof_us(sound) <= window_us)
            .filter(|sound| sound.amplitude >= receiver.threshold_at(receiver.tof_us(sound)))
    }
}

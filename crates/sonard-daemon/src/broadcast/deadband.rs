//! Deadband filter: suppresses readings that equal the last one sent in their direction.

use std::collections::HashMap;

use sonard_records::{Ping, PingStatus};

/// Maximum number of directions remembered by a filter; beyond it, the filter is reset.
const MAX_DIRECTIONS: usize = 1600;

/// Deadband filter of a subscriber: the last status and range sent in each direction (a motor step,
/// or a ranger of an array).
#[derive(Debug, Clone, Default)]
pub struct DeadbandFilter {
    moved_m: Option<f64>,
    sent: HashMap<(i32, u16), (PingStatus, Option<f64>)>,
    rangers: Vec<Box<str>>,
}

impl DeadbandFilter {
    /// Creates a filter with a deadband in metres; `None` passes all readings.
    #[must_use]
    pub fn new(moved_m: Option<f64>) -> Self {
        Self { moved_m, ..Self::default() }
    }

    /// Returns `true` if the filter passes all readings.
    #[must_use]
    pub const fn passes_all(&self) -> bool {
        self.moved_m.is_none()
    }

    /// Returns `true` if a reading differs by more than the deadband, or in its status, from the
    /// last one sent in its direction. The reading is then remembered as sent.
    pub fn pass_ping(&mut self, ping: &Ping) -> bool {
        self.pass(ping.step, ping.ranger.as_deref(), ping.status, ping.range_m)
    }

    pub(super) fn pass(
        &mut self,
        step: i32,
        ranger: Option<&str>,
        status: PingStatus,
        range_m: Option<f64>,
    ) -> bool {
        let Some(moved_m) = self.moved_m else { return true };
        let direction = (step, ranger.map_or(0, |id| self.ranger_number(id)));
        let is_same = self.sent.get(&direction).is_some_and(|&(last, last_m)| {
            let change_m = last_m.zip(range_m).map_or(0.0, |(last, now)| (now - last).abs());
            status == last && change_m <= moved_m
        });
        if !is_same {
            if self.sent.len() >= MAX_DIRECTIONS && !self.sent.contains_key(&direction) {
                self.sent.clear();
            }
            self.sent.insert(direction, (status, range_m));
        }
        !is_same
    }

    /// Number of a ranger by its id, from 1. The filter is reset when there are too many.
    fn ranger_number(&mut self, id: &str) -> u16 {
        let known = self.rangers.iter().position(|known| **known == *id);
        let at = known.unwrap_or_else(|| {
            if self.rangers.len() >= MAX_DIRECTIONS {
                self.rangers.clear();
                self.sent.clear();
            }
            self.rangers.push(id.into());
            self.rangers.len() - 1
        });
        at as u16 + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_bounded() {
        let mut moved = DeadbandFilter::new(Some(0.1));
        for sweep in 0..3 {
            for step in 0..MAX_DIRECTIONS as i32 {
                let passed = moved.pass(step, None, PingStatus::Echo, Some(1.0));
                assert_eq!(passed, sweep == 0, "step {step} in sweep {sweep}");
            }
        }
        for step in 0..10 * MAX_DIRECTIONS as i32 {
            moved.pass(step, None, PingStatus::Echo, Some(1.0));
            moved.pass(0, Some(&step.to_string()), PingStatus::Echo, Some(1.0));
        }
        assert!(moved.sent.len() <= MAX_DIRECTIONS && moved.rangers.len() <= MAX_DIRECTIONS);
    }
}

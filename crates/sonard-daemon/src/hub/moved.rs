//! Readings that tell nothing new, for who wants only what moved.

use std::collections::HashMap;

use sonard_records::{Ping, PingStatus};

/// Directions whose last reading a subscriber to what moved remembers; with more, it begins anew.
const DIRECTIONS: usize = 1600;

/// What was last sent for each direction (a motor step, or a ranger of an array), for who wants only what
/// moved.
#[derive(Debug, Clone, Default)]
pub struct Moved {
    moved_m: Option<f64>,
    sent: HashMap<(i32, u16), (PingStatus, Option<f64>)>,
    rangers: Vec<Box<str>>,
}

impl Moved {
    /// With everything that moved by more than this, metres; with everything, if it is `None`.
    #[must_use]
    pub fn new(moved_m: Option<f64>) -> Self {
        Self { moved_m, ..Self::default() }
    }

    /// Whether it leaves nothing out.
    #[must_use]
    pub const fn is_everything(&self) -> bool {
        self.moved_m.is_none()
    }

    /// Whether a reading differs enough from the last one sent in its direction. It counts as sent
    /// then.
    pub fn is_news_of(&mut self, ping: &Ping) -> bool {
        self.is_news(ping.step, ping.ranger.as_deref(), ping.status, ping.range_m)
    }

    pub(super) fn is_news(
        &mut self,
        step: i32,
        ranger: Option<&str>,
        status: PingStatus,
        range_m: Option<f64>,
    ) -> bool {
        let Some(moved_m) = self.moved_m else { return true };
        let direction = (step, ranger.map_or(0, |id| self.number_of(id)));
        let same = self.sent.get(&direction).is_some_and(|&(before, before_m)| {
            let moved = before_m.zip(range_m).map_or(0.0, |(before, now)| (now - before).abs());
            status == before && moved <= moved_m
        });
        if !same {
            if self.sent.len() >= DIRECTIONS && !self.sent.contains_key(&direction) {
                self.sent.clear();
            }
            self.sent.insert(direction, (status, range_m));
        }
        !same
    }

    /// From 1; those beyond the bound are forgotten together.
    fn number_of(&mut self, id: &str) -> u16 {
        let known = self.rangers.iter().position(|known| **known == *id);
        let at = known.unwrap_or_else(|| {
            if self.rangers.len() >= DIRECTIONS {
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
    fn who_wants_what_moved_remembers_a_bounded_number_of_directions() {
        let mut moved = Moved::new(Some(0.1));
        for turn in 0..3 {
            for step in 0..DIRECTIONS as i32 {
                let news = moved.is_news(step, None, PingStatus::Echo, Some(1.0));
                assert_eq!(news, turn == 0, "{step} in turn {turn}");
            }
        }
        for step in 0..10 * DIRECTIONS as i32 {
            moved.is_news(step, None, PingStatus::Echo, Some(1.0));
            moved.is_news(0, Some(&step.to_string()), PingStatus::Echo, Some(1.0));
        }
        assert!(moved.sent.len() <= DIRECTIONS && moved.rangers.len() <= DIRECTIONS);
    }
}

//! The rhythm of an array: which rangers fire in which turn, and whose sound is still on its way then.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ArrayError, MOST, RangerArray};

/// A turn of a round: the rangers that fire together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a ranger's id, or a list of ids that fire at once")]
pub enum Turn {
    /// The ranger of this id.
    One(String),
    /// The rangers of these ids, at once: each may receive the others' sound.
    Together(Vec<String>),
}

/// Another firing, whose sound a listening ranger may receive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherFiring {
    /// The ranger that fired, as an index into the array's.
    pub ranger: usize,
    /// How long before, microseconds; 0 for one at the same time.
    pub before_us: f64,
}

impl Turn {
    /// The ids of the rangers that fire.
    #[must_use]
    pub fn ids(&self) -> &[String] {
        match self {
            Self::One(id) => std::slice::from_ref(id),
            Self::Together(ids) => ids,
        }
    }
}

impl From<&str> for Turn {
    fn from(id: &str) -> Self {
        Self::One(id.to_owned())
    }
}

impl RangerArray {
    /// Indices into `rangers` by turn.
    #[must_use]
    pub fn turns(&self) -> Vec<Vec<usize>> {
        if self.firing_order.is_empty() {
            return (0..self.rangers.len()).map(|ranger| vec![ranger]).collect();
        }
        let indices =
            |turn: &Turn| turn.ids().iter().filter_map(|id| self.index_of(id)).collect::<Vec<_>>();
        self.firing_order.iter().map(indices).collect()
    }

    /// Indices into `rangers` in the order in which a round fires them; those of a turn side by side.
    pub fn round(&self) -> impl Iterator<Item = usize> {
        self.turns().into_iter().flatten()
    }

    /// How long a round, or several, takes up to the end of a firing's turn, seconds; the firing counted from 1
    /// over all rounds.
    #[must_use]
    pub fn duration_s(&self, firings: u32) -> f64 {
        let turns = self.turns();
        let in_round: usize = turns.iter().map(Vec::len).sum();
        let firings = firings as usize;
        let (whole, mut rest) = (firings / in_round.max(1), firings % in_round.max(1));
        let begun = turns.iter().take_while(|turn| {
            let is_begun = rest > 0;
            rest = rest.saturating_sub(turn.len());
            is_begun
        });
        (whole * turns.len() + begun.count()) as f64 * self.interval_ms * 1e-3
    }

    /// When each firing of so many rounds begins, seconds after the first.
    #[must_use]
    pub fn firing_times_s(&self, rounds: u32) -> Vec<f64> {
        let turns = self.turns();
        let begins_s = |turn: usize| turn as f64 * self.interval_ms * 1e-3;
        let of_round = |round: u32| {
            let first = round as usize * turns.len();
            let times = turns
                .iter()
                .zip(first..)
                .flat_map(|(turn, number)| std::iter::repeat_n(begins_s(number), turn.len()));
            times.collect::<Vec<_>>()
        };
        (0..rounds).flat_map(of_round).collect()
    }

    /// The firings whose sound can be on its way when one of a round listens, counted from 0: those of its own
    /// turn and of so many turns before, latest first. The array is taken to poll on and on, round after round.
    #[must_use]
    pub fn others(&self, firing: usize, turns_back: usize) -> Vec<OtherFiring> {
        let turns = self.turns();
        let mut first = 0;
        let own = turns.iter().position(|turn| {
            first += turn.len();
            firing < first
        });
        let Some(own) = own else { return Vec::new() };
        let among = firing + turns[own].len() - first;
        let together = turns[own].iter().enumerate().filter(|(place, _)| *place != among);
        let together = together.map(|(_, &ranger)| OtherFiring { ranger, before_us: 0.0 });
        let before = (1..=turns_back).flat_map(|back| {
            let turn = (own + turns.len() * back - back) % turns.len();
            let before_us = 1e3 * self.interval_ms * back as f64;
            turns[turn].iter().map(move |&ranger| OtherFiring { ranger, before_us })
        });
        together.chain(before).collect()
    }

    /// Whether rangers fire at once in any turn.
    #[must_use]
    pub fn fires_together(&self) -> bool {
        self.firing_order.iter().any(|turn| turn.ids().len() > 1)
    }

    pub(super) fn check_order(&self) -> Result<(), ArrayError> {
        let ordered: usize = self.firing_order.iter().map(|turn| turn.ids().len()).sum();
        if ordered > MOST {
            return Err(ArrayError::Count { field: "firing_order", count: ordered, most: MOST });
        }
        for (at, turn) in self.firing_order.iter().enumerate() {
            let (field, ids) = (format!("firing_order[{at}]"), turn.ids());
            if ids.is_empty() {
                return Err(ArrayError::EmptyTurn { field });
            }
            for (place, id) in ids.iter().enumerate() {
                if self.index_of(id).is_none() {
                    let known = self.rangers.iter().map(|ranger| ranger.id.clone()).collect();
                    return Err(ArrayError::NoSuchRanger { field, id: id.clone(), known });
                }
                if ids[..place].contains(id) {
                    return Err(ArrayError::FiredTwice { field, id: id.clone() });
                }
            }
        }
        Ok(())
    }
}

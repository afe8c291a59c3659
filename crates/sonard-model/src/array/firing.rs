//! Firing schedule of an array: slots of simultaneous firings, and interference between firings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ArrayError, MAX_ENTRIES, RangerArray};

/// Slot of a round: the rangers that fire simultaneously.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a ranger's id, or a list of ids that fire at once")]
pub enum FiringSlot {
    /// Single ranger, by id.
    Single(String),
    /// Rangers that fire simultaneously, by id: each may receive the others' sound.
    Simultaneous(Vec<String>),
}

/// Other firing whose sound a ranger may receive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InterferingFiring {
    /// Index of the ranger that fired.
    pub ranger: usize,
    /// Lead over the receiving ranger's firing, microseconds; 0 for a simultaneous firing.
    pub before_us: f64,
}

impl FiringSlot {
    /// Ids of the rangers that fire.
    #[must_use]
    pub fn ids(&self) -> &[String] {
        match self {
            Self::Single(id) => std::slice::from_ref(id),
            Self::Simultaneous(ids) => ids,
        }
    }
}

impl From<&str> for FiringSlot {
    fn from(id: &str) -> Self {
        Self::Single(id.to_owned())
    }
}

impl RangerArray {
    /// Indices into `rangers` by slot.
    #[must_use]
    pub fn slots(&self) -> Vec<Vec<usize>> {
        if self.firing_order.is_empty() {
            return (0..self.rangers.len()).map(|ranger| vec![ranger]).collect();
        }
        let indices = |turn: &FiringSlot| {
            turn.ids().iter().filter_map(|id| self.index_of(id)).collect::<Vec<_>>()
        };
        self.firing_order.iter().map(indices).collect()
    }

    /// Indices into `rangers` in the order of firing; those of a slot are adjacent.
    pub fn round(&self) -> impl Iterator<Item = usize> {
        self.slots().into_iter().flatten()
    }

    /// Time from the start to the end of a firing's slot, seconds. Firings are counted from 1 over
    /// all rounds.
    #[must_use]
    pub fn duration_s(&self, firings: u32) -> f64 {
        let turns = self.slots();
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

    /// Start of each firing of `rounds` rounds, seconds after the first.
    #[must_use]
    pub fn firing_times_s(&self, rounds: u32) -> Vec<f64> {
        let turns = self.slots();
        let begins_s = |turn: usize| turn as f64 * self.interval_ms * 1e-3;
        let round_times = |round: u32| {
            let first = round as usize * turns.len();
            let times = turns
                .iter()
                .zip(first..)
                .flat_map(|(turn, number)| std::iter::repeat_n(begins_s(number), turn.len()));
            times.collect::<Vec<_>>()
        };
        (0..rounds).flat_map(round_times).collect()
    }

    /// Firings whose sound can arrive during a firing of a round, counted from 0: those of its own
    /// slot and of `slots_back` slots before, latest first. The array is assumed to fire round
    /// after round without a pause.
    #[must_use]
    pub fn interfering_firings(&self, firing: usize, slots_back: usize) -> Vec<InterferingFiring> {
        let turns = self.slots();
        let mut first = 0;
        let own = turns.iter().position(|turn| {
            first += turn.len();
            firing < first
        });
        let Some(own) = own else { return Vec::new() };
        let among = firing + turns[own].len() - first;
        let together = turns[own].iter().enumerate().filter(|(place, _)| *place != among);
        let together = together.map(|(_, &ranger)| InterferingFiring { ranger, before_us: 0.0 });
        let before = (1..=slots_back).flat_map(|back| {
            let turn = (own + turns.len() * back - back) % turns.len();
            let before_us = 1e3 * self.interval_ms * back as f64;
            turns[turn].iter().map(move |&ranger| InterferingFiring { ranger, before_us })
        });
        together.chain(before).collect()
    }

    /// Returns `true` if any slot has simultaneous firings.
    #[must_use]
    pub fn has_simultaneous_firings(&self) -> bool {
        self.firing_order.iter().any(|turn| turn.ids().len() > 1)
    }

    pub(super) fn check_order(&self) -> Result<(), ArrayError> {
        let ordered: usize = self.firing_order.iter().map(|turn| turn.ids().len()).sum();
        if ordered > MAX_ENTRIES {
            return Err(ArrayError::Count {
                field: "firing_order",
                count: ordered,
                max: MAX_ENTRIES,
            });
        }
        for (at, turn) in self.firing_order.iter().enumerate() {
            let (field, ids) = (format!("firing_order[{at}]"), turn.ids());
            if ids.is_empty() {
                return Err(ArrayError::EmptySlot { field });
            }
            for (place, id) in ids.iter().enumerate() {
                if self.index_of(id).is_none() {
                    let known = self.rangers.iter().map(|ranger| ranger.id.clone()).collect();
                    return Err(ArrayError::UnknownRanger { field, id: id.clone(), known });
                }
                if ids[..place].contains(id) {
                    return Err(ArrayError::FiredTwice { field, id: id.clone() });
                }
            }
        }
        Ok(())
    }
}

//! What a search may cost, and the refusal of one that would cost more.
//!
//! Work is counted in steps of some tens of nanoseconds, memory in bytes, by the mechanism that asks for
//! them. Once either bound is passed every mechanism ends, and what was found is thrown away: an answer has
//! all paths, or there is none.

use std::sync::atomic::{AtomicU64, Ordering};

use super::settings::Settings;
use crate::model::{SearchPart, TooCostly};

/// The most that a search of one observation point may cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Bound {
    pub(crate) steps: u64,
    pub(crate) bytes: u64,
}

/// Two seconds or so.
pub(crate) const BOUND: Bound = Bound { steps: 50_000_000, bytes: 300_000_000 };

/// The effort of a search so far.
#[derive(Debug)]
pub(crate) struct Effort {
    most: Bound,
    /// By part of the search.
    steps: [AtomicU64; SearchPart::ALL.len()],
    total: AtomicU64,
    bytes: AtomicU64,
}

impl Effort {
    pub(crate) fn new(most: Bound) -> Self {
        Self { most, steps: Default::default(), total: AtomicU64::new(0), bytes: AtomicU64::new(0) }
    }

    /// Counts steps; false once a bound is passed.
    pub(crate) fn step(&self, part: SearchPart, count: usize) -> bool {
        add(&self.steps[part as usize], count);
        add(&self.total, count) <= self.most.steps && !self.is_over()
    }

    /// Counts what is kept of a number of items, twice for lists that grow.
    pub(crate) fn keep<T>(&self, count: usize) {
        add(&self.bytes, 2 * count * size_of::<T>());
    }

    pub(crate) fn is_over(&self) -> bool {
        self.steps() > self.most.steps || self.bytes.load(Ordering::Relaxed) > self.most.bytes
    }

    pub(crate) fn steps(&self) -> u64 {
        self.total.load(Ordering::Relaxed)
    }

    /// The refusal, if a bound was passed.
    pub(crate) fn check(&self, settings: &Settings) -> Result<(), TooCostly> {
        if !self.is_over() {
            return Ok(());
        }
        let steps = |part: &SearchPart| self.steps[*part as usize].load(Ordering::Relaxed);
        let part = SearchPart::ALL.into_iter().max_by_key(steps).unwrap_or(SearchPart::Beams);
        let Settings { max_path_m, double_diffraction, .. } = *settings;
        Err(TooCostly { part, max_path_m, double_diffraction })
    }
}

/// One thread counts at a time, so that loading and storing is enough, and cheaper.
fn add(counter: &AtomicU64, count: usize) -> u64 {
    let sum = counter.load(Ordering::Relaxed).saturating_add(count as u64);
    counter.store(sum, Ordering::Relaxed);
    sum
}

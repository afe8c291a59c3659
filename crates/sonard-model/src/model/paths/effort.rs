//! Effort limits of a search, and the error for one that exceeds them.
//!
//! Work is counted in steps of some tens of nanoseconds, memory in bytes, separately for each
//! mechanism. Once either limit is exceeded every mechanism ends and the result is discarded: a
//! search returns all paths or none.

use std::sync::atomic::{AtomicU64, Ordering};

use super::settings::PathSettings;
use crate::model::{SearchPart, TooCostly};

/// Effort limit of the search of one observation point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Bound {
    pub(crate) steps: u64,
    pub(crate) bytes: u64,
}

/// Default limit: about two seconds.
pub(crate) const BOUND: Bound = Bound { steps: 50_000_000, bytes: 300_000_000 };

/// Effort of a search so far.
#[derive(Debug)]
pub(crate) struct Effort {
    limit: Bound,
    /// Steps by part of the search.
    steps: [AtomicU64; SearchPart::ALL.len()],
    total: AtomicU64,
    bytes: AtomicU64,
}

impl Effort {
    pub(crate) fn new(limit: Bound) -> Self {
        Self {
            limit,
            steps: Default::default(),
            total: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
        }
    }

    /// Counts steps; returns `false` once a limit is exceeded.
    pub(crate) fn step(&self, part: SearchPart, count: usize) -> bool {
        add(&self.steps[part as usize], count);
        add(&self.total, count) <= self.limit.steps && !self.is_over()
    }

    /// Counts the memory of a number of kept items, doubled for growing lists.
    pub(crate) fn keep<T>(&self, count: usize) {
        add(&self.bytes, 2 * count * size_of::<T>());
    }

    pub(crate) fn is_over(&self) -> bool {
        self.steps() > self.limit.steps || self.bytes.load(Ordering::Relaxed) > self.limit.bytes
    }

    pub(crate) fn steps(&self) -> u64 {
        self.total.load(Ordering::Relaxed)
    }

    /// Returns the error if a limit was exceeded.
    pub(crate) fn check(&self, settings: &PathSettings) -> Result<(), TooCostly> {
        if !self.is_over() {
            return Ok(());
        }
        let steps = |part: &SearchPart| self.steps[*part as usize].load(Ordering::Relaxed);
        let part = SearchPart::ALL.into_iter().max_by_key(steps).unwrap_or(SearchPart::Beams);
        let PathSettings { max_path_m, double_diffraction, .. } = *settings;
        Err(TooCostly { part, max_path_m, double_diffraction })
    }
}

/// Only one thread counts at a time, so a load and a store suffice, and are cheaper.
fn add(counter: &AtomicU64, count: usize) -> u64 {
    let sum = counter.load(Ordering::Relaxed).saturating_add(count as u64);
    counter.store(sum, Ordering::Relaxed);
    sum
}

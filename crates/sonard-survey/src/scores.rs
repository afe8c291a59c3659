//! Scores of plans, kept for a search that continues after an interruption.

use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
};

/// Log-likelihoods of plans that a search has scored, by a digest of walls, poses and errors.
///
/// A search is deterministic, so the same search with these scores continues where the first one
/// ended. They hold for one program and the same world, sweeps and reflectance.
#[derive(Debug, Default)]
pub struct PlanScores {
    known: Mutex<BTreeMap<u64, f64>>,
}

impl PlanScores {
    /// Digests with their log-likelihoods, nats.
    #[must_use]
    pub fn entries(&self) -> Vec<(u64, f64)> {
        self.lock().iter().map(|(plan, nats)| (*plan, *nats)).collect()
    }

    /// Returns the log-likelihood of a plan, nats, and computes it unless it is known; an error is
    /// not kept.
    pub(crate) fn get_or<E>(
        &self,
        plan: u64,
        compute: impl FnOnce() -> Result<f64, E>,
    ) -> Result<f64, E> {
        let known = self.lock().get(&plan).copied();
        known.map_or_else(
            || {
                let nats = compute()?;
                self.lock().insert(plan, nats);
                Ok(nats)
            },
            Ok,
        )
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<u64, f64>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl FromIterator<(u64, f64)> for PlanScores {
    fn from_iter<I: IntoIterator<Item = (u64, f64)>>(entries: I) -> Self {
        Self { known: Mutex::new(entries.into_iter().collect()) }
    }
}

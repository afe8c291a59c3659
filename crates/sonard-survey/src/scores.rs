//! Scores of plans, kept for a search that continues after an interruption.

use std::{
    collections::BTreeMap,
    hash::{DefaultHasher, Hash, Hasher},
    sync::{Mutex, PoisonError},
};

use sonard_model::geometry::Pose;

use crate::arrangement::Segment;

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

    /// Returns the log-likelihood of a plan, nats, and computes it unless it is known.
    pub(crate) fn get_or(&self, plan: u64, compute: impl FnOnce() -> f64) -> f64 {
        let known = self.lock().get(&plan).copied();
        known.unwrap_or_else(|| {
            let nats = compute();
            self.lock().insert(plan, nats);
            nats
        })
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

/// Digest of walls, poses and standard deviation of ranges in metres.
pub(crate) fn plan_digest(segments: &[Segment], poses: &[Pose], sigma_m: f64) -> u64 {
    let mut hasher = DefaultHasher::new();
    segments.len().hash(&mut hasher);
    let ends = segments.iter().flat_map(|wall| [wall.a.to_array(), wall.b.to_array()]);
    let poses = poses.iter().flat_map(|pose| [pose.x_m, pose.y_m, pose.heading_deg]);
    for value in ends.flatten().chain(poses).chain([sigma_m]) {
        value.to_bits().hash(&mut hasher);
    }
    hasher.finish()
}

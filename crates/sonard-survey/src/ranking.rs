//! Ranking of candidates by their scores, and their improvement by steps.

use rayon::prelude::*;

/// Valid candidates with their scores, the best first.
pub(crate) fn ranked<T: Send>(
    candidates: Vec<T>,
    score: impl Fn(&T) -> Option<f64> + Sync,
) -> Vec<(f64, T)> {
    let mut found: Vec<(f64, T)> = candidates
        .into_par_iter()
        .filter_map(|candidate| Some((score(&candidate)?, candidate)))
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found
}

/// Candidate after up to `max_steps` moves, each to the best neighbour as long as that gains, with
/// its score.
pub(crate) fn climbed<T: Send>(
    from: T,
    max_steps: usize,
    neighbours: impl Fn(&T) -> Vec<T>,
    score: impl Fn(&T) -> Option<f64> + Sync,
) -> (f64, T) {
    let mut best = (score(&from).unwrap_or(f64::NEG_INFINITY), from);
    for _ in 0..max_steps {
        let tried = ranked(neighbours(&best.1), &score);
        let Some(better) = tried.into_iter().next().filter(|of| of.0 > best.0) else { break };
        best = better;
    }
    best
}

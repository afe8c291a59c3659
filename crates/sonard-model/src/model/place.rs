//! Where transmitter and receiver are when they are fired, surveyed as far as need be.
//!
//! The number of echo paths grows with the square of their length, and most firings are answered
//! by a short one. So the near echoes are surveyed first, and farther ones only once a firing
//! turns out to depend on them: what is found is the same.

use std::sync::{
    OnceLock,
    atomic::{AtomicUsize, Ordering},
};

use super::{Engine, Survey};
use crate::geometry::DVec2;

/// Reach of all surveys but the last, beside the longest path. What is found by a shorter one is
/// found again by the next, at about a quarter of its work.
const REACHES: [f64; 3] = [0.125, 0.25, 0.5];

/// A place with what was surveyed from it so far.
pub(super) struct Place<'a> {
    engine: &'a dyn Engine,
    /// Transmitter and receiver.
    at: [DVec2; 2],
    max_path_m: f64,
    /// Made at the first call; `None` from an engine that surveys all at once.
    near: [OnceLock<Option<Box<dyn Survey + 'a>>>; REACHES.len()],
    whole: OnceLock<Box<dyn Survey + 'a>>,
    /// Which of the surveys, from near to whole, would have settled the last firing: the next one
    /// looks beside it and is likely to need the same. The answer does not depend on it.
    enough: AtomicUsize,
}

impl<'a> Place<'a> {
    pub(super) fn new(engine: &'a dyn Engine, at: [DVec2; 2], max_path_m: f64) -> Self {
        let (near, whole) = Default::default();
        Self { engine, at, max_path_m, near, whole, enough: AtomicUsize::new(0) }
    }

    /// All echoes.
    pub(super) fn whole(&self) -> &(dyn Survey + 'a) {
        let [transmitter, receiver] = self.at;
        let survey = || {
            if transmitter == receiver {
                self.engine.survey(transmitter)
            } else {
                self.engine.survey_pair(transmitter, receiver)
            }
        };
        self.whole.get_or_init(survey).as_ref()
    }

    /// What `listen` makes of the nearest echoes that settle it, and their survey. It is told up to
    /// which length, in metres, all echoes are known, and says which length would have been
    /// enough, if any was.
    pub(super) fn nearest<T>(
        &self,
        mut listen: impl FnMut(&(dyn Survey + 'a), f64) -> (T, Option<f64>),
    ) -> (T, &(dyn Survey + 'a)) {
        let settled = |needed_m: f64| {
            let enough = REACHES.iter().position(|reach| reach * self.max_path_m > needed_m);
            self.enough.store(enough.unwrap_or(REACHES.len()), Ordering::Relaxed);
        };
        let begin = self.enough.load(Ordering::Relaxed);
        for (near, reach) in self.near.iter().zip(REACHES).skip(begin) {
            let reach_m = reach * self.max_path_m;
            let survey = near.get_or_init(|| self.engine.survey_within(self.at, reach_m));
            let Some(survey) = survey else { break };
            let (heard, needed_m) = listen(survey.as_ref(), reach_m);
            if let Some(needed_m) = needed_m {
                settled(needed_m);
                return (heard, survey.as_ref());
            }
        }
        let (heard, needed_m) = listen(self.whole(), f64::INFINITY);
        settled(needed_m.unwrap_or(f64::INFINITY));
        (heard, self.whole())
    }
}

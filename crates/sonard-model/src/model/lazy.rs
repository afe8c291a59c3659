//! Echo paths from one transducer position, computed lazily by range.
//!
//! The number of echo paths grows with the square of their length, and most firings are answered
//! by a short one. So the short paths are found first, and longer ones only once a firing
//! turns out to depend on them: what is read is the same.

use std::sync::{
    OnceLock,
    atomic::{AtomicUsize, Ordering},
};

use super::{
    cost::TooCostly,
    engine::{Arrivals, Engine},
};
use crate::geometry::DVec2;

/// Reach of all steps but the last, beside the longest path. What is found in one step is
/// found again in the next, at about a quarter of its work.
const REACHES: [f64; 3] = [0.125, 0.25, 0.5];

/// What a search came to.
type Found<'a> = Box<dyn Arrivals + 'a>;

/// Arrivals between a transmitter and a receiver, as far as they were asked for.
pub(super) struct LazyArrivals<'a> {
    engine: &'a dyn Engine,
    /// Transmitter and receiver.
    at: [DVec2; 2],
    max_path_m: f64,
    /// Found at the first call; `None` from an engine that finds all at once.
    near: [OnceLock<Result<Option<Found<'a>>, TooCostly>>; REACHES.len()],
    whole: OnceLock<Result<Found<'a>, TooCostly>>,
    /// Which of the steps, from near to whole, would have settled the last firing: the next one
    /// looks beside it and is likely to need the same. The answer does not depend on it.
    enough: AtomicUsize,
}

impl<'a> LazyArrivals<'a> {
    pub(super) fn new(engine: &'a dyn Engine, at: [DVec2; 2], max_path_m: f64) -> Self {
        let (near, whole) = Default::default();
        Self { engine, at, max_path_m, near, whole, enough: AtomicUsize::new(0) }
    }

    /// All arrivals.
    pub(super) fn whole(&self) -> Result<&(dyn Arrivals + 'a), TooCostly> {
        let [transmitter, receiver] = self.at;
        let find = || {
            if transmitter == receiver {
                self.engine.arrivals_at(transmitter)
            } else {
                self.engine.arrivals_between(transmitter, receiver)
            }
        };
        match self.whole.get_or_init(find) {
            Ok(arrivals) => Ok(arrivals.as_ref()),
            Err(error) => Err(error.clone()),
        }
    }

    /// The result of `listen` for the shortest echoes that settle it, and these. It is told up to
    /// which length, in metres, all echoes are known, and says which length would have been
    /// enough, if any was.
    pub(super) fn nearest<T>(
        &self,
        mut listen: impl FnMut(&(dyn Arrivals + 'a), f64) -> (T, Option<f64>),
    ) -> Result<(T, &(dyn Arrivals + 'a)), TooCostly> {
        let settled = |needed_m: f64| {
            let enough = REACHES.iter().position(|reach| reach * self.max_path_m > needed_m);
            self.enough.store(enough.unwrap_or(REACHES.len()), Ordering::Relaxed);
        };
        let begin = self.enough.load(Ordering::Relaxed);
        for (near, reach) in self.near.iter().zip(REACHES).skip(begin) {
            let reach_m = reach * self.max_path_m;
            let arrivals = near.get_or_init(|| self.engine.arrivals_within(self.at, reach_m));
            // Whoever asks knows nothing of steps: what is too far is the range that was asked for.
            let asked =
                |error: &TooCostly| TooCostly { max_path_m: self.max_path_m, ..error.clone() };
            let Some(arrivals) = arrivals.as_ref().map_err(asked)? else { break };
            let (heard, needed_m) = listen(arrivals.as_ref(), reach_m);
            if let Some(needed_m) = needed_m {
                settled(needed_m);
                return Ok((heard, arrivals.as_ref()));
            }
        }
        let whole = self.whole()?;
        let (heard, needed_m) = listen(whole, f64::INFINITY);
        settled(needed_m.unwrap_or(f64::INFINITY));
        Ok((heard, whole))
    }
}

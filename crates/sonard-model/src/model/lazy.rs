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
    engine::{Arrival, Arrivals, Engine},
};
use crate::{
    acoustics::{Incident, PulseArrival},
    geometry::DVec2,
};

/// Reach of all steps but the last, beside the longest path. What is found in one step is
/// found again in the next, at about a quarter of its work; beside a round body at more.
const REACHES: [f64; 3] = [0.125, 0.25, 0.5];

/// The step that has all paths.
const WHOLE: usize = REACHES.len();

/// What a search came to.
type Found<'a> = Box<dyn Arrivals + 'a>;

/// How far observation points have lately had to search, as the number of a step: from the next one it is searched as
/// far at once, if at all. Only what is searched for in vain depends on it.
#[derive(Debug, Default)]
pub(super) struct Expected(AtomicUsize);

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
    /// The farthest of the steps that settled a firing, counted from 1; 0 before any.
    farthest: AtomicUsize,
    expected: &'a Expected,
}

/// Arrivals up to a length, of a search that went so far or farther.
pub(super) struct Near<'a> {
    arrivals: &'a dyn Arrivals,
    /// Length there and back up to which all are known, metres.
    pub(super) reach_m: f64,
}

impl Arrivals for Near<'_> {
    fn listen(&self, direction_rad: f64, arrivals: &mut Vec<PulseArrival>) {
        self.arrivals.listen_within(direction_rad, self.reach_m, arrivals);
    }

    fn arrival(&self, direction_rad: f64, arrival: &PulseArrival) -> Arrival {
        self.arrivals.arrival_within(direction_rad, self.reach_m, arrival)
    }

    fn incident(&self, direction_rad: f64, arrival: &PulseArrival) -> Incident {
        self.arrivals.incident_within(direction_rad, self.reach_m, arrival)
    }
}

impl<'a> LazyArrivals<'a> {
    pub(super) fn new(
        engine: &'a dyn Engine,
        at: [DVec2; 2],
        max_path_m: f64,
        expected: &'a Expected,
    ) -> Self {
        let (near, whole, farthest) = Default::default();
        Self {
            engine,
            at,
            max_path_m,
            near,
            whole,
            enough: AtomicUsize::new(0),
            farthest,
            expected,
        }
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
        mut listen: impl FnMut(&Near) -> (T, Option<f64>),
    ) -> Result<(T, Near<'_>), TooCostly> {
        let settled = |needed_m: f64| {
            let enough = REACHES.iter().position(|reach| reach * self.max_path_m > needed_m);
            let enough = enough.unwrap_or(WHOLE);
            self.enough.store(enough, Ordering::Relaxed);
            self.farthest.fetch_max(enough + 1, Ordering::Relaxed);
        };
        let begin = self.enough.load(Ordering::Relaxed);
        for (step, reach) in REACHES.iter().enumerate().skip(begin) {
            let Some(arrivals) = self.reaching(step)? else { break };
            let near = Near { arrivals, reach_m: reach * self.max_path_m };
            let (heard, needed_m) = listen(&near);
            if let Some(needed_m) = needed_m {
                settled(needed_m);
                return Ok((heard, near));
            }
        }
        let whole = Near { arrivals: self.whole()?, reach_m: f64::INFINITY };
        let (heard, needed_m) = listen(&whole);
        settled(needed_m.unwrap_or(f64::INFINITY));
        Ok((heard, whole))
    }

    /// Arrivals at least up to the reach of a step: those that are known, or those of a search that goes as far as
    /// expected. `None` from an engine that finds all at once.
    fn reaching(&self, step: usize) -> Result<Option<&(dyn Arrivals + 'a)>, TooCostly> {
        if let Some(known) = (step..WHOLE).find(|&at| matches!(self.near[at].get(), Some(Ok(_)))) {
            return self.search(known);
        }
        if let Some(Ok(whole)) = self.whole.get() {
            return Ok(Some(whole.as_ref()));
        }
        let expected = step.max(self.expected.0.load(Ordering::Relaxed));
        // What is expected may be more than can be found here, and is not asked for yet.
        self.search(expected).or_else(|_| self.search(step))
    }

    /// All arrivals up to the reach of a step.
    fn search(&self, step: usize) -> Result<Option<&(dyn Arrivals + 'a)>, TooCostly> {
        let (Some(near), Some(reach)) = (self.near.get(step), REACHES.get(step)) else {
            return self.whole().map(Some);
        };
        let reach_m = reach * self.max_path_m;
        let found = near.get_or_init(|| self.engine.arrivals_within(self.at, reach_m));
        // Whoever asks knows nothing of steps: what is too far is the range that was asked for.
        let asked = |error: &TooCostly| TooCostly { max_path_m: self.max_path_m, ..error.clone() };
        Ok(found.as_ref().map_err(asked)?.as_deref())
    }
}

impl Drop for LazyArrivals<'_> {
    fn drop(&mut self) {
        if let Some(farthest) = self.farthest.get_mut().checked_sub(1) {
            self.expected.0.store(farthest, Ordering::Relaxed);
        }
    }
}

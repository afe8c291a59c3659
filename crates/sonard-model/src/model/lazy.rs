//! Echo paths from one transducer position, computed lazily by range.
//!
//! The number of echo paths grows with the square of their length, and most firings are answered
//! by a short one. So the short paths are found first, and longer ones only once a firing
//! turns out to depend on them: what is read is the same.

use std::sync::{
    OnceLock,
    atomic::{AtomicU64, AtomicUsize, Ordering},
};

use smallvec::SmallVec;

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

/// A search goes so much farther than the last one had to.
const AHEAD: f64 = 1.1;

/// From this part of the longest path on a search goes all the way.
const NEARLY_ALL: f64 = 0.8;

/// What a search came to.
type Found<'a> = Box<dyn Arrivals + 'a>;

/// How far the last observation point had to search, there and back: the next one begins with a search as far. Only
/// what is searched for in vain depends on it.
#[derive(Debug, Default)]
pub(super) struct Expected(AtomicU64);

/// Arrivals between a transmitter and a receiver, as far as they were asked for.
pub(super) struct LazyArrivals<'a> {
    engine: &'a dyn Engine,
    /// Transmitter and receiver.
    at: [DVec2; 2],
    max_path_m: f64,
    /// From near to far.
    steps: SmallVec<[Step<'a>; 4]>,
    whole: OnceLock<Result<Found<'a>, TooCostly>>,
    /// Which of the steps is searched first, if it is not nearer than what is asked for; their number for the whole.
    first: usize,
    /// Which of the steps, from near to whole, would have settled the last firing: the next one
    /// looks beside it and is likely to need the same. The answer does not depend on it.
    enough: AtomicUsize,
    /// The length that settled all firings, metres, as bits, by which positive numbers sort.
    needed_m: AtomicU64,
    expected: &'a Expected,
}

/// A search up to a length.
struct Step<'a> {
    reach_m: f64,
    /// Found at the first call; `None` from an engine that finds all at once.
    found: OnceLock<Result<Option<Found<'a>>, TooCostly>>,
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
        let step = |reach_m: f64| Step { reach_m, found: OnceLock::new() };
        let mut steps: SmallVec<[Step; 4]> =
            REACHES.iter().map(|reach| step(reach * max_path_m)).collect();
        let ahead_m = AHEAD * f64::from_bits(expected.0.load(Ordering::Relaxed));
        let first = if ahead_m > NEARLY_ALL * max_path_m {
            steps.len()
        } else {
            let at = steps.partition_point(|step| step.reach_m < ahead_m);
            if ahead_m > 0.0 {
                steps.insert(at, step(ahead_m));
            }
            at
        };
        let (whole, enough, needed_m) = Default::default();
        Self { engine, at, max_path_m, steps, whole, first, enough, needed_m, expected }
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
            let enough = self.steps.iter().position(|step| step.reach_m > needed_m);
            self.enough.store(enough.unwrap_or(self.steps.len()), Ordering::Relaxed);
            self.needed_m.fetch_max(needed_m.max(0.0).to_bits(), Ordering::Relaxed);
        };
        let begin = self.enough.load(Ordering::Relaxed);
        for (at, step) in self.steps.iter().enumerate().skip(begin) {
            let Some(arrivals) = self.reaching(at)? else { break };
            let near = Near { arrivals, reach_m: step.reach_m };
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
        let is_known = |at: &usize| matches!(self.steps[*at].found.get(), Some(Ok(_)));
        if let Some(known) = (step..self.steps.len()).find(is_known) {
            return self.search(known);
        }
        if let Some(Ok(whole)) = self.whole.get() {
            return Ok(Some(whole.as_ref()));
        }
        // What is expected may be more than can be found here, and is not asked for yet.
        self.search(step.max(self.first)).or_else(|_| self.search(step))
    }

    /// All arrivals up to the reach of a step.
    fn search(&self, step: usize) -> Result<Option<&(dyn Arrivals + 'a)>, TooCostly> {
        let Some(Step { reach_m, found }) = self.steps.get(step) else {
            return self.whole().map(Some);
        };
        let found = found.get_or_init(|| self.engine.arrivals_within(self.at, *reach_m));
        // Whoever asks knows nothing of steps: what is too far is the range that was asked for.
        let asked = |error: &TooCostly| TooCostly { max_path_m: self.max_path_m, ..error.clone() };
        Ok(found.as_ref().map_err(asked)?.as_deref())
    }
}

impl Drop for LazyArrivals<'_> {
    fn drop(&mut self) {
        let needed_m = *self.needed_m.get_mut();
        if needed_m > 0 {
            self.expected.0.store(needed_m, Ordering::Relaxed);
        }
    }
}

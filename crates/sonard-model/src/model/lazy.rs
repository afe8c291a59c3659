//! Echo paths from one transducer position, computed lazily by range.
//!
//! The number of echo paths grows with the square of their length, and most firings are decided by
//! a short one. The short paths are therefore found first, and longer ones only once a firing turns
//! out to depend on them. The readings are the same.

use std::sync::{
    OnceLock,
    atomic::{AtomicU64, AtomicUsize, Ordering},
};

use smallvec::SmallVec;

use super::{
    cost::TooCostly,
    engine::{Arrival, Arrivals, Engine},
    paths::EchoSet,
};
use crate::{
    acoustics::{Incident, PulseArrival},
    geometry::DVec2,
};

/// Reach of all steps but the last, as shares of the longest path. The paths of one step are found
/// again in the next, at about a quarter of its work; near a round body at more.
const REACHES: [f64; 3] = [0.125, 0.25, 0.5];

/// Factor by which a search reaches beyond the last one's requirement.
const AHEAD: f64 = 1.1;

/// Share of the longest path from which on a search is complete.
const NEARLY_ALL: f64 = 0.9;

/// Result of a search.
type SearchResult<'a> = Box<dyn Arrivals + 'a>;

/// Length there and back that the last observation point required: the next one begins with a
/// search of that length. It only affects unnecessary work.
#[derive(Debug, Default)]
pub(super) struct ReachEstimate(AtomicU64);

/// Arrivals between a transmitter and a receiver, as far as they were requested.
pub(super) struct LazyArrivals<'a> {
    engine: &'a dyn Engine,
    /// Positions of transmitter and receiver (world, metres).
    at: [DVec2; 2],
    max_path_m: f64,
    /// Steps from near to far.
    steps: SmallVec<[SearchStep<'a>; 4]>,
    whole: OnceLock<Result<SearchResult<'a>, TooCostly>>,
    /// Index of the step that is searched first, unless a farther one is requested; the number of
    /// steps means a complete search.
    first: usize,
    /// Index of the step, from near to complete, that would have decided the last firing. The next
    /// firing has a similar direction and is likely to need the same. The result does not depend on
    /// it.
    enough: AtomicUsize,
    /// Length that decided all firings, metres, as bits, which sort like the positive numbers.
    needed_m: AtomicU64,
    expected: &'a ReachEstimate,
}

/// A search up to a length.
struct SearchStep<'a> {
    reach_m: f64,
    /// Result of the first call; `None` from an engine that finds all paths at once.
    found: OnceLock<Result<Option<SearchResult<'a>>, TooCostly>>,
}

/// Arrivals up to a length, from a search of at least that length.
pub(super) struct NearArrivals<'a> {
    arrivals: &'a dyn Arrivals,
    /// Length there and back up to which all arrivals are known, metres.
    pub(super) reach_m: f64,
}

impl Arrivals for NearArrivals<'_> {
    fn collect_arrivals(&self, direction_rad: f64, arrivals: &mut Vec<PulseArrival>) {
        self.arrivals.collect_arrivals_within(direction_rad, self.reach_m, arrivals);
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
        expected: &'a ReachEstimate,
    ) -> Self {
        let step = |reach_m: f64| SearchStep { reach_m, found: OnceLock::new() };
        let mut steps: SmallVec<[SearchStep; 4]> =
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

    /// Returns all arrivals, from a complete search.
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

    /// Returns the result of `predict` for the shortest echoes that decide it, and these echoes.
    /// `predict` receives the arrivals with the length, in metres, up to which all are known, and
    /// also returns the length that would have been enough, if any was.
    pub(super) fn nearest<T>(
        &self,
        mut predict: impl FnMut(&NearArrivals) -> (T, Option<f64>),
    ) -> Result<(T, NearArrivals<'_>), TooCostly> {
        let record = |needed_m: f64| {
            let enough = self.steps.iter().position(|step| step.reach_m > needed_m);
            self.enough.store(enough.unwrap_or(self.steps.len()), Ordering::Relaxed);
            self.needed_m.fetch_max(needed_m.max(0.0).to_bits(), Ordering::Relaxed);
        };
        let begin = self.enough.load(Ordering::Relaxed);
        for (at, step) in self.steps.iter().enumerate().skip(begin) {
            let Some(arrivals) = self.reaching(at)? else { break };
            let near = NearArrivals { arrivals, reach_m: step.reach_m };
            let (result, needed_m) = predict(&near);
            if let Some(needed_m) = needed_m {
                record(needed_m);
                return Ok((result, near));
            }
        }
        let whole = NearArrivals { arrivals: self.whole()?, reach_m: f64::INFINITY };
        let (result, needed_m) = predict(&whole);
        record(needed_m.unwrap_or(f64::INFINITY));
        Ok((result, whole))
    }

    /// Lists all echoes up to a length there and back, in metres; `None` from an engine without such
    /// a list.
    pub(super) fn echo_set(&self, length_m: f64) -> Result<Option<EchoSet>, TooCostly> {
        let step = self.steps.partition_point(|step| step.reach_m < length_m);
        let arrivals = match self.reaching(step)? {
            Some(arrivals) => arrivals,
            None => self.whole()?,
        };
        Ok(arrivals.echo_set(length_m))
    }

    /// Returns arrivals at least up to the reach of a step: the known ones, or those of a search up
    /// to the expected length. `None` from an engine that finds all paths at once.
    fn reaching(&self, step: usize) -> Result<Option<&(dyn Arrivals + 'a)>, TooCostly> {
        let is_known = |at: &usize| matches!(self.steps[*at].found.get(), Some(Ok(_)));
        if let Some(known) = (step..self.steps.len()).find(is_known) {
            return self.search(known);
        }
        if let Some(Ok(whole)) = self.whole.get() {
            return Ok(Some(whole.as_ref()));
        }
        // The expected length may exceed the effort limit here, and is not requested yet.
        self.search(step.max(self.first)).or_else(|_| self.search(step))
    }

    /// Returns all arrivals up to the reach of a step.
    fn search(&self, step: usize) -> Result<Option<&(dyn Arrivals + 'a)>, TooCostly> {
        let Some(SearchStep { reach_m, found }) = self.steps.get(step) else {
            return self.whole().map(Some);
        };
        let found = found.get_or_init(|| self.engine.arrivals_within(self.at, *reach_m));
        // Steps are internal: the error names the requested range instead of the step's.
        let requested =
            |error: &TooCostly| TooCostly { max_path_m: self.max_path_m, ..error.clone() };
        Ok(found.as_ref().map_err(requested)?.as_deref())
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

//! Slopes: possible climb of a beam's rays after the low and hanging walls that it hit or passed.
//!
//! Beams are traced in the plan, where a wall that ends below the ceiling both reflects and lets
//! pass. With floor and ceiling treated as windows a ray climbs evenly, so at a given distance its
//! slope leads either to such a wall or past it. A beam therefore keeps the set of slopes that
//! remain possible, and ends when the set is empty. The number of beams then grows as in space and
//! does not double at each low wall. The distance to a wall differs between the rays of a beam, so
//! the kept set is slightly larger than that of its rays; listed paths are checked again at their
//! own slope.

use std::ops::Range;

use smallvec::SmallVec;

use crate::model::paths::floor::{ALL_SLOPES, united};

/// Tolerance of distances to walls, for snapped walls and rays on ties, metres.
const LOOSE_M: f64 = 1e-5;

/// Numbered sets of slopes (metres of climb per metre in the plan).
#[derive(Debug, Default)]
pub(crate) struct Slopes {
    /// Ranges in `spans` of set 1 onwards.
    sets: Vec<Range<u32>>,
    spans: Vec<[f64; 2]>,
}

const FULL_RANGE: [[f64; 2]; 1] = [[f64::NEG_INFINITY, f64::INFINITY]];

impl Slopes {
    /// Intervals of a set: closed, ascending and disjoint.
    fn spans(&self, set: u32) -> &[[f64; 2]] {
        (set as usize)
            .checked_sub(1)
            .and_then(|index| self.sets.get(index))
            .map_or(&FULL_RANGE, |set| &self.spans[set.start as usize..set.end as usize])
    }

    /// Memory in use, in intervals; a set counts as half an interval.
    pub(crate) fn kept(&self) -> usize {
        self.spans.len() + self.sets.len() / 2
    }

    /// Returns `true` if a set has a slope from `low` to `high`.
    pub(crate) fn any_in(&self, set: u32, [low, high]: [f64; 2]) -> bool {
        let spans = self.spans(set);
        let next = spans.partition_point(|span| span[1] < low);
        spans.get(next).is_some_and(|span| span[0] <= high)
    }

    /// Returns `true` if a set has the slope of a ray that climbs `climb_m` over `run_m` of the
    /// plan.
    pub(crate) fn holds(&self, set: u32, climb_m: f64, run_m: f64) -> bool {
        let slope = climb_m / run_m;
        set == ALL_SLOPES || slope.is_nan() || self.any_in(set, [slope; 2])
    }

    /// Intersects a set with the slopes that lead to one of `climbs` at a distance in range, no
    /// steeper than `steepest`. Returns the number of the result, `None` if it is empty.
    pub(crate) fn narrow(
        &mut self,
        set: u32,
        climbs: &[[f64; 2]],
        [near_m, far_m]: [f64; 2],
        steepest: f64,
    ) -> Option<u32> {
        let (near_m, far_m) = ((near_m - LOOSE_M).max(LOOSE_M), far_m + LOOSE_M);
        let old = self.spans(set);
        let mut left: SmallVec<[[f64; 2]; 8]> = SmallVec::new();
        let mut at = 0;
        for &[low_m, high_m] in climbs {
            let low = (low_m / if low_m < 0.0 { near_m } else { far_m }).max(-steepest);
            let high = (high_m / if high_m < 0.0 { far_m } else { near_m }).min(steepest);
            // Both ends ascend from one climb to the next; spans below this one are behind all that
            // follow.
            while old.get(at).is_some_and(|span| span[1] < low) {
                at += 1;
            }
            for span in old[at..].iter().take_while(|span| span[0] <= high) {
                let (low, high) = (low.max(span[0]), high.min(span[1]));
                match left.last_mut() {
                    Some(last) if low <= last[1] => last[1] = last[1].max(high),
                    _ if low <= high => left.push([low, high]),
                    _ => {}
                }
            }
        }
        if left.is_empty() {
            return None;
        }
        Some(if left[..] == *old { set } else { self.add(&left) })
    }

    /// Returns the union of two sets.
    pub(crate) fn union(&mut self, a: u32, b: u32) -> u32 {
        if a == b || a == ALL_SLOPES || b == ALL_SLOPES {
            return if a == b { a } else { ALL_SLOPES };
        }
        let both = [self.spans(a), self.spans(b)].concat();
        self.add(&united(both))
    }

    fn add(&mut self, spans: &[[f64; 2]]) -> u32 {
        let from = self.spans.len() as u32;
        self.spans.extend_from_slice(spans);
        self.sets.push(from..self.spans.len() as u32);
        self.sets.len() as u32
    }
}

//! Slopes: how steeply rays of a beam can climb, after the low and hanging walls that it met and passed.
//!
//! Beams are traced in the plan, where a wall that ends below the ceiling both reflects and lets pass. But a
//! ray climbs evenly if floor and ceiling are windows, and at one distance a slope leads either to such a
//! wall or past it. A beam therefore keeps the slopes that all it met and passed leave to its rays; without
//! one it ends. So the number of beams grows as in space, and does not double at each low wall. The distance
//! to a wall differs from ray to ray of a beam, so the slopes kept are some more than those of its rays:
//! what is listed is asked again, at its own slope.

use std::ops::Range;

use smallvec::SmallVec;

use crate::model::paths::plan::{ALL_SLOPES, united};

/// Distances to walls may be off by this much where walls were snapped and rays run on ties, metres.
const LOOSE_M: f64 = 1e-5;

/// Sets of slopes (metres climbed a metre of the plan), by number.
#[derive(Debug, Default)]
pub(crate) struct Slopes {
    /// From set 1 on.
    sets: Vec<Range<u32>>,
    spans: Vec<[f64; 2]>,
}

const EACH: [[f64; 2]; 1] = [[f64::NEG_INFINITY, f64::INFINITY]];

impl Slopes {
    /// A set: closed intervals, rising and apart.
    fn spans(&self, set: u32) -> &[[f64; 2]] {
        (set as usize)
            .checked_sub(1)
            .and_then(|index| self.sets.get(index))
            .map_or(&EACH, |set| &self.spans[set.start as usize..set.end as usize])
    }

    /// How many intervals are kept, and sets, of half an interval each.
    pub(crate) fn kept(&self) -> usize {
        self.spans.len() + self.sets.len() / 2
    }

    /// Whether a set has a slope from `low` to `high`.
    pub(crate) fn any_in(&self, set: u32, [low, high]: [f64; 2]) -> bool {
        let spans = self.spans(set);
        let next = spans.partition_point(|span| span[1] < low);
        spans.get(next).is_some_and(|span| span[0] <= high)
    }

    /// Whether a ray that gains so much height over so much of the plan is in a set, metres.
    pub(crate) fn holds(&self, set: u32, climb_m: f64, run_m: f64) -> bool {
        let slope = climb_m / run_m;
        set == ALL_SLOPES || slope.is_nan() || self.any_in(set, [slope; 2])
    }

    /// Those of a set that climb to one of `climbs` at some distance, and no steeper than `steepest`; `None` if
    /// there are none.
    pub(crate) fn reaching(
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
            // Both ends rise from one climb to the next; what lies below is behind all that follow.
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

    /// The slopes of either set.
    pub(crate) fn either(&mut self, one: u32, other: u32) -> u32 {
        if one == other || one == ALL_SLOPES || other == ALL_SLOPES {
            return if one == other { one } else { ALL_SLOPES };
        }
        let both = [self.spans(one), self.spans(other)].concat();
        self.add(&united(both))
    }

    fn add(&mut self, spans: &[[f64; 2]]) -> u32 {
        let from = self.spans.len() as u32;
        self.spans.extend_from_slice(spans);
        self.sets.push(from..self.spans.len() as u32);
        self.sets.len() as u32
    }
}

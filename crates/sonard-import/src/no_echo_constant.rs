//! Detection of constants that drivers write for no echo.
//!
//! Most files encode a time-out as a number: the sensor's maximum range, a full register, or a
//! constant of the driver. Such a number repeats exactly, is the maximum or close to it, and occurs
//! in many directions. A wall at one distance, in contrast, fills a single arc. The same rule
//! serves every format.

use std::collections::BTreeMap;

use crate::FileLocation;

/// Maximum number of distinct values that are counted.
const MAX_VALUES: usize = 1024;
/// Number of the greatest values that are always counted, however rare.
const TOP_VALUES: usize = 64;
/// Minimum share of its arc that a wall at one distance fills; a constant interleaved with ranges
/// fills less.
const MIN_FILL: f64 = 0.93;
/// Minimum share of the ranges in its directions that a wall has.
const MIN_SHARE: f64 = 0.6;
/// Full registers and round numbers used by drivers, in the unit of the file.
const CODES: [f64; 19] = [
    255.0,
    511.0,
    999.0,
    1023.0,
    2047.0,
    4095.0,
    8190.0,
    8191.0,
    9999.0,
    16_383.0,
    32_767.0,
    32_768.0,
    38_000.0,
    65_533.0,
    65_534.0,
    65_535.0,
    99_999.0,
    2_147_483_647.0,
    4_294_967_295.0,
];
/// Share of the sensor's maximum range from which a value counts as that range, with rounding.
const AT_LONGEST: f64 = 0.9965;

/// Kind of the direction of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DirectionKind {
    /// Angle of a rotating ranger: a wall appears at adjacent angles.
    Angles,
    /// Index of a ranger of an array: different rangers do not measure the same distance to a wall.
    Rangers,
}

/// Bit set of directions, in whole degrees or ranger indices.
type Directions = [u64; 6];

#[derive(Debug, Clone)]
struct ValueCount {
    count: u64,
    first: FileLocation,
    directions: Directions,
}

/// Histogram of the ranges of a file, in bounded memory.
#[derive(Debug)]
pub(crate) struct RangeHistogram {
    kind: DirectionKind,
    count: u64,
    visited: Directions,
    /// Counts of the greatest and of the frequent values; the bits of positive floats sort like the
    /// numbers.
    values: BTreeMap<u64, ValueCount>,
    /// Count up to which values below the greatest were dropped.
    dropped: u64,
    /// Counts of values of zero or less.
    non_positive: BTreeMap<i64, (f64, u64, FileLocation)>,
    is_non_positive_full: bool,
    /// Logarithmic bins of 1 %, to detect a constant with noise.
    bins: BTreeMap<i32, Bin>,
}

#[derive(Debug, Clone)]
struct Bin {
    count: u64,
    min: f64,
    directions: Directions,
}

/// Constant that is probably written for no echo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NoEchoConstant {
    /// Value in the unit of the file; the minimum of a cluster.
    pub(crate) value: f64,
    /// True if the values scatter about the constant.
    pub(crate) is_cluster: bool,
    pub(crate) count: u64,
    pub(crate) of: u64,
    pub(crate) first: Option<FileLocation>,
    /// Evidence, for the message.
    pub(crate) why: &'static str,
}

/// Returns the median gap between the other values, which is large where numbers have few digits.
fn usual_gap(falling: &[(f64, &ValueCount)], value: f64) -> f64 {
    let others: Vec<f64> =
        falling.iter().map(|(other, _)| *other).filter(|other| *other != value).collect();
    let mut gaps: Vec<f64> = others.windows(2).map(|pair| pair[0] - pair[1]).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied().unwrap_or(0.0)
}

/// Value of zero or less.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NonPositive {
    pub(crate) value: f64,
    pub(crate) count: u64,
    pub(crate) first: FileLocation,
}

const MAX_NON_POSITIVE: usize = 16;

impl RangeHistogram {
    pub(crate) const fn new(kind: DirectionKind) -> Self {
        Self {
            kind,
            count: 0,
            visited: [0; 6],
            values: BTreeMap::new(),
            dropped: 0,
            non_positive: BTreeMap::new(),
            is_non_positive_full: false,
            bins: BTreeMap::new(),
        }
    }

    /// Counts a range in the unit of the file; `direction` is an angle in degrees or the index of a
    /// ranger.
    pub(crate) fn add(&mut self, place: FileLocation, value: f64, direction: f64) {
        if !value.is_finite() {
            return;
        }
        self.count += 1;
        if value <= 0.0 {
            let key = (value * 1e6).round() as i64;
            self.is_non_positive_full |= self.non_positive.len() >= MAX_NON_POSITIVE
                && !self.non_positive.contains_key(&key);
            if !self.is_non_positive_full {
                self.non_positive.entry(key).or_insert((value, 0, place)).1 += 1;
            }
            return;
        }
        let index = (direction.rem_euclid(360.0) as usize).min(359);
        let mark = |directions: &mut Directions| directions[index / 64] |= 1 << (index % 64);
        mark(&mut self.visited);
        let seen = self.values.entry(value.to_bits());
        let seen = seen.or_insert(ValueCount { count: 0, first: place, directions: [0; 6] });
        seen.count += 1;
        mark(&mut seen.directions);
        if self.values.len() > MAX_VALUES {
            self.drop_rare_values();
        }
        let bin = (value.ln() * 100.0).floor() as i32;
        let bin = self.bins.entry(bin);
        let bin = bin.or_insert(Bin { count: 0, min: value, directions: [0; 6] });
        bin.count += 1;
        bin.min = bin.min.min(value);
        mark(&mut bin.directions);
    }

    /// Drops the rarest values below the greatest ones, until half of the room is free (lossy
    /// counting).
    fn drop_rare_values(&mut self) {
        let top = self.values.keys().rev().nth(TOP_VALUES - 1).copied().unwrap_or_default();
        while self.values.len() > MAX_VALUES / 2 {
            self.dropped += 1;
            let dropped = self.dropped;
            self.values.retain(|bits, seen| *bits >= top || seen.count > dropped);
        }
    }

    /// Returns the values of zero or less, the most frequent first.
    pub(crate) fn non_positive(&self) -> Vec<NonPositive> {
        let all = self.non_positive.values().map(|&(value, count, first)| NonPositive {
            value,
            count,
            first,
        });
        let mut all: Vec<_> = all.collect();
        all.sort_by_key(|non_positive| std::cmp::Reverse(non_positive.count));
        all
    }

    /// Returns a quantile of the positive values, to 1 %.
    pub(crate) fn quantile(&self, share: f64) -> Option<f64> {
        let all: u64 = self.bins.values().map(|bin| bin.count).sum();
        let mut cumulative = 0;
        let at = self.bins.values().find(|bin| {
            cumulative += bin.count;
            cumulative as f64 >= share * all as f64
        });
        at.map(|bin| bin.min)
    }

    /// Returns the constant written for no echo, if any; `longest` is the sensor's maximum range in
    /// the file's unit.
    pub(crate) fn constant(&self, longest: f64) -> Option<NoEchoConstant> {
        let longest = if longest > 0.0 { longest } else { f64::INFINITY };
        let falling: Vec<(f64, &ValueCount)> =
            self.values.iter().rev().map(|(bits, seen)| (f64::from_bits(*bits), seen)).collect();
        let of = self.count;
        let mut counts: Vec<u64> = falling.iter().map(|(_, seen)| seen.count).collect();
        counts.sort_unstable_by(|a, b| b.cmp(a));
        let [most, second] = [0, 1].map(|rank| counts.get(rank).copied().unwrap_or(0));
        let cluster = self.cluster(longest);
        for (rank, &(value, seen)) in falling.iter().enumerate() {
            let max_other_count = if seen.count == most { second } else { most };
            let share = seen.count as f64 / of as f64;
            let is_top = rank == 0;
            let is_frequent = seen.count >= 6 && share >= 0.05 && seen.count >= 5 * max_other_count;
            if !is_top && !is_frequent {
                continue;
            }
            let is_apart = || {
                let next_lower = falling.get(rank + 1).map(|(value, _)| *value);
                next_lower.is_some_and(|next_lower| {
                    let gap = value - next_lower;
                    gap > 0.05 * value && gap > 4.0 * usual_gap(&falling, value)
                })
            };
            let many = self.is_scattered(&seen.directions, seen.count);
            let is_at_longest = value >= AT_LONGEST * longest;
            let is_code = CODES.contains(&value);
            let why = if is_at_longest && seen.count >= 3 && share >= 0.01 {
                Some("at or beyond the maximum range of the sensor")
            } else if is_code
                && seen.count >= 3
                && is_top
                && (many || (value >= 1023.0 && is_apart()))
            {
                Some("a number that drivers write for no echo")
            } else if is_top && seen.count >= 3 && share >= 0.03 && many && is_apart() {
                Some("the greatest value, apart from the others and in many directions")
            } else if many && is_frequent && max_other_count > 0 && (is_top || share >= 0.1) {
                Some("far more frequent than any other value, and in many directions")
            } else {
                None
            };
            if let Some(why) = why {
                let (count, first) = (seen.count, Some(seen.first));
                // One value of a noisy constant.
                if let Some(cluster) = cluster.filter(|cluster| cluster.count > 2 * count) {
                    return Some(cluster);
                }
                return Some(NoEchoConstant { value, is_cluster: false, count, of, first, why });
            }
        }
        cluster
    }

    /// Detects a constant with noise: a narrow group of the greatest values, apart from the others.
    fn cluster(&self, longest: f64) -> Option<NoEchoConstant> {
        let mut falling = self.bins.iter().rev().peekable();
        let &(&top, _) = falling.peek()?;
        let (mut count, mut min, mut directions, mut last) = (0, f64::INFINITY, [0; 6], top);
        let mut gap = None;
        for (&at, bin) in falling {
            if last - at > 1 {
                gap = Some(last - at);
                break;
            }
            count += bin.count;
            min = min.min(bin.min);
            for (all, own) in directions.iter_mut().zip(bin.directions) {
                *all |= own;
            }
            last = at;
        }
        // Narrower than 10 %, and 10 % above the next lower value.
        let is_narrow = top - last < 10 && gap.is_some_and(|gap| gap > 10);
        let many = self.is_scattered(&directions, count);
        let share = count as f64 / self.count as f64;
        let is_far = min >= 0.95 * longest;
        let distinct = self.values.range(min.to_bits()..).count();
        (is_narrow && distinct > 4 && many && is_far && count >= 10 && share >= 0.05).then_some(NoEchoConstant {
            value: min,
            is_cluster: true,
            count,
            of: self.count,
            first: None,
            why: "the greatest values, close together at the maximum range of the sensor and in many directions",
        })
    }

    /// Returns `true` if no single wall explains these directions of `count` ranges: a wall fills
    /// one arc of the measured directions, with most of its ranges.
    fn is_scattered(&self, directions: &Directions, count: u64) -> bool {
        let has = |directions: &Directions, at: usize| directions[at / 64] >> (at % 64) & 1 == 1;
        let visited: Vec<usize> = (0..360).filter(|at| has(&self.visited, *at)).collect();
        let is_hit: Vec<bool> = visited.iter().map(|at| has(directions, *at)).collect();
        let hits = is_hit.iter().filter(|is_hit| **is_hit).count();
        if self.kind == DirectionKind::Rangers {
            return hits > 1;
        }
        // Over many sweeps a constant occurs in every direction, but only at times.
        let expected = self.count as f64 * hits as f64 / visited.len().max(1) as f64;
        if 2 * hits > visited.len() && (count as f64) < MIN_SHARE * expected {
            return true;
        }
        // The longest circular run of measured directions without a hit lies outside the arc. Runs
        // of up to two are tolerated within it.
        let bins = visited.len();
        let Some(first) = is_hit.iter().position(|is_hit| *is_hit) else { return false };
        let (mut gap, mut longest, mut gaps) = (0, 0, 0);
        for bin in 1..=bins {
            if !is_hit[(first + bin) % bins] {
                gap += 1;
                continue;
            }
            longest = longest.max(gap);
            gaps += usize::from(gap > 2);
            gap = 0;
        }
        let arc = bins - longest;
        gaps > 1 || (hits as f64) < MIN_FILL * arc as f64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sweep(longest: f64, range: impl Fn(usize) -> f64) -> Option<NoEchoConstant> {
        let mut histogram = RangeHistogram::new(DirectionKind::Angles);
        for at in 0..120 {
            histogram.add(FileLocation::Line(at as u64 + 1), range(at), 3.0 * at as f64);
        }
        histogram.constant(longest)
    }

    /// Distances to walls, all different.
    fn wall(at: usize) -> f64 {
        100.0 + 20.0 * (at as f64 * 0.7).sin() + at as f64 * 0.01
    }

    #[test]
    fn finds_constants_in_many_directions() {
        for constant in
            [130.0, 255.0, 400.0, 797.0, 4000.0, 65_535.0, 29.99 * 100.0, 500.0, 38_000.0]
        {
            for every in [2, 3, 5, 20] {
                let found = sweep(400.0, |at| if at % every == 0 { constant } else { wall(at) });
                let found = found.unwrap_or_else(|| panic!("{constant} every {every}"));
                assert_eq!((found.value, found.count), (constant, 120_u64.div_ceil(every as u64)));
            }
        }
    }

    #[test]
    fn finds_mostly_no_echo() {
        let found = sweep(1070.0, |at| if at % 3 == 0 { wall(at) } else { 255.0 }).expect("found");
        assert_eq!((found.value, found.count, found.of), (255.0, 80, 120));
    }

    #[test]
    fn finds_max_range_in_one_arc() {
        let found = sweep(400.0, |at| if (40..60).contains(&at) { 400.0 } else { wall(at) });
        assert_eq!(found.expect("found").count, 20);
        let found = sweep(400.0, |at| if at % 4 == 0 { 400.0 } else { 280.0 + at as f64 });
        assert_eq!(found.expect("found").count, 30);
    }

    #[test]
    fn ignores_walls() {
        assert_eq!(sweep(400.0, wall), None);
        // One arc at equal distances, to the centimetre.
        assert_eq!(sweep(400.0, |at| if (40..58).contains(&at) { 243.0 } else { wall(at) }), None);
        // Across zero degrees.
        assert_eq!(
            sweep(400.0, |at| if !(9..=111).contains(&at) { 243.0 } else { wall(at) }),
            None
        );
        // Rounding to centimetres repeats values, including the maximum.
        assert_eq!(sweep(400.0, |at| (300.0 + 20.0 * (at as f64 * 0.7).sin()).round()), None);
        // Round tank, half of one, and one arc with a gap.
        assert_eq!(sweep(400.0, |_| 150.0), None);
        assert_eq!(sweep(400.0, |at| if at < 60 { 300.0 } else { 100.0 }), None);
        assert_eq!(
            sweep(400.0, |at| if (30..70).contains(&at) && at != 50 { 300.0 } else { wall(at) }),
            None
        );
    }

    #[test]
    fn finds_noisy_max_range() {
        let noisy = |at: usize| 395.0 + (at * 7919 % 97) as f64 / 10.0;
        let found =
            sweep(400.0, |at| if at % 3 == 0 { noisy(at) } else { wall(at) }).expect("found");
        assert!(found.is_cluster && found.value >= 395.0 && found.count == 40, "{found:?}");
    }

    #[test]
    fn finds_noisy_repeated_maximum() {
        // Tenths of a centimetre repeat: the whole group is one constant.
        let noisy = |at: usize| 398.0 + (at * 7919 % 11) as f64 / 10.0;
        let found = sweep(400.0, |at| if at % 2 == 0 { noisy(at) } else { wall(at) });
        let found = found.expect("found");
        assert!(found.is_cluster && found.count == 60, "{found:?}");
    }

    #[test]
    fn finds_low_constant() {
        let mut histogram = RangeHistogram::new(DirectionKind::Angles);
        for at in 0..9000_usize {
            let value = if at % 4 == 0 { 2.0 } else { 100.0 + at as f64 * 0.013 };
            histogram.add(FileLocation::Line(at as u64 + 1), value, 0.7 * at as f64);
        }
        let found = histogram.constant(400.0).expect("found");
        assert_eq!((found.value, found.count), (2.0, 2250));
    }

    #[test]
    fn array_rangers_share_no_wall() {
        let mut histogram = RangeHistogram::new(DirectionKind::Rangers);
        let mut single = RangeHistogram::new(DirectionKind::Rangers);
        for round in 0..8_u64 {
            for ranger in 0..8 {
                let own = 1.0 + 0.1 * ranger as f64 + 0.01 * round as f64;
                let value = if (1..7).contains(&ranger) { 5.0 } else { own };
                histogram.add(FileLocation::Line(round), value, f64::from(ranger));
                // One ranger that drives along a wall.
                single.add(
                    FileLocation::Line(round),
                    if ranger == 3 { 5.0 } else { own },
                    f64::from(ranger),
                );
            }
        }
        assert_eq!(histogram.constant(10.7).expect("found").count, 48);
        assert_eq!(single.constant(10.7), None);
    }

    #[test]
    fn lists_non_positive_values() {
        let mut histogram = RangeHistogram::new(DirectionKind::Angles);
        for (at, value) in [-1.0, 0.0, -1.0, 5.0, f64::NAN].into_iter().enumerate() {
            histogram.add(FileLocation::Line(at as u64 + 1), value, 0.0);
        }
        let non_positive: Vec<_> = histogram
            .non_positive()
            .iter()
            .map(|non_positive| (non_positive.value, non_positive.count))
            .collect();
        assert_eq!(non_positive, [(-1.0, 2), (0.0, 1)]);
    }

    proptest! {
        #[test]
        fn memory_is_bounded(
            values in proptest::collection::vec((any::<f64>(), any::<f64>()), 0..500),
            longest in any::<f64>(),
        ) {
            let mut histogram = RangeHistogram::new(DirectionKind::Angles);
            for (value, direction) in values {
                histogram.add(FileLocation::Line(1), value, direction);
            }
            let _ = histogram.constant(longest);
            prop_assert!(histogram.values.len() <= MAX_VALUES && histogram.non_positive.len() <= MAX_NON_POSITIVE);
        }
    }
}

//! Constants that drivers write where no echo came back.
//!
//! A time-out is a number in most files: the greatest range of the sensor, a full register, or the driver's own. Such a
//! number is repeated exactly, is the greatest or near it, and occurs in many directions, where a wall at one distance
//! occurs in one arc. One rule serves every format.

use std::collections::BTreeMap;

use crate::Location;

/// The greatest values that are counted one by one.
const MAX_VALUES: usize = 64;
/// A wall at one distance fills its arc; a constant that is interleaved with ranges does not.
const MIN_FILL: f64 = 0.93;
/// Full registers and round numbers of drivers, in the unit of the file.
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
/// Share of the sensor's longest range from which a value is the longest range, as written.
const AT_LONGEST: f64 = 0.9965;

/// Meaning of a direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Across {
    /// An angle of one ranger that turns: near angles meet the same wall.
    Angles,
    /// A ranger of an array: no wall is at the same distance from two of them.
    Rangers,
}

/// Directions in which something occurred, by whole degrees or rangers.
type Directions = [u64; 6];

#[derive(Debug, Clone)]
struct Seen {
    count: u64,
    first: Location,
    directions: Directions,
}

/// Ranges of a file, counted in bounded memory.
#[derive(Debug)]
pub(crate) struct Silence {
    across: Across,
    count: u64,
    visited: Directions,
    /// The greatest values, by the bits of positive numbers, which sort as they do.
    values: BTreeMap<u64, Seen>,
    /// The values that are not positive.
    below: BTreeMap<i64, (f64, u64, Location)>,
    is_below_full: bool,
    /// Values by steps of 1 %, for a constant with noise on it.
    steps: BTreeMap<i32, Step>,
}

#[derive(Debug, Clone)]
struct Step {
    count: u64,
    least: f64,
    directions: Directions,
}

/// A constant that stands for no echo.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Constant {
    /// The value in the unit of the file; the least of a cluster.
    pub(crate) value: f64,
    /// True if values vary about it.
    pub(crate) is_cluster: bool,
    pub(crate) count: u64,
    pub(crate) of: u64,
    pub(crate) first: Option<Location>,
    /// Evidence for it.
    pub(crate) why: &'static str,
}

/// The usual step between values other than this one: with few digits they are apart, too.
fn usual_gap(falling: &[(f64, &Seen)], value: f64) -> f64 {
    let others: Vec<f64> =
        falling.iter().map(|(other, _)| *other).filter(|other| *other != value).collect();
    let mut gaps: Vec<f64> = others.windows(2).map(|pair| pair[0] - pair[1]).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied().unwrap_or(0.0)
}

/// A value that is no distance: zero or less.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Below {
    pub(crate) value: f64,
    pub(crate) count: u64,
    pub(crate) first: Location,
}

const MAX_BELOW: usize = 16;

impl Silence {
    pub(crate) const fn new(across: Across) -> Self {
        Self {
            across,
            count: 0,
            visited: [0; 6],
            values: BTreeMap::new(),
            below: BTreeMap::new(),
            is_below_full: false,
            steps: BTreeMap::new(),
        }
    }

    /// Counts a range in the file's unit; `direction` is an angle in degrees, or the place of a ranger.
    pub(crate) fn add(&mut self, place: Location, value: f64, direction: f64) {
        if !value.is_finite() {
            return;
        }
        self.count += 1;
        if value <= 0.0 {
            let key = (value * 1e6).round() as i64;
            self.is_below_full |= self.below.len() >= MAX_BELOW && !self.below.contains_key(&key);
            if !self.is_below_full {
                self.below.entry(key).or_insert((value, 0, place)).1 += 1;
            }
            return;
        }
        let at = (direction.rem_euclid(360.0) as usize).min(359);
        let mark = |directions: &mut Directions| directions[at / 64] |= 1 << (at % 64);
        mark(&mut self.visited);
        let seen = self.values.entry(value.to_bits());
        let seen = seen.or_insert(Seen { count: 0, first: place, directions: [0; 6] });
        seen.count += 1;
        mark(&mut seen.directions);
        if self.values.len() > MAX_VALUES {
            self.values.pop_first();
        }
        let step = (value.ln() * 100.0).floor() as i32;
        let step = self.steps.entry(step);
        let step = step.or_insert(Step { count: 0, least: value, directions: [0; 6] });
        step.count += 1;
        step.least = step.least.min(value);
        mark(&mut step.directions);
    }

    /// Values of zero or less, the most frequent first.
    pub(crate) fn below(&self) -> Vec<Below> {
        let all = self.below.values().map(|&(value, count, first)| Below { value, count, first });
        let mut all: Vec<_> = all.collect();
        all.sort_by_key(|below| std::cmp::Reverse(below.count));
        all
    }

    /// The value that a share of the positive ones is not above, to 1 %.
    pub(crate) fn quantile(&self, share: f64) -> Option<f64> {
        let all: u64 = self.steps.values().map(|step| step.count).sum();
        let mut below = 0;
        let at = self.steps.values().find(|step| {
            below += step.count;
            below as f64 >= share * all as f64
        });
        at.map(|step| step.least)
    }

    /// The constant that stands for no echo, if there is one; `longest` is the sensor's, in the file's unit.
    pub(crate) fn constant(&self, longest: f64) -> Option<Constant> {
        let longest = if longest > 0.0 { longest } else { f64::INFINITY };
        let falling: Vec<(f64, &Seen)> =
            self.values.iter().rev().map(|(bits, seen)| (f64::from_bits(*bits), seen)).collect();
        let of = self.count;
        for (rank, &(value, seen)) in falling.iter().enumerate() {
            let others = falling.iter().filter(|(other, _)| *other != value);
            let most_of_others = others.map(|(_, seen)| seen.count).max().unwrap_or(0);
            let below = falling.get(rank + 1).map(|(below, _)| *below);
            let is_apart = below.is_some_and(|below| {
                let gap = value - below;
                gap > 0.05 * value && gap > 4.0 * usual_gap(&falling, value)
            });
            let share = seen.count as f64 / of as f64;
            let many = self.is_scattered(&seen.directions);
            let is_frequent = seen.count >= 6 && share >= 0.05 && seen.count >= 5 * most_of_others;
            let is_at_longest = value >= AT_LONGEST * longest;
            let is_code = CODES.contains(&value);
            let is_top = rank == 0;
            let why =
                if is_at_longest && seen.count >= 3 && share >= 0.01 && (is_top || is_frequent) {
                    Some("at or beyond the longest range of the sensor")
                } else if is_code
                    && seen.count >= 3
                    && is_top
                    && (many || (value >= 1023.0 && is_apart))
                {
                    Some("a number that drivers write for no echo")
                } else if is_top && is_apart && many && seen.count >= 3 && share >= 0.03 {
                    Some("the greatest, apart from the rest and in many directions")
                } else if many && is_frequent && most_of_others > 0 && (is_top || share >= 0.1) {
                    Some("far more frequent than any other, and in many directions")
                } else {
                    None
                };
            if let Some(why) = why {
                let (count, first) = (seen.count, Some(seen.first));
                return Some(Constant { value, is_cluster: false, count, of, first, why });
            }
        }
        self.cluster(longest)
    }

    /// A constant with noise on it: the greatest values close together, and apart from the rest.
    fn cluster(&self, longest: f64) -> Option<Constant> {
        let mut falling = self.steps.iter().rev().peekable();
        let &(&top, _) = falling.peek()?;
        let (mut count, mut least, mut directions, mut last) = (0, f64::INFINITY, [0; 6], top);
        let mut gap = None;
        for (&at, step) in falling {
            if last - at > 1 {
                gap = Some(last - at);
                break;
            }
            count += step.count;
            least = least.min(step.least);
            for (all, own) in directions.iter_mut().zip(step.directions) {
                *all |= own;
            }
            last = at;
        }
        // Narrower than 10 %, and 10 % from what is below.
        let is_narrow = top - last < 10 && gap.is_some_and(|gap| gap > 10);
        let many = self.is_scattered(&directions);
        let share = count as f64 / self.count as f64;
        let is_far = least >= 0.95 * longest;
        let distinct = self.values.range(least.to_bits()..).count();
        (is_narrow && distinct > 4 && many && is_far && count >= 10 && share >= 0.05).then_some(Constant {
            value: least,
            is_cluster: true,
            count,
            of: self.count,
            first: None,
            why: "the greatest, close together at the longest range of the sensor and in many directions",
        })
    }

    /// Checks whether no wall at one distance occurs in these directions: it fills one arc of those that were measured.
    fn is_scattered(&self, directions: &Directions) -> bool {
        let has = |directions: &Directions, at: usize| directions[at / 64] >> (at % 64) & 1 == 1;
        let visited: Vec<usize> = (0..360).filter(|at| has(&self.visited, *at)).collect();
        let is_hit: Vec<bool> = visited.iter().map(|at| has(directions, *at)).collect();
        let hits = is_hit.iter().filter(|is_hit| **is_hit).count();
        if self.across == Across::Rangers {
            return hits > 1;
        }
        // The longest row of measured directions without a hit, round the circle, is what is outside the arc; two
        // neighbours may lack it within.
        let count = visited.len();
        let Some(first) = is_hit.iter().position(|is_hit| *is_hit) else { return false };
        let (mut gap, mut longest, mut gaps) = (0, 0, 0);
        for step in 1..=count {
            if !is_hit[(first + step) % count] {
                gap += 1;
                continue;
            }
            longest = longest.max(gap);
            gaps += usize::from(gap > 2);
            gap = 0;
        }
        let arc = count - longest;
        gaps > 1 || (hits as f64) < MIN_FILL * arc as f64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sweep(longest: f64, range: impl Fn(usize) -> f64) -> Option<Constant> {
        let mut silence = Silence::new(Across::Angles);
        for at in 0..120 {
            silence.add(Location::Line(at as u64 + 1), range(at), 3.0 * at as f64);
        }
        silence.constant(longest)
    }

    /// Distances to walls, all different.
    fn wall(at: usize) -> f64 {
        100.0 + 20.0 * (at as f64 * 0.7).sin() + at as f64 * 0.01
    }

    #[test]
    fn constants_in_many_directions_are_no_echo_whatever_their_value() {
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
    fn mostly_no_echo_is_found() {
        let found = sweep(1070.0, |at| if at % 3 == 0 { wall(at) } else { 255.0 }).expect("found");
        assert_eq!((found.value, found.count, found.of), (255.0, 80, 120));
    }

    #[test]
    fn the_longest_range_is_found_in_one_arc_and_beside_true_ranges_up_to_it() {
        let found = sweep(400.0, |at| if (40..60).contains(&at) { 400.0 } else { wall(at) });
        assert_eq!(found.expect("found").count, 20);
        let found = sweep(400.0, |at| if at % 4 == 0 { 400.0 } else { 280.0 + at as f64 });
        assert_eq!(found.expect("found").count, 30);
    }

    #[test]
    fn walls_are_walls() {
        assert_eq!(sweep(400.0, wall), None);
        // One arc at the same distance, to the centimetre.
        assert_eq!(sweep(400.0, |at| if (40..58).contains(&at) { 243.0 } else { wall(at) }), None);
        // Across zero degrees.
        assert_eq!(
            sweep(400.0, |at| if !(9..=111).contains(&at) { 243.0 } else { wall(at) }),
            None
        );
        // Whole centimetres repeat, also the greatest.
        assert_eq!(sweep(400.0, |at| (300.0 + 20.0 * (at as f64 * 0.7).sin()).round()), None);
        // A round tank, half of one, and one arc with a gap in it.
        assert_eq!(sweep(400.0, |_| 150.0), None);
        assert_eq!(sweep(400.0, |at| if at < 60 { 300.0 } else { 100.0 }), None);
        assert_eq!(
            sweep(400.0, |at| if (30..70).contains(&at) && at != 50 { 300.0 } else { wall(at) }),
            None
        );
    }

    #[test]
    fn noise_about_the_longest_range_is_a_cluster() {
        let noisy = |at: usize| 395.0 + (at * 7919 % 97) as f64 / 10.0;
        let found =
            sweep(400.0, |at| if at % 3 == 0 { noisy(at) } else { wall(at) }).expect("found");
        assert!(found.is_cluster && found.value >= 395.0 && found.count == 40, "{found:?}");
    }

    #[test]
    fn rangers_share_no_wall() {
        let mut silence = Silence::new(Across::Rangers);
        let mut alone = Silence::new(Across::Rangers);
        for round in 0..8_u64 {
            for ranger in 0..8 {
                let own = 1.0 + 0.1 * ranger as f64 + 0.01 * round as f64;
                let value = if (1..7).contains(&ranger) { 5.0 } else { own };
                silence.add(Location::Line(round), value, f64::from(ranger));
                // One ranger beside a wall that it drives along.
                alone.add(
                    Location::Line(round),
                    if ranger == 3 { 5.0 } else { own },
                    f64::from(ranger),
                );
            }
        }
        assert_eq!(silence.constant(10.7).expect("found").count, 48);
        assert_eq!(alone.constant(10.7), None);
    }

    #[test]
    fn values_that_are_no_distance_are_listed_by_frequency() {
        let mut silence = Silence::new(Across::Angles);
        for (at, value) in [-1.0, 0.0, -1.0, 5.0, f64::NAN].into_iter().enumerate() {
            silence.add(Location::Line(at as u64 + 1), value, 0.0);
        }
        let below: Vec<_> =
            silence.below().iter().map(|below| (below.value, below.count)).collect();
        assert_eq!(below, [(-1.0, 2), (0.0, 1)]);
    }

    proptest! {
        #[test]
        fn any_numbers_are_counted_in_bounded_memory(
            values in proptest::collection::vec((any::<f64>(), any::<f64>()), 0..500),
            longest in any::<f64>(),
        ) {
            let mut silence = Silence::new(Across::Angles);
            for (value, direction) in values {
                silence.add(Location::Line(1), value, direction);
            }
            let _ = silence.constant(longest);
            prop_assert!(silence.values.len() <= MAX_VALUES && silence.below.len() <= MAX_BELOW);
        }
    }
}

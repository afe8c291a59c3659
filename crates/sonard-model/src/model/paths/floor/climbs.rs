//! Climbs: heights at which sound hits a wall that ends below the ceiling or above the floor, and
//! heights at which it passes such a wall.
//!
//! With floor and ceiling as windows the height of a path grows evenly with its length in the plan.
//! A wall is then at its own height once and again at each of its images by floor and ceiling. The
//! walls that a ray can hit therefore follow from one number, its slope.

/// Number of the set of all slopes.
pub(crate) const ALL_SLOPES: u32 = 0;

/// Heights above the transducer with floor and ceiling as windows, metres: closed intervals,
/// ascending and disjoint.
pub(crate) type Spans = Vec<[f64; 2]>;

/// Climbs at a wall that ends below the ceiling or above the floor.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct WallClimbs {
    /// Climbs at which the wall reflects.
    pub(crate) hit: Spans,
    /// Climbs at which sound passes the wall.
    pub(crate) passed: Spans,
}

/// Climbs at the walls with limits of a scene, around a transducer.
#[derive(Debug, Clone, Default)]
pub(crate) struct Climbs {
    /// `true` if beams end where none of their rays is at the right height; otherwise only paths
    /// are checked.
    pub(crate) ends_beams: bool,
    /// Climbs by wall; `None` without limits. Empty in a scene without floor and ceiling.
    pub(crate) walls: Vec<Option<WallClimbs>>,
    /// Amplitude factors of floor and ceiling, decreasing, each with the highest climb that has at
    /// least this factor, metres.
    pub(crate) highest: Vec<[f64; 2]>,
}

impl Climbs {
    /// Climbs at a wall with limits.
    pub(crate) fn of_wall(&self, wall: u32) -> Option<&WallClimbs> {
        self.walls.get(wall as usize)?.as_ref()
    }

    /// Returns `true` if level sound hits a wall.
    pub(crate) fn is_hit_by_level(&self, wall: u32) -> bool {
        self.of_wall(wall).is_none_or(|climbs| is_level_in(&climbs.hit))
    }

    /// Returns `true` if level sound passes a wall with limits.
    pub(crate) fn is_passed_by_level(&self, wall: u32) -> bool {
        self.of_wall(wall).is_some_and(|climbs| is_level_in(&climbs.passed))
    }

    /// Highest climb, metres, after which floor and ceiling leave at least the share `min_gain`
    /// of the amplitude.
    pub(crate) fn highest_m(&self, min_gain: f64) -> f64 {
        let count = self.highest.partition_point(|[gain, _]| *gain >= min_gain);
        count.checked_sub(1).map_or(0.0, |last| self.highest[last][1])
    }
}

fn is_level_in(spans: &Spans) -> bool {
    spans.iter().any(|[from_m, to_m]| *from_m <= 0.0 && 0.0 <= *to_m)
}

/// Union of the intervals of a list, as [`Spans`].
pub(crate) fn united(mut spans: Vec<[f64; 2]>) -> Spans {
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut united: Spans = Vec::with_capacity(spans.len());
    for [from, to] in spans {
        match united.last_mut() {
            Some(last) if from <= last[1] => last[1] = last[1].max(to),
            _ => united.push([from, to]),
        }
    }
    united
}

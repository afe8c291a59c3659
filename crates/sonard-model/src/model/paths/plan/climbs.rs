//! Climbs: the heights at which sound meets a wall that ends below the ceiling or above the floor, and those
//! at which it passes such a wall.
//!
//! If floor and ceiling were windows the height of a path would grow evenly with its length in the plan, and
//! a wall would stand once at its own height and again at each of its images by floor and ceiling. So what a
//! ray can meet follows from one number, its slope.

/// The number of the set of all slopes.
pub(crate) const ALL_SLOPES: u32 = 0;

/// Heights above the transducer if floor and ceiling are windows, metres: closed, rising and apart.
pub(crate) type Spans = Vec<[f64; 2]>;

/// Of a wall that ends below the ceiling or above the floor.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct WallClimbs {
    /// Where it reflects.
    pub(crate) met: Spans,
    /// Where sound goes on behind it.
    pub(crate) passed: Spans,
}

/// The walls with limits of a scene, around a transducer.
#[derive(Debug, Clone, Default)]
pub(crate) struct Climbs {
    /// Whether beams end where none of their rays stands at the right height; else only paths are asked.
    pub(crate) ends_beams: bool,
    /// By wall; `None` of one without limits. Empty in a scene without floor and ceiling.
    pub(crate) walls: Vec<Option<WallClimbs>>,
    /// By falling gain what floor and ceiling leave, and the highest climb with that much or more, metres.
    pub(crate) highest: Vec<[f64; 2]>,
}

impl Climbs {
    /// Of a wall with limits.
    pub(crate) fn of_wall(&self, wall: u32) -> Option<&WallClimbs> {
        self.walls.get(wall as usize)?.as_ref()
    }

    /// Whether level sound meets a wall.
    pub(crate) fn meets_level(&self, wall: u32) -> bool {
        self.of_wall(wall).is_none_or(|climbs| is_level_in(&climbs.met))
    }

    /// Whether level sound passes a wall with limits.
    pub(crate) fn passes_level(&self, wall: u32) -> bool {
        self.of_wall(wall).is_some_and(|climbs| is_level_in(&climbs.passed))
    }

    /// The highest climb after which floor and ceiling leave at least the share `least_gain` of the amplitude,
    /// metres.
    pub(crate) fn highest_m(&self, least_gain: f64) -> f64 {
        let count = self.highest.partition_point(|[gain, _]| *gain >= least_gain);
        count.checked_sub(1).map_or(0.0, |last| self.highest[last][1])
    }
}

fn is_level_in(spans: &Spans) -> bool {
    spans.iter().any(|[from_m, to_m]| *from_m <= 0.0 && 0.0 <= *to_m)
}

/// What two lists of intervals cover together, as [`Spans`].
pub(crate) fn united(mut spans: Vec<[f64; 2]>) -> Spans {
    spans.sort_by(|one, other| one[0].total_cmp(&other[0]));
    let mut united: Spans = Vec::with_capacity(spans.len());
    for [from, to] in spans {
        match united.last_mut() {
            Some(last) if from <= last[1] => last[1] = last[1].max(to),
            _ => united.push([from, to]),
        }
    }
    united
}

//! Ends of sweeps: where the motion turns round, jumps back to its beginning, or has gone full circle.

use sonard_model::geometry::wrap_180;

/// Steps in one sense that make a motion; fewer are readings in no order.
const MIN_STEPS: u32 = 2;
/// Directions closer than this are one, degrees.
const SAME_DEG: f64 = 1e-3;
/// A step back smaller than this share of a usual one is jitter of the mount.
const JITTER: f64 = 0.5;

/// The motion of a ranger, reading by reading.
#[derive(Debug, Clone, Default)]
pub(crate) struct Turning {
    first_deg: Option<f64>,
    last_deg: f64,
    /// Way in all, and the way in the sense of the motion, degrees.
    way_deg: f64,
    /// Sense of the motion, its steps, and what they add up to, degrees.
    sense: f64,
    steps: u32,
    run_deg: f64,
}

impl Turning {
    /// Takes the direction of the next reading; whether it begins another sweep.
    pub(crate) fn is_next(&mut self, direction_deg: f64) -> bool {
        if self.first_deg.is_none() {
            self.begin(direction_deg);
            return false;
        }
        let step_deg = wrap_180(direction_deg - self.last_deg);
        let way_deg = self.way_deg + step_deg.abs();
        let usual_deg = self.run_deg / f64::from(self.steps.max(1));
        let is_back = step_deg * self.sense < 0.0;
        let turns_round = is_back && self.steps >= MIN_STEPS && step_deg.abs() > JITTER * usual_deg;
        // A little less than a turn, for the rounding of the angles.
        if turns_round || way_deg > 360.0 - SAME_DEG {
            self.begin(direction_deg);
            return true;
        }
        (self.last_deg, self.way_deg) = (direction_deg, way_deg);
        if step_deg.abs() > SAME_DEG {
            if is_back || self.sense == 0.0 {
                (self.sense, self.steps, self.run_deg) = (step_deg.signum(), 0, 0.0);
            }
            self.steps += 1;
            self.run_deg += step_deg.abs();
        }
        false
    }

    fn begin(&mut self, direction_deg: f64) {
        *self = Self { first_deg: Some(direction_deg), last_deg: direction_deg, ..Self::default() };
    }

    /// Forgets the motion so far.
    pub(crate) fn restart(&mut self, direction_deg: f64) {
        self.begin(direction_deg);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of readings in each sweep.
    fn sweeps(directions_deg: impl IntoIterator<Item = f64>) -> Vec<usize> {
        let mut turning = Turning::default();
        let mut counts = vec![0];
        for direction_deg in directions_deg {
            if turning.is_next(direction_deg) {
                counts.push(0);
            }
            *counts.last_mut().expect("begun") += 1;
        }
        counts
    }

    fn steps(from: i32, to: i32, step: i32) -> Vec<f64> {
        let count = (to - from) / step;
        (0..=count).map(|at| f64::from(from + at * step)).collect()
    }

    #[test]
    fn sweeps_to_and_fro_end_where_they_turn_round() {
        let there = steps(15, 165, 5);
        let back = steps(160, 15, -5);
        let again = steps(20, 165, 5);
        assert_eq!(sweeps([there.clone(), back, again].concat()), [31, 30, 30]);
        // The last direction twice.
        assert_eq!(sweeps([there.clone(), steps(165, 15, -5)].concat()), [32, 30]);
        // Across zero.
        assert_eq!(sweeps([steps(-30, 30, 10), steps(20, -30, -10)].concat()), [7, 6]);
    }

    #[test]
    fn sweeps_that_begin_again_end_where_they_jump_back() {
        for (from, to) in [(15, 165), (0, 90), (0, 200), (-135, 135), (0, 350)] {
            let one = steps(from, to, 5);
            let count = one.len();
            assert_eq!(sweeps([one.clone(), one.clone(), one].concat()), [count; 3], "{from} {to}");
        }
    }

    #[test]
    fn full_turns_jitter_and_repeated_directions_do_not_end_a_sweep_early() {
        assert_eq!(sweeps([steps(0, 355, 5), steps(0, 355, 5)].concat()), [72, 72]);
        let jitter = (0..60).map(|at| f64::from(at) + if at % 7 == 3 { -1.3 } else { 0.0 });
        assert_eq!(sweeps(jitter), [60]);
        assert_eq!(sweeps([0.0, 0.0, 0.0, 10.0, 10.0, 20.0, 20.0, 30.0]), [8]);
        assert_eq!(sweeps([5.0; 20]), [20]);
    }
}

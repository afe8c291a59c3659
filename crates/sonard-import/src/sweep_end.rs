//! Detection of the end of a sweep: where the rotation reverses, jumps back to its start, or
//! completes a circle.

use sonard_model::geometry::wrap_180;

/// Minimum number of steps in one sense that count as a rotation; fewer may be unordered readings.
const MIN_STEPS: u32 = 2;
/// Tolerance for equal directions, degrees.
pub(crate) const SAME_DEG: f64 = 1e-3;
/// Share of the usual step below which a backward step is jitter of the mount.
const JITTER: f64 = 0.5;

/// Rotation of a ranger, reading by reading.
#[derive(Debug, Clone, Default)]
pub(crate) struct SweepDetector {
    first_deg: Option<f64>,
    last_deg: f64,
    /// Total rotation, regardless of sense, degrees.
    travel_deg: f64,
    /// Sense of the rotation, number of its steps and their sum, degrees.
    sense: f64,
    steps: u32,
    run_deg: f64,
    /// Sense of the sweep that a full circle ended, at the first reading of the next.
    circle_sense: Option<f64>,
}

impl SweepDetector {
    /// Adds the direction of the next reading; returns `true` if the reading starts another sweep.
    pub(crate) fn is_next(&mut self, direction_deg: f64) -> bool {
        if self.first_deg.is_none() {
            self.begin(direction_deg);
            return false;
        }
        let step_deg = wrap_180(direction_deg - self.last_deg);
        let travel_deg = self.travel_deg + step_deg.abs();
        let usual_deg = self.run_deg / f64::from(self.steps.max(1));
        let is_back = step_deg * self.sense < 0.0;
        let is_reversal = is_back && self.steps >= MIN_STEPS && step_deg.abs() > JITTER * usual_deg;
        // The tolerance allows for rounding of the angles.
        if is_reversal || travel_deg > 360.0 - SAME_DEG {
            let circle_sense = Some(self.sense).filter(|sense| !is_reversal && *sense != 0.0);
            self.begin(direction_deg);
            self.circle_sense = circle_sense;
            return true;
        }
        self.circle_sense = None;
        (self.last_deg, self.travel_deg) = (direction_deg, travel_deg);
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

    /// Sense of the rotation if the last reading completed a full circle.
    pub(crate) const fn circle_sense(&self) -> Option<f64> {
        self.circle_sense
    }

    /// Starts a sweep at this direction.
    pub(crate) fn restart(&mut self, direction_deg: f64) {
        self.begin(direction_deg);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of readings in each sweep.
    fn sweeps(directions_deg: impl IntoIterator<Item = f64>) -> Vec<usize> {
        let mut detector = SweepDetector::default();
        let mut counts = vec![0];
        for direction_deg in directions_deg {
            if detector.is_next(direction_deg) {
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
    fn ends_on_reversal() {
        let there = steps(15, 165, 5);
        let back = steps(160, 15, -5);
        let again = steps(20, 165, 5);
        assert_eq!(sweeps([there.clone(), back, again].concat()), [31, 30, 30]);
        // Repeated last direction.
        assert_eq!(sweeps([there.clone(), steps(165, 15, -5)].concat()), [32, 30]);
        // Across zero.
        assert_eq!(sweeps([steps(-30, 30, 10), steps(20, -30, -10)].concat()), [7, 6]);
    }

    #[test]
    fn ends_on_jump_back() {
        for (from, to) in [(15, 165), (0, 90), (0, 200), (-135, 135), (0, 350)] {
            let one = steps(from, to, 5);
            let count = one.len();
            assert_eq!(sweeps([one.clone(), one.clone(), one].concat()), [count; 3], "{from} {to}");
        }
    }

    #[test]
    fn survives_jitter_and_repeats() {
        assert_eq!(sweeps([steps(0, 355, 5), steps(0, 355, 5)].concat()), [72, 72]);
        let jitter = (0..60).map(|at| f64::from(at) + if at % 7 == 3 { -1.3 } else { 0.0 });
        assert_eq!(sweeps(jitter), [60]);
        assert_eq!(sweeps([0.0, 0.0, 0.0, 10.0, 10.0, 20.0, 20.0, 30.0]), [8]);
        assert_eq!(sweeps([5.0; 20]), [20]);
    }
}

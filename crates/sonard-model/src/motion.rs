//! Trapezoidal speed profile of a stepper move.

/// Move with constant acceleration to a peak speed and the same deceleration to standstill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trapezoid {
    steps: i32,
    /// Peak speed of the move, steps/s.
    peak: f64,
    acceleration: f64,
}

impl Trapezoid {
    /// Creates a move by `steps` with at most `speed` steps/s and `acceleration` steps/s^2.
    #[must_use]
    pub fn new(steps: i32, speed: u16, acceleration: u32) -> Self {
        let acceleration = f64::from(acceleration.max(1));
        let distance = f64::from(steps.unsigned_abs());
        // Speed at which acceleration takes half the distance.
        let reachable = (distance * acceleration).sqrt();
        Self { steps, peak: f64::from(speed.max(1)).min(reachable), acceleration }
    }

    /// Duration of the move, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        if self.steps == 0 {
            return 0.0;
        }
        let distance = f64::from(self.steps.unsigned_abs());
        distance / self.peak + self.peak / self.acceleration
    }

    /// Stop of a motor that begins to brake at `time_s`: position in steps from the start, and time
    /// in seconds after the start.
    #[must_use]
    pub fn braking_stop(&self, time_s: f64) -> (i32, f64) {
        let (travelled, speed) = self.state_at(time_s);
        let distance = f64::from(self.steps.unsigned_abs());
        let stop = (travelled + speed * speed / (2.0 * self.acceleration)).round().min(distance);
        (stop as i32 * self.steps.signum(), time_s + speed / self.acceleration)
    }

    /// Time of pulse `number` (from 1 on), seconds after the start: the motor passes the midpoint
    /// between two steps.
    #[must_use]
    pub fn pulse_time_s(&self, number: u32) -> f64 {
        let distance = f64::from(self.steps.unsigned_abs());
        let travelled = (f64::from(number) - 0.5).clamp(0.0, distance);
        let ramp = self.peak * self.peak / (2.0 * self.acceleration);
        if travelled <= ramp.min(distance / 2.0) {
            (2.0 * travelled / self.acceleration).sqrt()
        } else if travelled < distance - ramp {
            self.peak / self.acceleration + (travelled - ramp) / self.peak
        } else {
            self.duration_s() - (2.0 * (distance - travelled) / self.acceleration).sqrt()
        }
    }

    /// Same move, braked from `time_s` on, to the position of [`Self::braking_stop`].
    #[must_use]
    pub fn braked(&self, time_s: f64) -> Self {
        let (stop, _) = self.braking_stop(time_s);
        let (travelled, speed) = self.state_at(time_s);
        let slowing = f64::from(self.steps.unsigned_abs()) - travelled
            <= speed * speed / (2.0 * self.acceleration) + 0.5;
        let peak = if slowing { self.peak } else { speed };
        let reachable = (f64::from(stop.unsigned_abs()) * self.acceleration).sqrt();
        Self { steps: stop, peak: peak.min(reachable), acceleration: self.acceleration }
    }

    /// Signed number of steps.
    #[must_use]
    pub const fn steps(&self) -> i32 {
        self.steps
    }

    /// Distance travelled, steps, and speed, steps/s, after `time_s`.
    fn state_at(&self, time_s: f64) -> (f64, f64) {
        let distance = f64::from(self.steps.unsigned_abs());
        let (ramp_s, end_s) = (self.peak / self.acceleration, self.duration_s());
        if time_s >= end_s {
            return (distance, 0.0);
        }
        if time_s < ramp_s {
            return (self.acceleration * time_s * time_s / 2.0, self.acceleration * time_s);
        }
        let left_s = end_s - time_s;
        if left_s < ramp_s {
            let left = self.acceleration * left_s * left_s / 2.0;
            return (distance - left, self.acceleration * left_s);
        }
        (self.peak * (time_s - ramp_s / 2.0), self.peak)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn duration_matches_closed_form() {
        // 1000 steps at 500 steps/s, 1000 steps/s^2: 0.5 s up, 1.5 s at speed, 0.5 s down.
        assert!((Trapezoid::new(1000, 500, 1000).duration_s() - 2.5).abs() < 1e-12);
        // A single step never reaches the peak speed: twice sqrt(1 / a).
        assert!((Trapezoid::new(-1, 500, 40_000).duration_s() - 0.01).abs() < 1e-12);
        assert_eq!(Trapezoid::new(0, 500, 1000).duration_s(), 0.0);
    }

    #[test]
    fn pulses_are_midway_between_steps() {
        for (steps, speed, acceleration) in [(1, 800, 40_000), (7, 800, 40_000), (-400, 800, 9_000)]
        {
            let motion = Trapezoid::new(steps, speed, acceleration);
            let pulses: Vec<f64> =
                (1..=steps.unsigned_abs()).map(|k| motion.pulse_time_s(k)).collect();
            for (k, at_s) in pulses.iter().enumerate() {
                let (travelled, _) = motion.state_at(*at_s);
                assert!(
                    (travelled - (k as f64 + 0.5)).abs() < 1e-9,
                    "{steps}: pulse {k} at {travelled}"
                );
            }
            // Symmetric in time.
            let end_s = motion.duration_s();
            for (first, last) in pulses.iter().zip(pulses.iter().rev()) {
                assert!((first - (end_s - last)).abs() < 1e-9, "{steps}");
            }
        }
    }

    #[test]
    fn braking_keeps_earlier_pulses() {
        let motion = Trapezoid::new(1_000, 800, 2_000);
        for hundredth in 1..165 {
            let time_s = f64::from(hundredth) / 100.0;
            let braked = motion.braked(time_s);
            assert_eq!(braked.steps(), motion.braking_stop(time_s).0);
            let (travelled, _) = motion.state_at(time_s);
            for k in 1..=travelled as u32 {
                let off_s = braked.pulse_time_s(k) - motion.pulse_time_s(k);
                // Rounding of the final position by half a step, at the current speed.
                assert!(off_s.abs() < 0.01, "{time_s}: pulse {k} is {off_s} s off");
            }
        }
    }

    #[test]
    fn braking_stops_within_the_move() {
        let motion = Trapezoid::new(-1000, 500, 1000);
        let mut last = 0;
        for tenth in 0..=30 {
            let (stop, at_s) = motion.braking_stop(f64::from(tenth) / 10.0);
            assert!((-1000..=last).contains(&stop), "{tenth}: {stop} after {last}");
            assert!(at_s >= f64::from(tenth) / 10.0);
            last = stop;
        }
        assert_eq!(last, -1000);
        // Braking from full speed takes v^2 / 2a = 125 steps.
        assert_eq!(motion.braking_stop(1.0).0, -(375 + 125));
    }
}

//! The stepper's rotor, which follows the field only as far as its torque goes.
//!
//! The rotor is a mass on the field's spring (P. Acarnley, "Stepping Motors: a guide to theory and
//! practice", 4th ed., chapters 4 and 5; T. Kenjo and A. Sugawara, "Stepping Motors and their
//! Microprocessor Controls", 2nd ed., chapter 4), in steps and seconds:
//!
//! ```text
//! x'' = a(x') sin((field - x) pi / 2) - 2 z w (x' - v) - f a0 sgn(x')
//! a(x') = a0 / sqrt(1 + (x' / c)^2)
//! ```
//!
//! `a0` is holding torque over inertia, `c` the corner at which the current no longer rises in the
//! time of a step (a coil with resistance and inductance at a fixed voltage), `f` the friction, `v`
//! the field's speed, `w^2 = a0 pi / 2`, and `z` the damping, which the coils' voltage makes too:
//! it and the spring together are at most `a(x')`. Two steps of lag or
//! lead turn the torque around: then the rotor falls into the next place that looks the same to
//! the coils, and four steps are missed.
//!
//! The numbers of [`MotorLimits::typical`] are an assumption, not a measured motor.

use std::f64::consts::FRAC_PI_2;

use crate::HZ;

/// Steps after which the coils' field is the same again.
const CYCLE_STEPS: f64 = 4.0;
/// Step of the integration, cycles: 20 us, a hundredth of the rotor's own period or less.
const STEP_CYCLES: u64 = HZ / 50_000;
/// A field that has not moved for so long stands, cycles.
const STANDS_CYCLES: u64 = HZ / 20;

/// What a motor and its load can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorLimits {
    /// Holding torque over inertia, steps/s^2.
    pub acceleration: f64,
    /// Speed at which the torque has fallen to 0.71 of that, steps/s.
    pub corner_speed: f64,
    /// Friction, as a part of the holding torque.
    pub friction: f64,
    /// Damping ratio of small swings about a step.
    pub damping: f64,
}

impl MotorLimits {
    /// A 0.4 N m motor of 400 steps a revolution that turns a transducer and its mount
    /// (1e-4 kg m^2 in all) at a driver's 12 V.
    #[must_use]
    pub const fn typical() -> Self {
        Self { acceleration: 250_000.0, corner_speed: 1_500.0, friction: 0.1, damping: 0.3 }
    }

    /// The largest steady speed, steps/s: there the torque has fallen to the friction.
    #[must_use]
    pub fn pull_out_speed(&self) -> f64 {
        self.corner_speed * (self.friction.powi(-2) - 1.0).max(0.0).sqrt()
    }

    fn torque(&self, speed: f64) -> f64 {
        self.acceleration / (1.0 + (speed / self.corner_speed).powi(2)).sqrt()
    }
}

/// A rotor in the field of its coils. Times are cycles.
#[derive(Debug, Clone, Default)]
pub(crate) struct Motor {
    /// `None`: it follows whatever the field does.
    limits: Option<MotorLimits>,
    /// Where the coils would have it, steps.
    field: f64,
    rotor: f64,
    speed: f64,
    field_speed: f64,
    pulsed: u64,
    now: u64,
}

impl Motor {
    pub(crate) fn set_limits(&mut self, limits: Option<MotorLimits>) {
        self.limits = limits;
        self.rest();
    }

    /// The coils lost their current: friction holds the rotor where it is.
    pub(crate) const fn rest(&mut self) {
        (self.rotor, self.speed, self.field_speed) = (self.field, 0.0, 0.0);
    }

    /// The field goes on by one step; tells how many steps the rotor's place has changed.
    pub(crate) fn pulse(&mut self, now: u64, step: i32) -> i32 {
        let slipped = self.follow(now);
        self.field += f64::from(step);
        let pause = (now - self.pulsed).max(1);
        self.field_speed =
            if pause < STANDS_CYCLES { f64::from(step) * HZ as f64 / pause as f64 } else { 0.0 };
        self.pulsed = now;
        step + slipped
    }

    /// Lets time pass; tells how many steps the rotor has slipped.
    pub(crate) fn follow(&mut self, now: u64) -> i32 {
        let Some(limits) = self.limits else { return 0 };
        while self.now < now && !self.stands() {
            if self.now > self.pulsed + STANDS_CYCLES {
                self.field_speed = 0.0;
            }
            let cycles = STEP_CYCLES.min(now - self.now);
            self.integrate(&limits, cycles as f64 / HZ as f64);
            self.now += cycles;
        }
        self.now = now;
        let slipped = ((self.rotor - self.field) / CYCLE_STEPS).round() * CYCLE_STEPS;
        self.field += slipped;
        slipped as i32
    }

    fn stands(&self) -> bool {
        self.field_speed == 0.0 && self.speed.abs() < 1.0 && (self.rotor - self.field).abs() < 0.2
    }

    fn integrate(&mut self, limits: &MotorLimits, seconds: f64) {
        let torque = limits.torque(self.speed);
        let spring = torque * ((self.field - self.rotor) * FRAC_PI_2).sin();
        let swing = (limits.acceleration * FRAC_PI_2).sqrt();
        let damping = 2.0 * limits.damping * swing * (self.speed - self.field_speed);
        // The coils give no more than their torque, whatever for.
        self.speed += (spring - damping).clamp(-torque, torque) * seconds;
        // Friction takes speed away, but never turns it round.
        let friction = limits.friction * limits.acceleration * seconds;
        self.speed -= self.speed.clamp(-friction, friction);
        self.rotor += self.speed * seconds;
    }
}

#[cfg(test)]
mod tests {
    use sonard_model::motion::Trapezoid;

    use super::*;

    const LIMITS: MotorLimits =
        MotorLimits { acceleration: 100_000.0, corner_speed: 1_000.0, friction: 0.1, damping: 0.3 };

    /// Where the rotor is after a move of so many steps.
    fn turned(steps: i32, speed: u16, acceleration: u32) -> i32 {
        let mut motor = Motor { limits: Some(LIMITS), ..Motor::default() };
        let motion = Trapezoid::new(steps, speed, acceleration);
        let mut place = 0;
        for number in 1..=steps.unsigned_abs() {
            let at = HZ + (motion.pulse_s(number) * HZ as f64) as u64;
            place += motor.pulse(at, steps.signum());
        }
        place + motor.follow(HZ * 60)
    }

    #[test]
    fn a_move_within_its_torque_is_exact() {
        for (speed, acceleration) in [(100, 2_000), (800, 20_000), (1_500, 10_000), (4_000, 4_000)]
        {
            for steps in [1, 2, 5, 400, -400, 2_000] {
                assert_eq!(turned(steps, speed, acceleration), steps, "{speed} {acceleration}");
            }
        }
    }

    #[test]
    fn beyond_it_steps_are_missed_four_at_a_time() {
        // At 3,000 steps/s the torque is 0.32 of the holding torque, and 0.7 are asked for.
        let place = turned(2_000, 3_000, 60_000);
        assert!(place < 1_990, "{place}");
        assert_eq!((2_000 - place) % 4, 0);
        // More than the holding torque from rest.
        assert_ne!(turned(400, 10_000, 200_000), 400);
    }

    #[test]
    fn the_largest_steady_speed_is_where_friction_takes_all_torque() {
        let limit = LIMITS.pull_out_speed();
        assert!((limit - 1_000.0 * 99_f64.sqrt()).abs() < 1e-6);
        let below = (0.8 * limit) as u16;
        assert_eq!(turned(60_000, below, 1_000), 60_000);
        let above = (1.2 * limit) as u16;
        assert_ne!(turned(90_000, above, 1_000), 90_000);
    }

    #[test]
    fn without_limits_it_follows_everything() {
        let mut motor = Motor::default();
        let place: i32 = (1..=1_000).map(|n| motor.pulse(n, -1)).sum();
        assert_eq!(place, -1_000);
        assert_eq!(motor.follow(HZ), 0);
    }
}

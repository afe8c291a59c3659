//! Rotor of the stepper, which follows the field only within its torque.
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
//! `a0` is the holding torque over inertia and `c` the corner speed, at which the current no longer
//! rises within a step (a coil with resistance and inductance at a fixed voltage). `f` is the
//! friction, `v` the speed of the field, `w^2 = a0 pi / 2`, and `z` the damping. The voltage of the
//! coils also produces the damping: damping and spring together are at most `a(x')`. A lag or lead
//! of two steps reverses the torque: the rotor then falls into the next equivalent position of the
//! field, and four steps are missed.
//!
//! The numbers of [`MotorLimits::typical`] are assumptions, not measured on a motor.

use std::f64::consts::FRAC_PI_2;

use crate::HZ;

/// Period of the coils' field, steps.
const CYCLE_STEPS: f64 = 4.0;
/// Time step of the integration, cycles: 20 us, at most a hundredth of the rotor's own period.
const STEP_CYCLES: u64 = HZ / 50_000;
/// Time without a pulse after which the field is at rest, cycles.
const REST_CYCLES: u64 = HZ / 20;

/// Limits of a motor and its load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorLimits {
    /// Holding torque over inertia, steps/s^2.
    pub acceleration: f64,
    /// Speed at which the torque has fallen to 0.71 of the holding torque, steps/s.
    pub corner_speed: f64,
    /// Friction, as a fraction of the holding torque.
    pub friction: f64,
    /// Damping ratio of small oscillations about a step.
    pub damping: f64,
}

impl MotorLimits {
    /// Limits of a 0.4 N m motor with 400 steps per revolution that turns a transducer and its
    /// mount (1e-4 kg m^2 in total) with a driver at 12 V.
    #[must_use]
    pub const fn typical() -> Self {
        Self { acceleration: 250_000.0, corner_speed: 1_500.0, friction: 0.1, damping: 0.3 }
    }

    /// Maximum steady speed, steps/s, at which the torque has fallen to the friction.
    #[must_use]
    pub fn pull_out_speed(&self) -> f64 {
        self.corner_speed * (self.friction.powi(-2) - 1.0).max(0.0).sqrt()
    }

    fn torque(&self, speed: f64) -> f64 {
        self.acceleration / (1.0 + (speed / self.corner_speed).powi(2)).sqrt()
    }
}

/// Rotor in the field of its coils. Times are in cycles.
#[derive(Debug, Clone, Default)]
pub(crate) struct Motor {
    /// Limits of the motor; `None` for a rotor that follows the field exactly.
    limits: Option<MotorLimits>,
    /// Position of the field, steps.
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
        self.release();
    }

    /// Handles the loss of coil current: friction holds the rotor in place.
    pub(crate) const fn release(&mut self) {
        (self.rotor, self.speed, self.field_speed) = (self.field, 0.0, 0.0);
    }

    /// Advances the field by a step; returns the change of the rotor's position in steps.
    pub(crate) fn pulse(&mut self, now: u64, step: i32) -> i32 {
        let slipped = self.follow(now);
        self.field += f64::from(step);
        let pause = (now - self.pulsed).max(1);
        self.field_speed =
            if pause < REST_CYCLES { f64::from(step) * HZ as f64 / pause as f64 } else { 0.0 };
        self.pulsed = now;
        step + slipped
    }

    /// Advances the time; returns the steps by which the rotor has slipped.
    pub(crate) fn follow(&mut self, now: u64) -> i32 {
        let Some(limits) = self.limits else { return 0 };
        while self.now < now && !self.is_at_rest() {
            if self.now > self.pulsed + REST_CYCLES {
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

    fn is_at_rest(&self) -> bool {
        self.field_speed == 0.0 && self.speed.abs() < 1.0 && (self.rotor - self.field).abs() < 0.2
    }

    fn integrate(&mut self, limits: &MotorLimits, seconds: f64) {
        let torque = limits.torque(self.speed);
        let spring = torque * ((self.field - self.rotor) * FRAC_PI_2).sin();
        let swing = (limits.acceleration * FRAC_PI_2).sqrt();
        let damping = 2.0 * limits.damping * swing * (self.speed - self.field_speed);
        // The coils cannot exceed their torque, for spring and damping together.
        self.speed += (spring - damping).clamp(-torque, torque) * seconds;
        // Friction reduces the speed, but never reverses it.
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

    /// Final position of the rotor after a move of `steps`.
    fn final_position(steps: i32, speed: u16, acceleration: u32) -> i32 {
        let mut motor = Motor { limits: Some(LIMITS), ..Motor::default() };
        let motion = Trapezoid::new(steps, speed, acceleration);
        let mut position = 0;
        for number in 1..=steps.unsigned_abs() {
            let at = HZ + (motion.pulse_time_s(number) * HZ as f64) as u64;
            position += motor.pulse(at, steps.signum());
        }
        position + motor.follow(HZ * 60)
    }

    #[test]
    fn exact_within_torque() {
        for (speed, acceleration) in [(100, 2_000), (800, 20_000), (1_500, 10_000), (4_000, 4_000)]
        {
            for steps in [1, 2, 5, 400, -400, 2_000] {
                assert_eq!(
                    final_position(steps, speed, acceleration),
                    steps,
                    "{speed} {acceleration}"
                );
            }
        }
    }

    #[test]
    fn misses_multiples_of_four() {
        // At 3,000 steps/s the torque is 0.32 of the holding torque, and 0.7 are required.
        let position = final_position(2_000, 3_000, 60_000);
        assert!(position < 1_990, "{position}");
        assert_eq!((2_000 - position) % 4, 0);
        // More than the holding torque from rest.
        assert_ne!(final_position(400, 10_000, 200_000), 400);
    }

    #[test]
    fn pull_out_speed_is_the_limit() {
        let limit = LIMITS.pull_out_speed();
        assert!((limit - 1_000.0 * 99_f64.sqrt()).abs() < 1e-6);
        let below = (0.8 * limit) as u16;
        assert_eq!(final_position(60_000, below, 1_000), 60_000);
        let above = (1.2 * limit) as u16;
        assert_ne!(final_position(90_000, above, 1_000), 90_000);
    }

    #[test]
    fn unlimited_follows_exactly() {
        let mut motor = Motor::default();
        let position: i32 = (1..=1_000).map(|n| motor.pulse(n, -1)).sum();
        assert_eq!(position, -1_000);
        assert_eq!(motor.follow(HZ), 0);
    }
}

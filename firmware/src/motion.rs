//! Stepper driver: one pulse per alarm, with constant acceleration up to a maximum speed and back.
//!
//! A motor that accelerates uniformly from rest at `a` passes the middle between two steps `k - 1`
//! and `k` at `sqrt((2k - 1) / a)`: pulse `k` is output at that time. So the first pulse follows
//! after `sqrt(1 / a)`, and the pause after pulse `k` is
//! `(sqrt(2k + 1) - sqrt(2k - 1)) * sqrt(1 / a)`. Deceleration mirrors this, with `sqrt(1 / a)`
//! from the last pulse to rest. A single step takes `2 sqrt(1 / a)`.
//!
//! The recurrence of the pauses is `d(k) = d(k - 1) * (4k - 3) / (4k - 1)`, accurate to 0.2 % from
//! the fourth on (the ratio of the roots is `sqrt(1 - 1 / k)` except for terms of `1 / k^3`).

use core::arch::asm;

use crate::clock::{self, Purpose};
use crate::hardware::{CriticalSection, Shared, critical_section};
use crate::pins;

/// Unit of pauses: eighths of a tick.
const EIGHTHS_PER_SECOND: u32 = 16_000_000;
/// Maximum number of pulses in a ramp.
const MAX_RAMP: u16 = u16::MAX - 1;

static STEPPER: Shared<Stepper> = Shared::new(Stepper {
    phase: MotionPhase::AtRest,
    position: 0,
    forward: true,
    left: 0,
    ramp: 0,
    pause: 0,
    first: 0,
    cruise: 0,
    due: 0,
    eighths: 0,
    watch: None,
    seen: None,
});

struct Stepper {
    phase: MotionPhase,
    /// Position, steps.
    position: i32,
    forward: bool,
    /// Pulses left in the move.
    left: u32,
    /// Pulses required to brake to rest from the present speed.
    ramp: u16,
    /// Pause after pulse number `ramp` of an acceleration, eighths of a tick.
    pause: u32,
    /// Pause from rest to the first pulse.
    first: u32,
    /// Pause at the maximum speed.
    cruise: u32,
    due: u32,
    eighths: u8,
    /// Level of the index sensor at which to brake.
    watch: Option<bool>,
    /// Position at which that level was detected.
    seen: Option<i32>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum MotionPhase {
    AtRest,
    Moving,
    /// At rest; the result has not been taken.
    Ended,
}

/// Result of a move.
pub struct MoveEnd {
    pub position: i32,
    /// Position at which the awaited sensor level was detected.
    pub seen: Option<i32>,
}

/// Energises the motor and moves it to `target`; with `watch`, brakes as soon as the index sensor
/// has that level.
pub fn move_to(target: i32, speed: u16, acceleration: u32, watch: Option<bool>) {
    // sqrt(1 / a) in eighths of a tick: 128 sqrt(a) has 16 bits.
    let first = divide(128 * EIGHTHS_PER_SECOND, root(acceleration << 14).max(1).into());
    let cruise = divide(EIGHTHS_PER_SECOND, speed.max(1).into());
    pins::enable::low();
    critical_section(|cs| {
        let stepper = STEPPER.get(cs);
        let distance = target.wrapping_sub(stepper.position);
        stepper.forward = distance >= 0;
        if stepper.forward != crate::is_reversed() {
            pins::dir::high();
        } else {
            pins::dir::low();
        }
        stepper.left = distance.unsigned_abs();
        stepper.first = first;
        stepper.cruise = cruise;
        stepper.ramp = 0;
        stepper.pause = first;
        stepper.watch = watch;
        stepper.seen = None;
        stepper.phase = MotionPhase::Moving;
        stepper.due = clock::read_clock(cs);
        stepper.eighths = 0;
        stepper.wait(cs, first);
    });
}

/// Brakes if the motor moves. In any case [`take_move_end`] returns the final position.
pub fn brake() {
    critical_section(|cs| {
        let stepper = STEPPER.get(cs);
        if stepper.phase == MotionPhase::Moving {
            stepper.brake();
        } else {
            stepper.phase = MotionPhase::Ended;
        }
    });
}

/// Stops at once and releases the coils.
pub fn release() {
    pins::enable::high();
    critical_section(|cs| {
        let stepper = STEPPER.get(cs);
        if stepper.phase == MotionPhase::Moving {
            clock::cancel_alarm(cs);
        }
        stepper.phase = MotionPhase::AtRest;
    });
}

pub fn is_moving() -> bool {
    critical_section(|cs| STEPPER.get(cs).phase == MotionPhase::Moving)
}

/// Returns the result of the last move once.
pub fn take_move_end() -> Option<MoveEnd> {
    critical_section(|cs| {
        let stepper = STEPPER.get(cs);
        if stepper.phase != MotionPhase::Ended {
            return None;
        }
        stepper.phase = MotionPhase::AtRest;
        Some(MoveEnd { position: stepper.position, seen: stepper.seen })
    })
}

pub fn position() -> i32 {
    critical_section(|cs| STEPPER.get(cs).position)
}

/// Defines the present position as zero.
pub fn set_zero() {
    critical_section(|cs| STEPPER.get(cs).position = 0);
}

/// Subtracts `steps` from the present position.
pub fn shift_zero(steps: i32) {
    critical_section(|cs| {
        let stepper = STEPPER.get(cs);
        stepper.position = stepper.position.wrapping_sub(steps);
    });
}

/// Handles the alarm: the next pulse, or the end of the move after the last one.
pub fn step(cs: &CriticalSection) {
    let stepper = STEPPER.get(cs);
    // The motor has had the whole pause to reach its position.
    if stepper.watch.is_some_and(|level| pins::index() == level) {
        stepper.seen = Some(stepper.position);
        stepper.brake();
    }
    if stepper.left == 0 {
        stepper.phase = MotionPhase::Ended;
        clock::cancel_alarm(cs);
        clock::wake(cs);
        return;
    }
    // High while the next pause is computed: longer than the 2 us required by drivers.
    pins::step::high();
    let change = if stepper.forward { 1 } else { -1 };
    stepper.position = stepper.position.wrapping_add(change);
    stepper.left -= 1;
    let pause = stepper.next_pause();
    stepper.wait(cs, pause);
    pins::step::low();
}

impl Stepper {
    #[inline(never)]
    fn brake(&mut self) {
        self.left = self.left.min(u32::from(self.ramp));
        self.watch = None;
    }

    fn wait(&mut self, cs: &CriticalSection, pause: u32) {
        let eighths = pause + u32::from(self.eighths);
        self.eighths = (eighths & 7) as u8;
        self.due = self.due.wrapping_add(eighths >> 3);
        clock::set_alarm(cs, Purpose::Step, self.due);
    }

    /// Computes the pause after a pulse, with `left` pulses to follow.
    fn next_pause(&mut self) -> u32 {
        let ramp = u32::from(self.ramp);
        if self.left < ramp {
            return self.decelerate();
        }
        if self.left > ramp && self.ramp < MAX_RAMP {
            let mut pause = initial_pause(self.first, self.ramp + 1);
            if pause == 0 {
                pause = self.pause - divide(2 * self.pause, 4 * ramp + 3);
            }
            if pause > self.cruise {
                self.pause = pause;
                self.ramp += 1;
                if self.left == ramp + 1 {
                    // Half way between an even number of pulses: both halves of the pause belong to
                    // the fastest part.
                    return pause + divide(pause, 8 * (ramp + 1));
                }
                return pause;
            }
            return self.cruise;
        }
        self.pause.max(self.cruise)
    }

    fn decelerate(&mut self) -> u32 {
        self.ramp -= 1;
        let ramp = u32::from(self.ramp);
        let mut pause = initial_pause(self.first, self.ramp);
        if pause == 0 {
            pause = self.pause + divide(2 * self.pause, 4 * ramp + 1);
        }
        self.pause = pause;
        pause
    }
}

/// First pauses, for which the recurrence is inaccurate: `sqrt(2k + 1) - sqrt(2k - 1)` in 2048ths.
/// Returns 0 for later ones.
fn initial_pause(first: u32, ramp: u16) -> u32 {
    let share = match ramp {
        0 => return first,
        1 => 1_499,
        2 => 1_032,
        3 => 839,
        _ => return 0,
    };
    // `first` has 24 bits.
    (first >> 4) * share >> 7
}

/// Integer part of the square root.
fn root(value: u32) -> u16 {
    let mut root = 0_u16;
    let mut bit = 0x8000_u16;
    while bit != 0 {
        let candidate = root | bit;
        if u32::from(candidate) * u32::from(candidate) <= value {
            root = candidate;
        }
        bit >>= 1;
    }
    root
}

/// Computes `value / by` bit by bit in 40 us: the compiler's division takes a kilobyte.
#[inline(never)]
fn divide(value: u32, by: u32) -> u32 {
    let halves = |value: u32| (value as u16, (value >> 16) as u16);
    let ((mut low, mut high), (by_low, by_high)) = (halves(value), halves(by));
    // SAFETY: arithmetic on its own registers. Quotient bits are shifted in from below while the
    // value is shifted out into the remainder.
    unsafe {
        asm!(
            "ldi {count}, 32",
            "1: lsl {low:l}", "rol {low:h}", "rol {high:l}", "rol {high:h}",
            "rol {rest:l}", "rol {rest:h}", "rol {rest_high:l}", "rol {rest_high:h}",
            "cp {rest:l}, {by:l}", "cpc {rest:h}, {by:h}",
            "cpc {rest_high:l}, {by_high:l}", "cpc {rest_high:h}, {by_high:h}",
            "brcs 2f",
            "sub {rest:l}, {by:l}", "sbc {rest:h}, {by:h}",
            "sbc {rest_high:l}, {by_high:l}", "sbc {rest_high:h}, {by_high:h}",
            "inc {low:l}",
            "2: dec {count}",
            "brne 1b",
            count = out(reg_upper) _,
            low = inout(reg_pair) low,
            high = inout(reg_pair) high,
            rest = inout(reg_pair) 0_u16 => _,
            rest_high = inout(reg_pair) 0_u16 => _,
            by = in(reg_pair) by_low,
            by_high = in(reg_pair) by_high,
        );
    }
    u32::from(high) << 16 | u32::from(low)
}

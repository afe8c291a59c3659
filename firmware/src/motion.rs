//! The stepper: one pulse an alarm, with constant acceleration up to a largest speed and back.
//!
//! A motor that gains speed evenly from rest passes the middle between two steps `k - 1` and
//! `k` at `sqrt((2k - 1) / a)`: then pulse `k` comes. So the first comes after `sqrt(1 / a)`, the
//! pause after pulse `k` is `(sqrt(2k + 1) - sqrt(2k - 1)) * sqrt(1 / a)`, and slowing down mirrors it,
//! with `sqrt(1 / a)` from the last pulse to the stand. A single step takes `2 sqrt(1 / a)`.
//!
//! From one pause to the next: `d(k) = d(k - 1) * (4k - 3) / (4k - 1)`, right to 0.2 % from
//! the fourth on (the ratio of the roots is `sqrt(1 - 1 / k)` but for terms of `1 / k^3`).

use core::arch::asm;

use crate::clock::{self, Purpose};
use crate::hardware::{Alone, Shared, alone};
use crate::pins;

/// Pauses are kept in eighths of a tick.
const EIGHTHS_A_SECOND: u32 = 16_000_000;
/// Of a motor that gets ever faster: so many pulses at most.
const RAMP_MAX: u16 = u16::MAX - 1;

static MOTION: Shared<Motion> = Shared::new(Motion {
    phase: Phase::Standing,
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

struct Motion {
    phase: Phase,
    /// Steps.
    position: i32,
    forward: bool,
    /// Pulses still to come.
    left: u32,
    /// Pulses that braking to a stand takes now.
    ramp: u16,
    /// After pulse number `ramp` of a start, eighths of a tick.
    pause: u32,
    /// From rest to the first pulse.
    first: u32,
    /// At the largest speed.
    cruise: u32,
    due: u32,
    eighths: u8,
    /// Brake when the index reads so.
    watch: Option<bool>,
    /// Where it did.
    seen: Option<i32>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Standing,
    Turning,
    /// Stands; nobody has asked yet.
    Arrived,
}

/// What came of a move.
pub struct Arrival {
    pub position: i32,
    /// Where the watched index was seen.
    pub seen: Option<i32>,
}

/// Holds the motor and turns it to `target`; with `watch`, until the index sensor reads so.
pub fn turn(target: i32, speed: u16, acceleration: u32, watch: Option<bool>) {
    // sqrt(1 / a) in eighths of a tick: 128 sqrt(a) has 16 bits.
    let first = divide(128 * EIGHTHS_A_SECOND, root(acceleration << 14).max(1).into());
    let cruise = divide(EIGHTHS_A_SECOND, speed.max(1).into());
    pins::enable::low();
    alone(|alone| {
        let motion = MOTION.get(alone);
        let distance = target.wrapping_sub(motion.position);
        motion.forward = distance >= 0;
        if motion.forward != crate::is_reversed() {
            pins::dir::high();
        } else {
            pins::dir::low();
        }
        motion.left = distance.unsigned_abs();
        motion.first = first;
        motion.cruise = cruise;
        motion.ramp = 0;
        motion.pause = first;
        motion.watch = watch;
        motion.seen = None;
        motion.phase = Phase::Turning;
        motion.due = clock::now_alone(alone);
        motion.eighths = 0;
        motion.wait(alone, first);
    });
}

/// Brakes, if it turns; [`take_arrival`] tells where it came to stand, in any case.
pub fn brake() {
    alone(|alone| {
        let motion = MOTION.get(alone);
        if motion.phase == Phase::Turning {
            motion.brake();
        } else {
            motion.phase = Phase::Arrived;
        }
    });
}

/// Stops dead and lets go of the coils.
pub fn release() {
    pins::enable::high();
    alone(|alone| {
        let motion = MOTION.get(alone);
        if motion.phase == Phase::Turning {
            clock::cancel_alarm(alone);
        }
        motion.phase = Phase::Standing;
    });
}

pub fn is_turning() -> bool {
    alone(|alone| MOTION.get(alone).phase == Phase::Turning)
}

/// The end of the last move, once.
pub fn take_arrival() -> Option<Arrival> {
    alone(|alone| {
        let motion = MOTION.get(alone);
        if motion.phase != Phase::Arrived {
            return None;
        }
        motion.phase = Phase::Standing;
        Some(Arrival { position: motion.position, seen: motion.seen })
    })
}

pub fn position() -> i32 {
    alone(|alone| MOTION.get(alone).position)
}

/// The present position is zero from now on.
pub fn set_zero() {
    alone(|alone| MOTION.get(alone).position = 0);
}

/// The present position is `steps` less from now on.
pub fn shift_zero(steps: i32) {
    alone(|alone| {
        let motion = MOTION.get(alone);
        motion.position = motion.position.wrapping_sub(steps);
    });
}

/// The alarm: the next pulse, or the stand after the last.
pub fn step(alone: &Alone) {
    let motion = MOTION.get(alone);
    // The motor has had the whole pause to reach its position.
    if motion.watch.is_some_and(|level| pins::index() == level) {
        motion.seen = Some(motion.position);
        motion.brake();
    }
    if motion.left == 0 {
        motion.phase = Phase::Arrived;
        clock::cancel_alarm(alone);
        clock::wake(alone);
        return;
    }
    // High while the next pause is computed: more than the 2 us that drivers ask for.
    pins::step::high();
    let change = if motion.forward { 1 } else { -1 };
    motion.position = motion.position.wrapping_add(change);
    motion.left -= 1;
    let pause = motion.next_pause();
    motion.wait(alone, pause);
    pins::step::low();
}

impl Motion {
    #[inline(never)]
    fn brake(&mut self) {
        self.left = self.left.min(u32::from(self.ramp));
        self.watch = None;
    }

    fn wait(&mut self, alone: &Alone, pause: u32) {
        let eighths = pause + u32::from(self.eighths);
        self.eighths = (eighths & 7) as u8;
        self.due = self.due.wrapping_add(eighths >> 3);
        clock::set_alarm(alone, Purpose::Step, self.due);
    }

    /// The pause after a pulse, when `left` more are to come.
    fn next_pause(&mut self) -> u32 {
        let ramp = u32::from(self.ramp);
        if self.left < ramp {
            return self.slower();
        }
        if self.left > ramp && self.ramp < RAMP_MAX {
            let mut pause = early(self.first, self.ramp + 1);
            if pause == 0 {
                pause = self.pause - divide(2 * self.pause, 4 * ramp + 3);
            }
            if pause > self.cruise {
                self.pause = pause;
                self.ramp += 1;
                if self.left == ramp + 1 {
                    // Half way between an even number of pulses: the pause has two halves that
                    // both belong to the fastest part.
                    return pause + divide(pause, 8 * (ramp + 1));
                }
                return pause;
            }
            return self.cruise;
        }
        self.pause.max(self.cruise)
    }

    fn slower(&mut self) -> u32 {
        self.ramp -= 1;
        let ramp = u32::from(self.ramp);
        let mut pause = early(self.first, self.ramp);
        if pause == 0 {
            pause = self.pause + divide(2 * self.pause, 4 * ramp + 1);
        }
        self.pause = pause;
        pause
    }
}

/// The first pauses, which the recurrence does not give: `sqrt(2k + 1) - sqrt(2k - 1)` in 2048ths.
/// 0 for later ones.
fn early(first: u32, ramp: u16) -> u32 {
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

/// The integer part of the square root.
fn root(value: u32) -> u16 {
    let mut root = 0_u16;
    let mut bit = 0x8000_u16;
    while bit != 0 {
        let tried = root | bit;
        if u32::from(tried) * u32::from(tried) <= value {
            root = tried;
        }
        bit >>= 1;
    }
    root
}

/// `value / by`, bit by bit: the compiler's own division takes a kilobyte. 40 us.
#[inline(never)]
fn divide(value: u32, by: u32) -> u32 {
    let halves = |value: u32| (value as u16, (value >> 16) as u16);
    let ((mut low, mut high), (by_low, by_high)) = (halves(value), halves(by));
    // SAFETY: arithmetic on its own registers. The quotient comes in below as the value goes
    // out above, into the rest.
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

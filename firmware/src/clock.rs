//! Device time: timer 1 counts 0.5 us, its overflows make it 32 bits wide. Its second compare
//! unit is the one alarm of the board; steps and listening never need it at the same time.

use crate::hardware::{Alone, OCR1B, Shared, TCCR1A, TCCR1B, TCNT1, TIFR1, TIMSK1, alone};
use crate::{motion, ranger};

const OVERFLOWED: u8 = 1;
const OVERFLOW_INTERRUPT: u8 = 1;
const ALARM_INTERRUPT: u8 = 1 << 2;
const CAPTURE_INTERRUPT: u8 = 1 << 5;
/// An alarm nearer than this might pass before it is set, and then comes a whole turn late.
const NEAREST: i32 = 24;

static OVERFLOWS: Shared<u16> = Shared::new(0);
static ALARM: Shared<Alarm> = Shared::new(Alarm { at: 0, what: Purpose::Wake });
/// Something happened that the main loop has not seen.
static AWAKE: Shared<bool> = Shared::new(true);

struct Alarm {
    at: u32,
    what: Purpose,
}

/// What an alarm is for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Only to wake the main loop.
    Wake,
    Step,
    Listen,
}

/// Starts the clock: prescaler 8; captures of rising edges, with the noise canceler.
pub fn start() {
    TCCR1A.write(0);
    TCCR1B.write(0b1100_0010);
    TIMSK1.write(OVERFLOW_INTERRUPT | CAPTURE_INTERRUPT);
}

pub fn now() -> u32 {
    alone(now_alone)
}

#[inline(never)]
pub fn now_alone(alone: &Alone) -> u32 {
    let low = TCNT1.read_pair(alone);
    extend(alone, low)
}

/// The 32-bit time of a 16-bit reading that is less than half a turn old. Its overflow may still
/// be waiting to be counted.
pub fn extend(alone: &Alone, low: u16) -> u32 {
    let mut high = *OVERFLOWS.get(alone);
    if TIFR1.has(OVERFLOWED) && low < 0x8000 {
        high = high.wrapping_add(1);
    }
    u32::from(high) << 16 | u32::from(low)
}

/// Blinks at about 4 Hz.
pub fn blink() -> bool {
    OVERFLOWS.read() & 4 != 0
}

/// Whether `at` has come.
pub fn is_past(now: u32, at: u32) -> bool {
    (now.wrapping_sub(at) as i32) >= 0
}

/// Sets the alarm, in place of the one before.
#[inline(never)]
pub fn set_alarm(alone: &Alone, what: Purpose, at: u32) {
    let now = now_alone(alone);
    let near = (at.wrapping_sub(now) as i32) < NEAREST;
    let at = if near { now.wrapping_add(NEAREST as u32) } else { at };
    *ALARM.get(alone) = Alarm { at, what };
    OCR1B.write_pair(alone, at as u16);
    // An old match may still be flagged: the handler sees that it comes too early. The flag is
    // not cleared, because in the emulator any write to the flags clears all of them.
    TIMSK1.set(alone, ALARM_INTERRUPT);
}

pub fn cancel_alarm(alone: &Alone) {
    TIMSK1.clear(alone, ALARM_INTERRUPT);
}

/// The main loop has something to do.
pub fn wake(alone: &Alone) {
    *AWAKE.get(alone) = true;
}

/// Sleeps until something happens; not at all if something has.
pub fn rest() {
    crate::hardware::disable_interrupts();
    // SAFETY of the token: interrupts are off until the end.
    let idle = alone(|alone| !core::mem::replace(AWAKE.get(alone), false));
    if idle {
        crate::hardware::sleep();
        alone(|alone| *AWAKE.get(alone) = false);
    } else {
        crate::hardware::enable_interrupts();
    }
}

/// TIMER1_COMPB
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_12() {
    // SAFETY: an interrupt handler.
    let alone = &unsafe { Alone::in_interrupt() };
    let alarm = ALARM.get(alone);
    let now = now_alone(alone);
    if !is_past(now, alarm.at) {
        // More than a turn away: the counter passes it again.
        return;
    }
    match alarm.what {
        Purpose::Step => motion::step(alone),
        Purpose::Listen => ranger::alarm(alone, now),
        Purpose::Wake => {
            cancel_alarm(alone);
            wake(alone);
        }
    }
}

/// TIMER1_OVF
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_13() {
    // SAFETY: an interrupt handler.
    let alone = &unsafe { Alone::in_interrupt() };
    let overflows = OVERFLOWS.get(alone);
    *overflows = overflows.wrapping_add(1);
    wake(alone);
}

//! Device clock: timer 1 counts ticks of 0.5 us, and its overflows extend it to 32 bits. Its second
//! compare unit is the only alarm of the board: stepping and ranging never need it at the same
//! time.

use crate::hardware::{
    CriticalSection, OCR1B, Shared, TCCR1A, TCCR1B, TCNT1, TIFR1, TIMSK1, critical_section,
};
use crate::{motion, ranger};

const OVERFLOWED: u8 = 1;
const OVERFLOW_INTERRUPT: u8 = 1;
const ALARM_INTERRUPT: u8 = 1 << 2;
const CAPTURE_INTERRUPT: u8 = 1 << 5;
/// Minimum lead of an alarm, ticks. A nearer one might pass before it is set, and would be a whole
/// timer period late.
const MIN_LEAD: i32 = 24;

static OVERFLOWS: Shared<u16> = Shared::new(0);
static ALARM: Shared<Alarm> = Shared::new(Alarm { at: 0, purpose: Purpose::Wake });
/// Set by events that the main loop has not processed.
static EVENT_PENDING: Shared<bool> = Shared::new(true);

struct Alarm {
    at: u32,
    purpose: Purpose,
}

/// Purpose of an alarm.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Wakes the main loop only.
    Wake,
    Step,
    Ranging,
}

/// Starts the clock: prescaler 8, capture of rising edges with the noise canceller.
pub fn start() {
    TCCR1A.write(0);
    TCCR1B.write(0b1100_0010);
    TIMSK1.write(OVERFLOW_INTERRUPT | CAPTURE_INTERRUPT);
}

pub fn now() -> u32 {
    critical_section(read_clock)
}

#[inline(never)]
pub fn read_clock(cs: &CriticalSection) -> u32 {
    let low = TCNT1.read_pair(cs);
    extend(cs, low)
}

/// Extends a 16-bit timer value that is less than half a period old to 32 bits. The overflow
/// interrupt of that period may still be pending.
pub fn extend(cs: &CriticalSection, low: u16) -> u32 {
    let mut high = *OVERFLOWS.get(cs);
    if TIFR1.has(OVERFLOWED) && low < 0x8000 {
        high = high.wrapping_add(1);
    }
    u32::from(high) << 16 | u32::from(low)
}

/// Returns a level that alternates at about 4 Hz.
pub fn blink() -> bool {
    OVERFLOWS.read() & 4 != 0
}

/// Returns `true` if the time `at` has passed.
pub fn is_past(now: u32, at: u32) -> bool {
    (now.wrapping_sub(at) as i32) >= 0
}

/// Sets the alarm, replacing the previous one.
#[inline(never)]
pub fn set_alarm(cs: &CriticalSection, purpose: Purpose, at: u32) {
    let now = read_clock(cs);
    let near = (at.wrapping_sub(now) as i32) < MIN_LEAD;
    let at = if near { now.wrapping_add(MIN_LEAD as u32) } else { at };
    *ALARM.get(cs) = Alarm { at, purpose };
    OCR1B.write_pair(cs, at as u16);
    // An old match may still be flagged: the handler checks for it. The flag is not cleared,
    // because in the emulator any write to the flags clears all of them.
    TIMSK1.set(cs, ALARM_INTERRUPT);
}

pub fn cancel_alarm(cs: &CriticalSection) {
    TIMSK1.clear(cs, ALARM_INTERRUPT);
}

/// Marks work as pending for the main loop.
pub fn wake(cs: &CriticalSection) {
    *EVENT_PENDING.get(cs) = true;
}

/// Sleeps until an event, or returns immediately if one is pending.
pub fn sleep_until_event() {
    crate::hardware::disable_interrupts();
    // The token is valid because interrupts are off until the end.
    let idle = critical_section(|cs| !core::mem::replace(EVENT_PENDING.get(cs), false));
    if idle {
        crate::hardware::sleep();
        critical_section(|cs| *EVENT_PENDING.get(cs) = false);
    } else {
        crate::hardware::enable_interrupts();
    }
}

/// TIMER1_COMPB
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_12() {
    // SAFETY: an interrupt handler.
    let cs = &unsafe { CriticalSection::in_interrupt() };
    let alarm = ALARM.get(cs);
    let now = read_clock(cs);
    if !is_past(now, alarm.at) {
        // More than a timer period ahead: the counter passes this value again.
        return;
    }
    match alarm.purpose {
        Purpose::Step => motion::step(cs),
        Purpose::Ranging => ranger::alarm(cs, now),
        Purpose::Wake => {
            cancel_alarm(cs);
            wake(cs);
        }
    }
}

/// TIMER1_OVF
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_13() {
    // SAFETY: an interrupt handler.
    let cs = &unsafe { CriticalSection::in_interrupt() };
    let overflows = OVERFLOWS.get(cs);
    *overflows = overflows.wrapping_add(1);
    wake(cs);
}

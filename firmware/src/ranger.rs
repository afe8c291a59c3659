//! Ranging module: firing, recording of echoes, blanking control.
//!
//! The timer hardware raises INIT and captures ECHO, so neither time depends on the program.

use firmware_protocol::device::EchoReport;
use firmware_protocol::messages::{Blanking, Echoes, ReadingStatus};

use crate::clock::{self, Purpose};
use crate::hardware::{
    CriticalSection, ICR1, OCR1A, Shared, TCCR1A, TCCR1C, TCNT1, critical_section,
};
use crate::pins;

/// Ticks from the command to fire until INIT rises.
const LEAD: u16 = 32;
/// Duration of a BLNK pulse, ticks: at least 0.44 ms, so that the recorded echo has passed.
const BLNK_TICKS: u32 = 1_000;

const RAISE_AT_MATCH: u8 = 0b1100_0000;
const LOWER_AT_MATCH: u8 = 0b1000_0000;
const MATCH_NOW: u8 = 0b1000_0000;

static RANGING: Shared<RangingState> = Shared::new(RangingState::none());

struct RangingState {
    phase: RangingPhase,
    report: EchoReport,
    window: u32,
    /// Ticks from firing until BINH rises; 0 for never, or after it has risen.
    binh_after: u16,
    /// Time at which BLNK falls.
    blnk_until: Option<u32>,
    max_echoes: u8,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd)]
enum RangingPhase {
    Idle,
    Listening,
    /// The window is over; the report has not been taken.
    Over,
    /// ECHO was high, so the module was not fired.
    Stuck,
}

impl RangingState {
    const fn none() -> Self {
        Self {
            phase: RangingPhase::Idle,
            report: EchoReport {
                fired_ticks: 0,
                status: ReadingStatus::Echo,
                echoes: Echoes::new(),
            },
            window: 0,
            binh_after: 0,
            blnk_until: None,
            max_echoes: 0,
        }
    }

    /// Sets the alarm for the next event.
    fn schedule(&self, cs: &CriticalSection) {
        let mut after = self.window;
        if self.binh_after != 0 {
            after = after.min(u32::from(self.binh_after));
        }
        if let Some(until) = self.blnk_until {
            after = after.min(until.wrapping_sub(self.report.fired_ticks));
        }
        clock::set_alarm(cs, Purpose::Ranging, self.report.fired_ticks.wrapping_add(after));
    }
}

/// Fires, and records echoes for `window` ticks.
pub fn fire(window: u32, max_echoes: u8, blanking: Blanking) {
    let binh_after = match blanking {
        Blanking::Internal => 0,
        Blanking::Short { ticks } => ticks,
    };
    critical_section(|cs| {
        let ranging = RANGING.get(cs);
        *ranging = RangingState { window, binh_after, max_echoes, ..RangingState::none() };
        if pins::echo() {
            ranging.report.fired_ticks = clock::read_clock(cs);
            ranging.phase = RangingPhase::Stuck;
            clock::wake(cs);
            return;
        }
        ranging.report.fired_ticks = raise_init(cs);
        ranging.phase = RangingPhase::Listening;
        ranging.schedule(cs);
    });
}

/// Raises INIT with the compare unit, then hands the pin over to the port. Returns the time of the
/// rise.
fn raise_init(cs: &CriticalSection) -> u32 {
    let mut at = (clock::read_clock(cs) as u16).wrapping_add(LEAD);
    // The emulator's compare unit drops the pin when the counter wraps, so the hand-over must not
    // occur there. The chip has no such limit.
    if at > u16::MAX - LEAD {
        at = at.wrapping_add(2 * LEAD);
    }
    OCR1A.write_pair(cs, at);
    TCCR1A.write(RAISE_AT_MATCH);
    while (TCNT1.read_pair(cs).wrapping_sub(at) as i16) < 2 {}
    pins::init::high();
    TCCR1A.write(0);
    // The pin changes one tick after the match.
    clock::extend(cs, at).wrapping_add(1)
}

/// Lowers INIT and restores the state before firing.
fn lower_init(cs: &CriticalSection) {
    // The emulator's compare unit raises the pin if the counter wraps while lowering is armed.
    while TCNT1.read_pair(cs) > u16::MAX - 4 {}
    // The compare unit keeps the level of its last match and would output it when connected to the
    // pin again. It is set low first, while INIT is still high.
    TCCR1A.write(LOWER_AT_MATCH);
    TCCR1C.write(MATCH_NOW);
    pins::init::low();
    TCCR1A.write(0);
    pins::binh::low();
    pins::blnk::low();
}

/// Lowers INIT and discards the firing.
pub fn abort() {
    critical_section(|cs| {
        let ranging = RANGING.get(cs);
        if ranging.phase == RangingPhase::Listening {
            clock::cancel_alarm(cs);
            lower_init(cs);
        }
        ranging.phase = RangingPhase::Idle;
    });
}

pub fn is_ranging() -> bool {
    critical_section(|cs| RANGING.get(cs).phase == RangingPhase::Listening)
}

/// Returns the result once, after the window. The reference must be dropped before the next firing.
pub fn take_report() -> Option<&'static EchoReport> {
    critical_section(|cs| {
        let ranging = RANGING.get(cs);
        if ranging.phase < RangingPhase::Over {
            return None;
        }
        if ranging.phase == RangingPhase::Stuck {
            ranging.report.status = ReadingStatus::ModuleFault;
        }
        ranging.phase = RangingPhase::Idle;
        // SAFETY: not written before the next firing.
        Some(unsafe { &*(&raw const ranging.report) })
    })
}

/// Handles the alarm set by [`RangingState::schedule`].
pub fn alarm(cs: &CriticalSection, now: u32) {
    let ranging = RANGING.get(cs);
    let after = now.wrapping_sub(ranging.report.fired_ticks);
    if after >= ranging.window {
        lower_init(cs);
        ranging.phase = RangingPhase::Over;
        clock::cancel_alarm(cs);
        clock::wake(cs);
        return;
    }
    if ranging.binh_after != 0 && after >= u32::from(ranging.binh_after) {
        pins::binh::high();
        ranging.binh_after = 0;
    }
    if ranging.blnk_until.is_some_and(|until| clock::is_past(now, until)) {
        pins::blnk::low();
        ranging.blnk_until = None;
    }
    ranging.schedule(cs);
}

/// Handles TIMER1_CAPT, a rising edge of ECHO.
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_10() {
    // SAFETY: an interrupt handler.
    let cs = &unsafe { CriticalSection::in_interrupt() };
    let captured = clock::extend(cs, ICR1.read_pair(cs));
    let ranging = RANGING.get(cs);
    let after = captured.wrapping_sub(ranging.report.fired_ticks);
    if ranging.phase != RangingPhase::Listening || after > ranging.window {
        return;
    }
    let echoes = &mut ranging.report.echoes;
    if echoes.len() < usize::from(ranging.max_echoes)
        && echoes.push(after).is_ok()
        && echoes.len() < usize::from(ranging.max_echoes)
    {
        // Lowers ECHO and blanks the receiver until this echo has passed.
        pins::blnk::high();
        ranging.blnk_until = Some(captured.wrapping_add(BLNK_TICKS));
        ranging.schedule(cs);
    }
}

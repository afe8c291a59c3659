//! The ranging module: fires it, listens, and shortens or repeats its listening.
//!
//! INIT is raised by the timer itself, ECHO is timed by the timer itself, so neither depends on
//! what the program does meanwhile.

use firmware_protocol::device::EchoReport;
use firmware_protocol::messages::{Blanking, Echoes, ReadingStatus};

use crate::clock::{self, Purpose};
use crate::hardware::{Alone, ICR1, OCR1A, Shared, TCCR1A, TCCR1C, TCNT1, alone};
use crate::pins;

/// From the order to fire until INIT rises, ticks.
const LEAD: u16 = 32;
/// How long BLNK is held, ticks: at least 0.44 ms, so that the echo just heard has passed.
const BLNK_TICKS: u32 = 1_000;

const RAISE_AT_MATCH: u8 = 0b1100_0000;
const LOWER_AT_MATCH: u8 = 0b1000_0000;
const MATCH_NOW: u8 = 0b1000_0000;

static LISTENING: Shared<Listening> = Shared::new(Listening::none());

struct Listening {
    phase: Phase,
    report: EchoReport,
    window: u32,
    /// When BINH is to rise, ticks after firing; 0 for never, or when it has.
    binh_after: u16,
    /// When BLNK is to fall.
    blnk_until: Option<u32>,
    max_echoes: u8,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd)]
enum Phase {
    Idle,
    Listening,
    /// The window is over; nobody has asked for the echoes.
    Over,
    /// ECHO was high, so the module was not fired.
    Stuck,
}

impl Listening {
    const fn none() -> Self {
        Self {
            phase: Phase::Idle,
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

    /// Sets the alarm for whatever comes next.
    fn schedule(&self, alone: &Alone) {
        let mut after = self.window;
        if self.binh_after != 0 {
            after = after.min(u32::from(self.binh_after));
        }
        if let Some(until) = self.blnk_until {
            after = after.min(until.wrapping_sub(self.report.fired_ticks));
        }
        clock::set_alarm(alone, Purpose::Listen, self.report.fired_ticks.wrapping_add(after));
    }
}

/// Fires, and listens for `window` ticks.
pub fn fire(window: u32, max_echoes: u8, blanking: Blanking) {
    let binh_after = match blanking {
        Blanking::Internal => 0,
        Blanking::Short { ticks } => ticks,
    };
    alone(|alone| {
        let listening = LISTENING.get(alone);
        *listening = Listening { window, binh_after, max_echoes, ..Listening::none() };
        if pins::echo() {
            listening.report.fired_ticks = clock::now_alone(alone);
            listening.phase = Phase::Stuck;
            clock::wake(alone);
            return;
        }
        listening.report.fired_ticks = raise_init(alone);
        listening.phase = Phase::Listening;
        listening.schedule(alone);
    });
}

/// Lets the compare unit raise INIT, then hands the pin over to the port; tells when it rose.
fn raise_init(alone: &Alone) -> u32 {
    let mut at = (clock::now_alone(alone) as u16).wrapping_add(LEAD);
    // The emulator's compare unit drops the pin when the counter wraps, so the hand-over must
    // not fall there; the chip does not mind.
    if at > u16::MAX - LEAD {
        at = at.wrapping_add(2 * LEAD);
    }
    OCR1A.write_pair(alone, at);
    TCCR1A.write(RAISE_AT_MATCH);
    while (TCNT1.read_pair(alone).wrapping_sub(at) as i16) < 2 {}
    pins::init::high();
    TCCR1A.write(0);
    // The pin follows at the tick after the match.
    clock::extend(alone, at).wrapping_add(1)
}

/// Takes INIT away and makes everything as before firing.
fn lower_init(alone: &Alone) {
    // The emulator's compare unit raises the pin if the counter wraps while it is to lower it.
    while TCNT1.read_pair(alone) > u16::MAX - 4 {}
    // The compare unit keeps the level of its last match, and would show it as soon as it gets
    // the pin back: it is set low first, while INIT is still high.
    TCCR1A.write(LOWER_AT_MATCH);
    TCCR1C.write(MATCH_NOW);
    pins::init::low();
    TCCR1A.write(0);
    pins::binh::low();
    pins::blnk::low();
}

/// Takes INIT away and forgets the firing.
pub fn abort() {
    alone(|alone| {
        let listening = LISTENING.get(alone);
        if listening.phase == Phase::Listening {
            clock::cancel_alarm(alone);
            lower_init(alone);
        }
        listening.phase = Phase::Idle;
    });
}

pub fn is_listening() -> bool {
    alone(|alone| LISTENING.get(alone).phase == Phase::Listening)
}

/// What was heard, once, after the window; to be let go of before the next firing.
pub fn take_report() -> Option<&'static EchoReport> {
    alone(|alone| {
        let listening = LISTENING.get(alone);
        if listening.phase < Phase::Over {
            return None;
        }
        if listening.phase == Phase::Stuck {
            listening.report.status = ReadingStatus::ModuleFault;
        }
        listening.phase = Phase::Idle;
        // SAFETY: nobody writes to it before the next firing.
        Some(unsafe { &*(&raw const listening.report) })
    })
}

/// The alarm that [`Listening::schedule`] has set.
pub fn alarm(alone: &Alone, now: u32) {
    let listening = LISTENING.get(alone);
    let after = now.wrapping_sub(listening.report.fired_ticks);
    if after >= listening.window {
        lower_init(alone);
        listening.phase = Phase::Over;
        clock::cancel_alarm(alone);
        clock::wake(alone);
        return;
    }
    if listening.binh_after != 0 && after >= u32::from(listening.binh_after) {
        pins::binh::high();
        listening.binh_after = 0;
    }
    if listening.blnk_until.is_some_and(|until| clock::is_past(now, until)) {
        pins::blnk::low();
        listening.blnk_until = None;
    }
    listening.schedule(alone);
}

/// TIMER1_CAPT: ECHO rose.
#[unsafe(no_mangle)]
extern "avr-interrupt" fn __vector_10() {
    // SAFETY: an interrupt handler.
    let alone = &unsafe { Alone::in_interrupt() };
    let captured = clock::extend(alone, ICR1.read_pair(alone));
    let listening = LISTENING.get(alone);
    let after = captured.wrapping_sub(listening.report.fired_ticks);
    if listening.phase != Phase::Listening || after > listening.window {
        return;
    }
    let echoes = &mut listening.report.echoes;
    if echoes.len() < usize::from(listening.max_echoes)
        && echoes.push(after).is_ok()
        && echoes.len() < usize::from(listening.max_echoes)
    {
        // Lowers ECHO and keeps the module deaf until the same echo has passed.
        pins::blnk::high();
        listening.blnk_until = Some(captured.wrapping_add(BLNK_TICKS));
        listening.schedule(alone);
    }
}

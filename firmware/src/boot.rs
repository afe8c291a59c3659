//! Cause of the last reset, and the watchdog.

use core::arch::global_asm;
use core::mem::MaybeUninit;

use firmware_protocol::messages::ResetCause;

use crate::hardware::{WDTCSR, critical_section, feed_watchdog};

// Runs before memory is initialised, and so must disabling the watchdog: after a watchdog reset it
// keeps running with its shortest timeout. The cause is in MCUSR, or in r2 if the Optiboot loader
// has read and cleared MCUSR.
global_asm!(
    ".section .init3, \"ax\", @progbits",
    "in r24, 0x34",
    "tst r24",
    "brne 1f",
    "mov r24, r2",
    "1:",
    "sts {flags}, r24",
    "out 0x34, r1",
    "wdr",
    "ldi r24, 0x18",
    "sts 0x60, r24",
    "sts 0x60, r1",
    ".text",
    flags = sym FLAGS,
);

const POWER_ON: u8 = 1;
const EXTERNAL: u8 = 1 << 1;
const BROWN_OUT: u8 = 1 << 2;
const WATCHDOG: u8 = 1 << 3;

/// Marker left by a requested restart, which uses the watchdog.
const REQUESTED: u16 = 0x5e7a;

#[unsafe(link_section = ".noinit")]
static mut FLAGS: MaybeUninit<u8> = MaybeUninit::uninit();
#[unsafe(link_section = ".noinit")]
static mut NOTE: MaybeUninit<u16> = MaybeUninit::uninit();

pub fn reset_cause() -> ResetCause {
    // SAFETY: FLAGS was written above; NOTE may hold anything, but it does hold something:
    // memory that the compiler does not place. No other code uses either.
    let (flags, note) = unsafe {
        let note = (&raw const NOTE).cast::<u16>();
        let pair = ((&raw const FLAGS).cast::<u8>().read_volatile(), note.read_volatile());
        note.cast_mut().write_volatile(0);
        pair
    };
    if flags & POWER_ON != 0 {
        ResetCause::PowerOn
    } else if flags & BROWN_OUT != 0 {
        ResetCause::BrownOut
    } else if flags & WATCHDOG != 0 {
        if note == REQUESTED { ResetCause::Requested } else { ResetCause::Watchdog }
    } else if flags & EXTERNAL != 0 {
        ResetCause::External
    } else {
        ResetCause::Unknown
    }
}

/// Starts the watchdog: the chip restarts unless the main loop runs at least every 0.25 s.
pub fn start_watchdog() {
    feed_watchdog();
    critical_section(|_| {
        WDTCSR.write(0x18);
        WDTCSR.write(0x0c);
    });
}

/// Restarts through the watchdog, after the serial line has drained.
pub fn restart() -> ! {
    // SAFETY: as above.
    unsafe { (&raw mut NOTE).cast::<u16>().write_volatile(REQUESTED) };
    loop {
        // Interrupts stay enabled: they drain the line.
        core::hint::spin_loop();
    }
}

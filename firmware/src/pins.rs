//! Pin assignment. STEP and DIR avoid PD2 and PD3, whose external interrupts the emulator would
//! poll on every cycle.
//!
//! | pin | Arduino | |
//! | --- | --- | --- |
//! | PB0 ICP1 | D8 | ECHO, in |
//! | PB1 OC1A | D9 | INIT |
//! | PB2 | D10 | BINH |
//! | PB3 | D11 | BLNK |
//! | PB5 | D13 | status light |
//! | PC0 | A0 | index sensor, in, pulled up |
//! | PC1 | A1 | emergency stop, in, pulled up; closed to ground unless pressed |
//! | PD4 | D4 | STEP |
//! | PD5 | D5 | DIR |
//! | PD6 | D6 | ENABLE, low energises the motor |

use crate::hardware::{DDRB, DDRD, PCICR, PCMSK1, PINB, PINC, PORTB, PORTC, PORTD};
use core::arch::asm;

/// Defines an output that is switched atomically, with a single instruction.
macro_rules! output {
    ($(#[$meta:meta])* $name:ident, $port:literal, $bit:literal) => {
        $(#[$meta])*
        pub mod $name {
            use super::asm;
            #[inline(always)]
            pub fn high() {
                // SAFETY: one bit of one port.
                unsafe { asm!(concat!("sbi ", $port, ", ", $bit)) }
            }
            #[inline(always)]
            pub fn low() {
                // SAFETY: as above.
                unsafe { asm!(concat!("cbi ", $port, ", ", $bit)) }
            }
        }
    };
}

output!(init, "0x05", "1");
output!(binh, "0x05", "2");
output!(blnk, "0x05", "3");
output!(light, "0x05", "5");
output!(step, "0x0b", "4");
output!(dir, "0x0b", "5");
output!(
    /// Low energises the motor.
    enable,
    "0x0b",
    "6"
);

const ECHO: u8 = 1;
const INDEX: u8 = 1;
const EMERGENCY: u8 = 2;

/// Initialises the pins: coils off and all outputs low, before the pins become outputs.
pub fn set_up() {
    PORTB.write(0);
    DDRB.write(0b10_1110);
    PORTD.write(0b0100_0000);
    DDRD.write(0b0111_0000);
    PORTC.write(INDEX | EMERGENCY);
    // The emergency stop wakes the chip.
    PCMSK1.write(EMERGENCY);
    PCICR.write(0b10);
}

/// Ends firing and motion. Harmless at any time.
pub fn make_safe() {
    crate::hardware::TCCR1A.write(0);
    init::low();
    binh::low();
    blnk::low();
    enable::high();
    step::low();
}

#[inline(always)]
pub fn echo() -> bool {
    PINB.has(ECHO)
}

#[inline(always)]
pub fn index() -> bool {
    PINC.has(INDEX)
}

/// Returns `true` if the emergency stop is pressed or its wire is broken.
#[inline(always)]
pub fn emergency() -> bool {
    PINC.has(EMERGENCY)
}

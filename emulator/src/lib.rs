//! The firmware's machine code in an emulated ATmega328P, wired to a ranging module, a stepper
//! and a serial line.
//!
//! [`Emulator`] is deterministic: its clock is the chip's, and nothing happens unless it is run.
//! [`Bench`] sets the host's machine on the other end of its line. The program `sonard-emulator`
//! plays it on a pty at the pace of the wall clock.
//!
//! What it models: every instruction with its cycles, both timers' units that the firmware
//! uses, the UART (a byte takes 11 bits, as simavr has it), the EEPROM, the watchdog; the module's
//! blanking, latch and re-arming ([`Module`]); the motor's rotor, if it is given limits
//! ([`MotorLimits`]); dips of the supply that restart the chip ([`Emulator::dip`]). What it does
//! not: voltages, and simavr's own limits: its UART takes the next byte only a byte's time after
//! the last was read, so that some 200 bytes in a row at line speed overrun it; interrupts begin at
//! instruction boundaries, so an echo may be seen up to two cycles late.
#![cfg(feature = "simavr")]

mod emulator;
mod firmware;
mod module;
mod motor;
mod rig;
mod serve;
mod surroundings;
mod sys;

pub use emulator::{Crash, Emulator, Reset};
pub use firmware_protocol::conformance::BenchError;
pub use module::Module;
pub use motor::MotorLimits;
pub use serve::serve;
pub use surroundings::{Commanded, Surroundings};

/// The board and the host machine, joined by its line.
pub type Bench = firmware_protocol::conformance::Bench<Emulator>;

/// Clock of the chip.
pub const HZ: u64 = 16_000_000;
/// Cycles of a device tick.
pub const CYCLES_PER_TICK: u64 = HZ / firmware_protocol::messages::limits::TICK_HZ as u64;
/// Cycles of a microsecond.
pub const CYCLES_PER_US: u64 = HZ / 1_000_000;

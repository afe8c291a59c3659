//! Emulation of an ATmega328P that runs the firmware's machine code, connected to a ranging module,
//! a stepper and a serial line.
//!
//! [`Emulator`] is deterministic: its clock is the chip's, and time passes only while it is run.
//! [`Bench`] connects the host machine to its line. The program `sonard-emulator` serves it on a
//! pty in real time.
//!
//! Modelled: every instruction with its cycles; the timer units used by the firmware; the UART (a
//! byte takes 11 bits, as in simavr), the EEPROM and the watchdog; blanking, latch and re-arming of
//! the module ([`Module`]); the motor's rotor, if it has limits ([`MotorLimits`]); supply dips that
//! restart the chip ([`Emulator::dip`]).
//!
//! Not modelled: voltages. simavr has limits of its own. Its UART accepts the next byte only one
//! byte time after the last was read, so about 200 consecutive bytes at line speed overrun it.
//! Interrupts start at instruction boundaries, so an echo may be detected up to two cycles late.
#![cfg(feature = "simavr")]

mod emulator;
mod environment;
mod firmware;
mod module;
mod motor;
mod rig;
mod serve;
mod sys;

pub use emulator::{Crash, Emulator, Reset};
pub use environment::{Environment, ScriptedEnvironment};
pub use firmware_protocol::conformance::BenchError;
pub use module::Module;
pub use motor::MotorLimits;
pub use serve::serve;

/// Board and host machine, connected by a serial line.
pub type Bench = firmware_protocol::conformance::Bench<Emulator>;

/// Clock rate of the chip, Hz.
pub const HZ: u64 = 16_000_000;
/// Cycles per device tick.
pub const CYCLES_PER_TICK: u64 = HZ / firmware_protocol::messages::limits::TICK_HZ as u64;
/// Cycles per microsecond.
pub const CYCLES_PER_US: u64 = HZ / 1_000_000;

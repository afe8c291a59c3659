//! A board without a microcontroller: a Raspberry Pi that drives module and stepper from its own
//! pins, and speaks the protocol on a pty.
//!
//! [`PiBoard`] carries out what the device machine of `firmware-protocol` decides, on anything
//! that implements [`Pins`]; `GpioPins` are those of a Pi. What it can't do, because Linux is
//! between it and its pins:
//!
//! - a pulse comes late when another program has the processor. A late pulse makes the rest of
//!   the move late, so the motor is never hurried, but a move at over some 1,000 steps/s is
//!   not smooth; on a kernel without real-time scheduling, expect delays of 0.1 ms, and now and
//!   then of some milliseconds;
//! - the rise of INIT is timed by reading the clock before and after it: a reading is wrong by
//!   up to half of what passed between (usually under 1 us; the board's log tells more than 20 us);
//! - ECHO is stamped by the kernel as its interrupt is served, some 5 to 50 us after it rose
//!   (1 to 9 mm too far), where the microcontroller's capture unit is right to 0.5 us;
//! - a further echo is heard only if BLNK follows the one before at once: within [`LOOK_TICKS`]
//!   and what the processor takes;
//! - killed with SIGKILL it leaves its pins as they are: a resistor must pull ENABLE high, and
//!   the service must be restarted, which makes them safe first.

mod board;
#[cfg(test)]
mod fake;
mod gpio;
mod pins;
mod serve;

pub use board::{LOOK_TICKS, PiBoard, PiSettings};
pub use gpio::{GpioError, GpioPins, PinNumbers};
pub use pins::{Output, Pins};
pub use serve::serve;

//! Board without a microcontroller: a Raspberry Pi that drives module and stepper from its own
//! pins and serves the protocol on a pty.
//!
//! [`PiBoard`] executes the actions of the device state machine of `firmware-protocol` on any
//! implementation of [`Pins`]; `GpioPins` are the pins of a Pi. Linux between program and pins
//! causes these limitations:
//!
//! - A pulse is late when another program occupies the processor. A late pulse delays the rest of
//!   the move, so pulses never crowd, but a move at over some 1,000 steps/s is not smooth. Without
//!   real-time scheduling, expect delays of 0.1 ms, and occasionally of some milliseconds.
//! - The rise of INIT is timed by reading the clock before and after it: the error of a reading is
//!   up to half of the time between (usually under 1 us; more than 20 us is logged).
//! - ECHO is time-stamped by the kernel when its interrupt is served, some 5 to 50 us after the
//!   rise (1 to 9 mm too far). The microcontroller's capture unit is accurate to 0.5 us.
//! - A further echo is detected only if BLNK follows the previous echo at once: within
//!   [`ECHO_POLL_TICKS`] and the processor's latency.
//! - After SIGKILL the pins keep their levels: a resistor must pull ENABLE high, and the service
//!   must be restarted, which makes the pins safe first.

mod board;
mod gpio;
mod pins;
mod serve;
#[cfg(test)]
mod simulated_pins;

pub use board::{ECHO_POLL_TICKS, PiBoard, PiSettings};
pub use gpio::{GpioError, GpioPins, PinNumbers};
pub use pins::{BoardOutput, Pins};
pub use serve::serve;

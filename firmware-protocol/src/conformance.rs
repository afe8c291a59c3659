//! Conformance tests shared by all boards.
//!
//! A board implements [`DeviceUnderTest`] for itself or for its fake, and generates the tests with
//! [`conformance_tests!`](crate::conformance_tests). The tests connect the board to the real host
//! machine, or send individual frames, and check the behaviour of its pins.

mod bench;
pub mod scenarios;
mod steps;

extern crate std;

use core::fmt;
use std::vec::Vec;

pub use bench::{Bench, BenchError};

/// Board that has just been powered on, in a controllable environment.
pub trait DeviceUnderTest {
    /// Error of a board that cannot continue.
    type Error: fmt::Debug;

    /// Time since power-on, us.
    fn now_us(&self) -> u64;

    /// Advances the time by `us` microseconds.
    ///
    /// # Errors
    /// Returns an error if the board crashes.
    fn run(&mut self, us: u64) -> Result<(), Self::Error>;

    /// Sends bytes to the board.
    fn send(&mut self, bytes: &[u8]);

    /// Returns the bytes sent by the board since the last call.
    fn receive(&mut self) -> Vec<u8>;

    /// Sets the echoes of all further firings, us after the rising edge of INIT, in ascending
    /// order.
    fn set_echoes(&mut self, after_us: &[f64]);

    /// Returns the number of firings since the last call.
    fn take_firings(&mut self) -> usize;

    /// Net steps of the motor since power-on.
    fn motor_steps(&self) -> i64;

    /// Returns `true` while the motor's coils carry current.
    fn holds_coils(&self) -> bool;

    /// Tolerance of echo times, ticks.
    fn tolerance_ticks(&self) -> u32 {
        1
    }
}

/// Generates a `#[test]` for each scenario. `$board` evaluates to a board that has just been
/// powered on.
#[macro_export]
macro_rules! conformance_tests {
    ($board:expr) => {
        $crate::conformance_tests!(@each $board;
            announces_and_identifies,
            enforces_command_order,
            rejects_invalid_settings,
            times_echo_from_init,
            reports_multiple_echoes,
            ignores_echo_after_window,
            moves_exact_steps,
            sweep_fires_each_beam_once,
            repeated_request_runs_once,
            rejects_reused_sequence,
            recovers_after_noise,
            resends_lost_readings,
            lease_stops_firing,
            stop_keeps_position,
            releases_idle_coils,
            reset_clears_state,
        );
    };
    (@each $board:expr; $($name:ident),+ $(,)?) => {
        $(
            #[test]
            fn $name() {
                $crate::conformance::scenarios::$name($crate::conformance::Bench::new($board));
            }
        )+
    };
}

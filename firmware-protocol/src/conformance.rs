//! What every board must do, whatever it is made of: one set of tests for all of them.
//!
//! A board implements [`DeviceUnderTest`] for itself or for its fake, and has the tests made by
//! [`conformance_tests!`](crate::conformance_tests). They join it with the real host machine, or
//! speak to it in frames of their own, and look at what its pins do.

mod bench;
pub mod scenarios;
mod steps;

extern crate std;

use core::fmt;
use std::vec::Vec;

pub use bench::{Bench, BenchError};

/// A board that has just got its power, with something around it that can be told and asked.
pub trait DeviceUnderTest {
    /// Why it can't go on.
    type Error: fmt::Debug;

    /// Time since power came on, us.
    fn now_us(&self) -> u64;

    /// Lets so much time pass.
    ///
    /// # Errors
    /// When the board crashes.
    fn run(&mut self, us: u64) -> Result<(), Self::Error>;

    /// Bytes for the board.
    fn send(&mut self, bytes: &[u8]);

    /// What the board has sent since the last call.
    fn receive(&mut self) -> Vec<u8>;

    /// From now on each firing has these echoes, us after INIT rises, in order.
    fn set_echoes(&mut self, after_us: &[f64]);

    /// Firings since the last call.
    fn take_firings(&mut self) -> usize;

    /// Steps that the motor has turned since power came on, with their sign.
    fn motor_steps(&self) -> i64;

    /// Whether the motor's coils have current.
    fn holds_coils(&self) -> bool;

    /// By how much the time of an echo may be off, ticks.
    fn tolerance_ticks(&self) -> u32 {
        1
    }
}

/// Makes one `#[test]` of each scenario. `$board` makes a board that has just got its power.
#[macro_export]
macro_rules! conformance_tests {
    ($board:expr) => {
        $crate::conformance_tests!(@each $board;
            it_announces_itself_once_and_answers_identify_at_once,
            what_must_come_first_must_come_first,
            settings_beyond_the_limits_are_refused_by_name,
            an_echo_is_timed_from_the_rise_of_init,
            several_echoes_come_in_order_where_the_board_can_tell_them,
            an_echo_behind_the_window_is_none,
            the_motor_turns_by_exactly_what_was_asked,
            a_sweep_fires_once_at_each_beam,
            a_repeated_request_is_answered_again_and_not_done_twice,
            the_same_number_on_another_request_is_refused,
            after_noise_it_answers_at_once,
            readings_that_were_lost_are_told_again,
            a_silent_host_ends_the_firing_within_the_lease,
            a_stop_keeps_the_position,
            idle_coils_are_let_go_after_silence,
            a_restart_on_request_has_a_new_number_and_forgets_everything,
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

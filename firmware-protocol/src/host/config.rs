//! What a host is told at the start, and what it can be asked to do.

use crate::messages::{Settings, Sweep};

/// How often a request is sent before the device counts as gone: some nine seconds, in which a
/// board that the opening of its port has reset is long awake.
pub const ATTEMPTS: u8 = 7;
/// How often the time that its work takes may pass while a device says that it is at it.
pub const OVERRUNS: u8 = 3;
/// How often the Stop is sent that ends a device which the host gives up on.
pub const STOP_ATTEMPTS: u8 = 3;
/// What a reply may take beyond the time of bytes and work before that was measured, us.
pub const INITIAL_MARGIN_US: u32 = 200_000;
/// Least such margin once measured, us.
pub const MIN_MARGIN_US: u32 = 20_000;
/// Largest such margin, repetitions counted in, us.
pub const MAX_MARGIN_US: u32 = 2_000_000;
/// A sweep's host speaks at least so many times a lease.
pub const KEEP_ALIVES_A_LEASE: u8 = 3;
/// It acknowledges readings so many times while the device's memory for them fills.
pub const ACKNOWLEDGEMENTS_A_RING: u8 = 4;
/// Readings that it takes ahead of the lowest one that it lacks.
pub const READINGS_AHEAD: u8 = 64;
/// A host goes on at most so many numbers behind the last one that the device accepted.
pub const SEQ_GAP_MAX: u16 = 256;

/// Facts and limits that the host machine cannot find out by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// Speed of the line, bit/s; a byte takes ten bits.
    pub baud: u32,
    /// Any number that differs from run to run: where sequence and sweep numbers begin.
    pub seed: u32,
    /// How often a request is sent before the device counts as gone.
    pub max_attempts: u8,
    /// How often the time that its work takes may pass while a device says that it is at it.
    pub max_overruns: u8,
    /// What a reply may take beyond the time of bytes and motion, before that was measured, us.
    pub initial_margin_us: u32,
    /// Least such margin however quick the replies are, us.
    pub min_margin_us: u32,
    /// Largest such margin however slow the replies are, us.
    pub max_margin_us: u32,
}

impl HostConfig {
    /// Values that suit a USB serial adapter.
    #[must_use]
    pub const fn new(baud: u32, seed: u32) -> Self {
        Self {
            baud,
            seed,
            max_attempts: ATTEMPTS,
            max_overruns: OVERRUNS,
            initial_margin_us: INITIAL_MARGIN_US,
            min_margin_us: MIN_MARGIN_US,
            max_margin_us: MAX_MARGIN_US,
        }
    }
}

/// A command to the host machine, one at a time; [`Command::Stop`] may come in between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Meet the device. Ends with [`super::HostEvent::Identified`].
    Identify,
    /// Set up motion and ranging.
    Configure(Settings),
    /// Find home.
    Home,
    /// Turn to a position, steps from home.
    MoveTo {
        /// Steps from home.
        step: i32,
    },
    /// Fire once. A [`super::HostEvent::Reading`] comes before the end.
    Ping,
    /// Fire along a plan. The number in [`Sweep::sweep`] is filled in by the host. Ends with
    /// [`super::HostEvent::SweepDone`].
    Sweep(Sweep),
    /// Ask what the device is doing.
    Status,
    /// Stop whatever is under way.
    Stop,
    /// Restart the device. Identify afterwards.
    Reset,
}

/// The reason why a command was not started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartError {
    /// Another one is under way.
    Busy,
    /// Identify first.
    NotIdentified,
    /// The device restarted, or the line was closed, since it was identified: identify it again.
    Restarted,
    /// Configure first, so that the host can compute how long things take.
    NotConfigured,
    /// The plan has no beams, or more than a sweep may have.
    EmptySweep,
}

impl core::fmt::Display for StartError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.write_str(match self {
            Self::Busy => "another command is under way",
            Self::NotIdentified => "the device has not been identified",
            Self::Restarted => "the device restarted meanwhile",
            Self::NotConfigured => "the device has not been configured",
            Self::EmptySweep => "a sweep must have 1 to 65535 beams",
        })
    }
}

impl core::error::Error for StartError {}

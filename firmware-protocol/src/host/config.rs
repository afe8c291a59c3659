//! What a host is told at the start, and what it can be asked to do.

use crate::messages::{Settings, Sweep};

/// Facts and limits that the host machine cannot find out by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostConfig {
    /// Speed of the line, bit/s; a byte takes ten bits.
    pub baud: u32,
    /// Any number that differs from run to run: where sequence and sweep numbers begin.
    pub seed: u32,
    /// How often a request is sent before the device counts as gone.
    pub max_attempts: u8,
    /// What a reply may take beyond the time of bytes and motion, before that was measured, us.
    pub initial_margin_us: u32,
    /// Least such margin however quick the replies are, us.
    pub min_margin_us: u32,
    /// Largest such margin however slow the replies are, us.
    pub max_margin_us: u32,
}

impl HostConfig {
    /// Values that suit a USB serial adapter: ten attempts, margins of 200 ms at first and
    /// 20 ms to 2 s once measured.
    #[must_use]
    pub const fn new(baud: u32, seed: u32) -> Self {
        Self {
            baud,
            seed,
            max_attempts: 10,
            initial_margin_us: 200_000,
            min_margin_us: 20_000,
            max_margin_us: 2_000_000,
        }
    }
}

/// What the host can be asked to do, one at a time; [`Command::Stop`] may come in between.
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

/// Why a command was not begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartError {
    /// Another one is under way.
    Busy,
    /// Identify first.
    NotIdentified,
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
            Self::NotConfigured => "the device has not been configured",
            Self::EmptySweep => "a sweep must have 1 to 65535 beams",
        })
    }
}

impl core::error::Error for StartError {}

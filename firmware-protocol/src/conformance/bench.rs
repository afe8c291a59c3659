//! Board and real host machine, connected by a line, in the board's own time.

extern crate std;

use core::fmt;
use std::vec::Vec;

use super::DeviceUnderTest;
use crate::host::{Command, Host, HostConfig, HostError, HostEvent, StartError};

/// Interval at which the host polls its line, like an operating system that delivers bytes in
/// blocks.
const POLL_US: u64 = 200;

/// Board connected to a host.
#[derive(Debug)]
pub struct Bench<D> {
    /// Board under test.
    pub device: D,
    /// Host machine connected to the board.
    pub host: Host,
    /// `false` for a host that neither sends nor receives.
    pub alive: bool,
    /// Bytes transferred to the device and from the device.
    pub bytes: (u64, u64),
    events: Vec<HostEvent>,
}

/// Failure of a command on the bench.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BenchError<E> {
    /// The host machine did not start the command.
    NotStarted(StartError),
    /// The command failed on the host.
    Host(HostError),
    /// The board crashed.
    Device(E),
    /// The command did not end within the time limit.
    TimedOut,
}

impl<E: fmt::Debug> fmt::Display for BenchError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotStarted(error) => error.fmt(f),
            Self::Host(error) => error.fmt(f),
            Self::Device(error) => write!(f, "the board crashed: {error:?}"),
            Self::TimedOut => f.write_str("the command did not end"),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for BenchError<E> {}

impl<D: DeviceUnderTest> Bench<D> {
    /// Creates a bench with a new host; the board has just been powered on.
    #[must_use]
    pub fn new(device: D) -> Self {
        let host = Host::new(HostConfig::new(115_200, 1));
        Self { device, host, alive: true, bytes: (0, 0), events: Vec::new() }
    }

    /// Runs a command and returns the events up to its end.
    ///
    /// # Errors
    /// Returns an error if the command fails, or has not ended after `limit_s` seconds of device
    /// time.
    pub fn perform(
        &mut self,
        command: Command,
        limit_s: f64,
    ) -> Result<Vec<HostEvent>, BenchError<D::Error>> {
        self.start(command)?;
        let end_us = self.device.now_us() + us(limit_s);
        while self.host.is_busy() {
            if self.device.now_us() > end_us {
                return Err(BenchError::TimedOut);
            }
            self.poll_once()?;
        }
        self.take_events()
    }

    /// Starts a command.
    ///
    /// # Errors
    /// Returns an error if the host machine rejects the command.
    pub fn start(&mut self, command: Command) -> Result<(), BenchError<D::Error>> {
        self.events.clear();
        self.host.start(self.device.now_us(), command).map_err(BenchError::NotStarted)
    }

    /// Advances the device time by `seconds`.
    ///
    /// # Errors
    /// Returns an error if the board crashes.
    pub fn run(&mut self, seconds: f64) -> Result<(), BenchError<D::Error>> {
        let end_us = self.device.now_us() + us(seconds);
        while self.device.now_us() < end_us {
            self.poll_once()?;
        }
        Ok(())
    }

    /// Returns the events so far and clears them.
    ///
    /// # Errors
    /// Returns an error if one of the events is a failure.
    pub fn take_events(&mut self) -> Result<Vec<HostEvent>, BenchError<D::Error>> {
        let failed = self.events.iter().find_map(|event| match event {
            HostEvent::Failed(error) => Some(BenchError::Host(*error)),
            _ => None,
        });
        match failed {
            Some(error) => Err(error),
            None => Ok(core::mem::take(&mut self.events)),
        }
    }

    /// Returns the events so far, including failures.
    #[must_use]
    pub fn events(&self) -> &[HostEvent] {
        &self.events
    }

    fn poll_once(&mut self) -> Result<(), BenchError<D::Error>> {
        let now_us = self.device.now_us();
        let received = self.device.receive();
        if self.alive {
            if !received.is_empty() {
                self.bytes.1 += received.len() as u64;
                self.host.handle_bytes(now_us, &received);
            }
            if self.host.poll_timeout().is_some_and(|(_, at_us)| at_us <= now_us) {
                self.host.handle_timeout(now_us);
            }
            while let Some(frame) = self.host.poll_transmit() {
                self.bytes.0 += frame.len() as u64;
                self.device.send(&frame);
            }
            self.events.extend(core::iter::from_fn(|| self.host.poll_event()));
        }
        self.device.run(POLL_US).map_err(BenchError::Device)
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some seconds")]
fn us(seconds: f64) -> u64 {
    (seconds * 1e6) as u64
}

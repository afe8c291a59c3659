//! A board and the real host machine, joined by a line, in the board's own time.

extern crate std;

use core::fmt;
use std::vec::Vec;

use super::DeviceUnderTest;
use crate::host::{Command, Host, HostConfig, HostError, HostEvent, StartError};

/// How often the host looks at its line: as an operating system would hand bytes over.
const LOOK_US: u64 = 200;

/// A board and a host.
#[derive(Debug)]
pub struct Bench<D> {
    /// The board.
    pub device: D,
    /// The host.
    pub host: Host,
    /// Whether the host is alive; a dead one neither sends nor hears.
    pub alive: bool,
    /// Bytes that went over the line, to the device and from it.
    pub bytes: (u64, u64),
    events: Vec<HostEvent>,
}

/// A command that did not finish.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BenchError<E> {
    /// It was not begun.
    NotStarted(StartError),
    /// The host gave up.
    Host(HostError),
    /// The board crashed.
    Device(E),
    /// Nothing came of it in the time given.
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
    /// A bench with a host that knows nothing; the board has just got its power.
    #[must_use]
    pub fn new(device: D) -> Self {
        let host = Host::new(HostConfig::new(115_200, 1));
        Self { device, host, alive: true, bytes: (0, 0), events: Vec::new() }
    }

    /// Begins a command, and gives the events up to its end.
    ///
    /// # Errors
    /// When it fails, or has not ended after `limit_s` seconds of device time.
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
            self.turn()?;
        }
        self.take_events()
    }

    /// Begins a command.
    ///
    /// # Errors
    /// When the host machine refuses it.
    pub fn start(&mut self, command: Command) -> Result<(), BenchError<D::Error>> {
        self.events.clear();
        self.host.start(self.device.now_us(), command).map_err(BenchError::NotStarted)
    }

    /// Lets so much device time pass.
    ///
    /// # Errors
    /// When the board crashes.
    pub fn run(&mut self, seconds: f64) -> Result<(), BenchError<D::Error>> {
        let end_us = self.device.now_us() + us(seconds);
        while self.device.now_us() < end_us {
            self.turn()?;
        }
        Ok(())
    }

    /// The events so far.
    ///
    /// # Errors
    /// When one of them is a failure.
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

    /// What happened so far, failures included.
    #[must_use]
    pub fn events(&self) -> &[HostEvent] {
        &self.events
    }

    fn turn(&mut self) -> Result<(), BenchError<D::Error>> {
        let now_us = self.device.now_us();
        let said = self.device.receive();
        if self.alive {
            if !said.is_empty() {
                self.bytes.1 += said.len() as u64;
                self.host.handle_bytes(now_us, &said);
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
        self.device.run(LOOK_US).map_err(BenchError::Device)
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some seconds")]
fn us(seconds: f64) -> u64 {
    (seconds * 1e6) as u64
}

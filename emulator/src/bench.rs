//! The host's machine on the other end of the emulated line.

use std::fmt;

use firmware_protocol::host::{Command, Host, HostConfig, HostError, HostEvent, StartError};

use crate::{CYCLES_PER_US, Crash, Emulator};

/// How often the host looks at its line: as an operating system would hand bytes over.
const LOOK_US: u64 = 200;

/// A board and a host, joined by a line, in device time.
#[derive(Debug)]
pub struct Bench {
    /// The board.
    pub emulator: Emulator,
    /// The host.
    pub host: Host,
    /// Whether the host is alive; a dead one neither sends nor hears.
    pub alive: bool,
    /// Bytes that went over the line, to the device and from it.
    pub bytes: (u64, u64),
    events: Vec<HostEvent>,
}

/// Why a command did not come to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BenchError {
    /// It was not begun.
    NotStarted(StartError),
    /// The host gave up.
    Host(HostError),
    /// The firmware crashed.
    Crash(Crash),
    /// Nothing came of it in the time given.
    TimedOut,
}

impl fmt::Display for BenchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotStarted(error) => error.fmt(f),
            Self::Host(error) => error.fmt(f),
            Self::Crash(crash) => crash.fmt(f),
            Self::TimedOut => f.write_str("the command did not end"),
        }
    }
}

impl std::error::Error for BenchError {}

impl From<Crash> for BenchError {
    fn from(crash: Crash) -> Self {
        Self::Crash(crash)
    }
}

impl Bench {
    /// A bench with a host that knows nothing; the board has just got its power.
    #[must_use]
    pub fn new(emulator: Emulator) -> Self {
        let host = Host::new(HostConfig::new(115_200, 1));
        Self { emulator, host, alive: true, bytes: (0, 0), events: Vec::new() }
    }

    /// Begins a command, and gives the events up to its end.
    ///
    /// # Errors
    /// When it fails, or has not ended after `limit_s` seconds of device time.
    pub fn perform(
        &mut self,
        command: Command,
        limit_s: f64,
    ) -> Result<Vec<HostEvent>, BenchError> {
        self.start(command)?;
        let end_us = self.emulator.now_us() + (limit_s * 1e6) as u64;
        while self.host.is_busy() {
            if self.emulator.now_us() > end_us {
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
    pub fn start(&mut self, command: Command) -> Result<(), BenchError> {
        self.events.clear();
        self.host.start(self.emulator.now_us(), command).map_err(BenchError::NotStarted)
    }

    /// Lets so much device time pass.
    ///
    /// # Errors
    /// When the firmware crashes.
    pub fn run(&mut self, seconds: f64) -> Result<(), BenchError> {
        let end_us = self.emulator.now_us() + (seconds * 1e6) as u64;
        while self.emulator.now_us() < end_us {
            self.turn()?;
        }
        Ok(())
    }

    /// The events so far.
    ///
    /// # Errors
    /// When one of them is a failure.
    pub fn take_events(&mut self) -> Result<Vec<HostEvent>, BenchError> {
        let failed = self.events.iter().find_map(|event| match event {
            HostEvent::Failed(error) => Some(BenchError::Host(*error)),
            _ => None,
        });
        match failed {
            Some(error) => Err(error),
            None => Ok(std::mem::take(&mut self.events)),
        }
    }

    /// What happened so far, failures included.
    #[must_use]
    pub fn events(&self) -> &[HostEvent] {
        &self.events
    }

    fn turn(&mut self) -> Result<(), BenchError> {
        let now_us = self.emulator.now_us();
        let from_chip = self.emulator.received();
        if self.alive {
            if !from_chip.is_empty() {
                self.bytes.1 += from_chip.len() as u64;
                self.host.handle_bytes(now_us, &from_chip);
            }
            if self.host.poll_timeout().is_some_and(|(_, at_us)| at_us <= now_us) {
                self.host.handle_timeout(now_us);
            }
            while let Some(frame) = self.host.poll_transmit() {
                self.bytes.0 += frame.len() as u64;
                self.emulator.send(&frame);
            }
            while let Some(event) = self.host.poll_event() {
                self.events.push(event);
            }
        }
        Ok(self.emulator.run(LOOK_US * CYCLES_PER_US)?)
    }
}

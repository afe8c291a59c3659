//! GPIO of systems without a driver: the part of rppal's interface that this crate uses. No value
//! of these types exists, since opening the pins fails.

use std::{convert::Infallible, io, time::Duration};

use thiserror::Error;

/// Failure to use the pins.
#[derive(Debug, Error)]
pub enum Error {
    /// The computer is not a Raspberry Pi.
    #[error("unknown model")]
    UnknownModel,
    /// Missing access to the named device; never returned.
    #[error("permission denied: {0}")]
    PermissionDenied(String),
    /// Error of the system; never returned.
    #[error(transparent)]
    Io(io::Error),
}

/// Edge that causes an interrupt.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Trigger {
    RisingEdge,
}

/// Logic level of an output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Level;

impl From<bool> for Level {
    fn from(_: bool) -> Self {
        Self
    }
}

#[derive(Debug)]
pub(crate) struct Gpio(Infallible);
#[derive(Debug)]
pub(crate) struct Pin(Infallible);
#[derive(Debug)]
pub(crate) struct InputPin(Infallible);
#[derive(Debug)]
pub(crate) struct OutputPin(Infallible);

/// Interrupt of an input.
#[derive(Debug)]
pub(crate) struct Event {
    pub(crate) timestamp: Duration,
}

/// Fails: the computer is not a Raspberry Pi.
pub(crate) fn check_model() -> Result<(), Error> {
    Err(Error::UnknownModel)
}

impl Gpio {
    pub(crate) fn new() -> Result<Self, Error> {
        Err(Error::UnknownModel)
    }

    pub(crate) fn get(&self, _number: u8) -> Result<Pin, Error> {
        match self.0 {}
    }
}

impl Pin {
    pub(crate) fn into_input(self) -> InputPin {
        match self.0 {}
    }

    pub(crate) fn into_input_pullup(self) -> InputPin {
        match self.0 {}
    }

    pub(crate) fn into_output_low(self) -> OutputPin {
        match self.0 {}
    }

    pub(crate) fn into_output_high(self) -> OutputPin {
        match self.0 {}
    }
}

impl InputPin {
    pub(crate) fn set_interrupt(&mut self, _: Trigger, _: Option<Duration>) -> Result<(), Error> {
        match self.0 {}
    }

    pub(crate) fn poll_interrupt(
        &mut self,
        _reset: bool,
        _timeout: Option<Duration>,
    ) -> Result<Option<Event>, Error> {
        match self.0 {}
    }

    pub(crate) fn is_low(&self) -> bool {
        match self.0 {}
    }

    pub(crate) fn is_high(&self) -> bool {
        match self.0 {}
    }
}

impl OutputPin {
    pub(crate) fn set_low(&mut self) {
        match self.0 {}
    }

    pub(crate) fn set_high(&mut self) {
        match self.0 {}
    }

    pub(crate) fn write(&mut self, _: Level) {
        match self.0 {}
    }
}

//! GPIO of Linux on a Raspberry Pi.

pub(crate) use rppal::gpio::{Error, Gpio, InputPin, OutputPin, Trigger};

/// Checks that the computer is a Raspberry Pi.
pub(crate) fn check_model() -> Result<(), Error> {
    rppal::system::DeviceInfo::new().map(drop).map_err(|_| Error::UnknownModel)
}

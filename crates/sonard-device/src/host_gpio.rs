//! Pins of the computer that the ranger hangs on: reset line, module's power, home switch,
//! emergency stop and status light. Behind a trait, because most computers have none of them.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

use sonard_api::config::GpioKeys;
use thiserror::Error;

/// The host's pins around the ranger. Without a pin, doing is nothing and
/// seeing is `None`.
pub trait HostGpio: Send {
    /// Whether the microcontroller can be reset.
    fn can_reset(&self) -> bool {
        false
    }
    /// Pulls the microcontroller's reset line for 50 ms.
    fn reset(&mut self) {}
    /// Switches the ranging module's supply. It must not fire within 5 ms of power-up, which the
    /// time to open a port exceeds.
    fn set_power(&mut self, _on: bool) {}
    /// Whether the motor stands at home.
    fn at_home(&self) -> Option<bool> {
        None
    }
    /// Whether the emergency stop is pressed.
    fn emergency_stop(&self) -> Option<bool> {
        None
    }
    /// Switches the status light.
    fn set_light(&mut self, _on: bool) {}
}

/// A computer without such pins.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoGpio;

impl HostGpio for NoGpio {}

/// Configured pins that can't be used.
#[derive(Debug, Error)]
pub enum HostGpioError {
    /// Built without them.
    #[error("the configuration names pins, but this sonard was built without the feature pi")]
    NotBuilt,
    /// No Raspberry Pi, or no access to its pins.
    #[cfg(feature = "pi")]
    #[error("the pins of [gpio] can't be used: {0}")]
    Gpio(crate::pi::GpioError),
}

impl HostGpioError {
    /// What a person can do about it.
    #[must_use]
    pub const fn help(&self) -> &'static str {
        match self {
            Self::NotBuilt => "build with --features pi, or take the pins out of [gpio]",
            #[cfg(feature = "pi")]
            Self::Gpio(crate::pi::GpioError::NotAPi) => {
                "take the pins out of [gpio]: the daemon runs without them on any computer"
            }
            #[cfg(feature = "pi")]
            Self::Gpio(error) => error.help(),
        }
    }
}

/// Checks that this program and this computer have pins if the configuration names some; no pin is touched.
///
/// # Errors
/// When they have none.
pub fn check(keys: &GpioKeys) -> Result<(), HostGpioError> {
    if *keys == GpioKeys::default() {
        return Ok(());
    }
    #[cfg(feature = "pi")]
    return match rppal::system::DeviceInfo::new() {
        Ok(_) => Ok(()),
        Err(_) => Err(HostGpioError::Gpio(crate::pi::GpioError::NotAPi)),
    };
    #[cfg(not(feature = "pi"))]
    Err(HostGpioError::NotBuilt)
}

/// The pins that the configuration names.
///
/// # Errors
/// When it names some and they can't be used: a reset line or an emergency stop that is
/// silently not there would be worse than no daemon.
pub fn open(keys: &GpioKeys) -> Result<Box<dyn HostGpio>, HostGpioError> {
    if *keys == GpioKeys::default() {
        return Ok(Box::new(NoGpio));
    }
    #[cfg(feature = "pi")]
    return match raspberry_pi::Pins::open(keys) {
        Ok(pins) => Ok(Box::new(pins)),
        Err(error) => Err(HostGpioError::Gpio(error.into())),
    };
    #[cfg(not(feature = "pi"))]
    Err(HostGpioError::NotBuilt)
}

#[cfg(feature = "pi")]
mod raspberry_pi {
    use std::{thread, time::Duration};

    use rppal::gpio::{Error, Gpio, InputPin, OutputPin};
    use sonard_api::config::GpioKeys;

    use super::HostGpio;

    const RESET: Duration = Duration::from_millis(50);

    /// Pins of a Raspberry Pi, by their BCM numbers. Outputs go back to inputs when dropped.
    #[derive(Debug)]
    pub(super) struct Pins {
        reset: Option<OutputPin>,
        power: Option<OutputPin>,
        light: Option<OutputPin>,
        home: Option<InputPin>,
        stop: Option<InputPin>,
    }

    impl Pins {
        pub(super) fn open(keys: &GpioKeys) -> Result<Self, Error> {
            let gpio = Gpio::new()?;
            let pin = |number: Option<u8>| number.map(|number| gpio.get(number)).transpose();
            Ok(Self {
                // The line has a pull-up on the microcontroller's side: high is let go.
                reset: pin(keys.reset_pin)?.map(|pin| pin.into_output_high()),
                power: pin(keys.power_pin)?.map(|pin| pin.into_output_low()),
                light: pin(keys.light_pin)?.map(|pin| pin.into_output_low()),
                home: pin(keys.home_pin)?.map(|pin| pin.into_input_pullup()),
                stop: pin(keys.stop_pin)?.map(|pin| pin.into_input_pullup()),
            })
        }
    }

    impl HostGpio for Pins {
        fn can_reset(&self) -> bool {
            self.reset.is_some()
        }

        fn reset(&mut self) {
            if let Some(pin) = &mut self.reset {
                pin.set_low();
                thread::sleep(RESET);
                pin.set_high();
            }
        }

        fn set_power(&mut self, on: bool) {
            if let Some(pin) = &mut self.power {
                pin.write(on.into());
            }
        }

        fn at_home(&self) -> Option<bool> {
            self.home.as_ref().map(InputPin::is_low)
        }

        fn emergency_stop(&self) -> Option<bool> {
            self.stop.as_ref().map(InputPin::is_high)
        }

        fn set_light(&mut self, on: bool) {
            if let Some(pin) = &mut self.light {
                pin.write(on.into());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_pins_in_the_configuration_there_are_none_and_no_error() {
        let gpio = open(&GpioKeys::default()).expect("nothing to open");
        assert!(!gpio.can_reset());
        assert_eq!((gpio.at_home(), gpio.emergency_stop()), (None, None));
    }

    #[test]
    fn pins_that_can_not_be_used_are_refused_with_a_way_out() {
        let keys = GpioKeys { stop_pin: Some(23), ..GpioKeys::default() };
        // On a Raspberry Pi with the feature they can.
        if let Err(error) = open(&keys) {
            assert!(error.help().contains("[gpio]"), "{error}");
        }
    }
}

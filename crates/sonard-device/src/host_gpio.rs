//! GPIO pins of the host computer: reset line, module supply, home switch, emergency stop and
//! status light. Behind a trait, because most computers have none of them.
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

use sonard_api::config::GpioKeys;
use thiserror::Error;

/// GPIO pins of the host that are wired to the ranger. Without a pin, an output does nothing and
/// an input is `None`.
pub trait HostGpio: Send {
    /// Returns `true` if a reset line is configured.
    fn can_reset(&self) -> bool {
        false
    }
    /// Pulls the microcontroller's reset line for 50 ms.
    fn reset(&mut self) {}
    /// Switches the ranging module's supply. The module must not fire within 5 ms of power-up;
    /// opening a port takes longer.
    fn set_power(&mut self, _on: bool) {}
    /// State of the home switch; `Some(true)` if the motor is at home.
    fn at_home(&self) -> Option<bool> {
        None
    }
    /// State of the emergency stop; `Some(true)` if pressed.
    fn emergency_stop(&self) -> Option<bool> {
        None
    }
    /// Switches the status light.
    fn set_light(&mut self, _on: bool) {}
}

/// Host without GPIO pins.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoHostGpio;

impl HostGpio for NoHostGpio {}

/// Failure to use the configured pins.
#[derive(Debug, Error)]
pub enum HostGpioError {
    /// The feature `pi` is not compiled in.
    #[error("the configuration names pins, but this sonard was built without the feature pi")]
    NotBuilt,
    /// No Raspberry Pi, or no access to its pins.
    #[cfg(feature = "pi")]
    #[error("the pins of [gpio] can't be used: {0}")]
    Gpio(crate::pi::GpioError),
}

impl HostGpioError {
    /// Suggests a remedy.
    #[must_use]
    pub const fn help(&self) -> &'static str {
        match self {
            Self::NotBuilt => "build with --features pi, or remove the pins from [gpio]",
            #[cfg(feature = "pi")]
            Self::Gpio(crate::pi::GpioError::NotAPi) => {
                "remove the pins from [gpio]: the daemon runs without them on any computer"
            }
            #[cfg(feature = "pi")]
            Self::Gpio(error) => error.help(),
        }
    }
}

/// Checks that this program and this computer support the configured pins, without touching any.
///
/// # Errors
/// If pins are configured but not supported.
pub fn check(keys: &GpioKeys) -> Result<(), HostGpioError> {
    if *keys == GpioKeys::default() {
        return Ok(());
    }
    #[cfg(feature = "pi")]
    return crate::platform::gpio::check_model().map_err(|error| HostGpioError::Gpio(error.into()));
    #[cfg(not(feature = "pi"))]
    Err(HostGpioError::NotBuilt)
}

/// Opens the configured pins.
///
/// # Errors
/// If a configured pin can't be used. A reset line or an emergency stop that is missing without
/// notice would be worse than no daemon.
pub fn open(keys: &GpioKeys) -> Result<Box<dyn HostGpio>, HostGpioError> {
    if *keys == GpioKeys::default() {
        return Ok(Box::new(NoHostGpio));
    }
    #[cfg(feature = "pi")]
    return match raspberry_pi::BcmPins::open(keys) {
        Ok(pins) => Ok(Box::new(pins)),
        Err(error) => Err(HostGpioError::Gpio(error.into())),
    };
    #[cfg(not(feature = "pi"))]
    Err(HostGpioError::NotBuilt)
}

#[cfg(feature = "pi")]
mod raspberry_pi {
    use std::{thread, time::Duration};

    use sonard_api::config::GpioKeys;

    use super::HostGpio;
    use crate::platform::gpio::{Error, Gpio, InputPin, OutputPin};

    const RESET: Duration = Duration::from_millis(50);

    /// Pins of a Raspberry Pi by BCM number. Outputs become inputs again when dropped.
    #[derive(Debug)]
    pub(super) struct BcmPins {
        reset: Option<OutputPin>,
        power: Option<OutputPin>,
        light: Option<OutputPin>,
        home: Option<InputPin>,
        stop: Option<InputPin>,
    }

    impl BcmPins {
        pub(super) fn open(keys: &GpioKeys) -> Result<Self, Error> {
            let gpio = Gpio::new()?;
            let pin = |number: Option<u8>| number.map(|number| gpio.get(number)).transpose();
            Ok(Self {
                // The line has a pull-up on the microcontroller's side: high means released.
                reset: pin(keys.reset_pin)?.map(|pin| pin.into_output_high()),
                power: pin(keys.power_pin)?.map(|pin| pin.into_output_low()),
                light: pin(keys.status_led_pin)?.map(|pin| pin.into_output_low()),
                home: pin(keys.home_pin)?.map(|pin| pin.into_input_pullup()),
                stop: pin(keys.stop_pin)?.map(|pin| pin.into_input_pullup()),
            })
        }
    }

    impl HostGpio for BcmPins {
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
    fn no_configured_pins_is_no_error() {
        let gpio = open(&GpioKeys::default()).expect("nothing to open");
        assert!(!gpio.can_reset());
        assert_eq!((gpio.at_home(), gpio.emergency_stop()), (None, None));
    }

    #[test]
    fn unusable_pins_have_a_remedy() {
        let keys = GpioKeys { stop_pin: Some(23), ..GpioKeys::default() };
        // Opening succeeds on a Raspberry Pi with the feature.
        if let Err(error) = open(&keys) {
            assert!(error.help().contains("[gpio]"), "{error}");
        }
    }
}

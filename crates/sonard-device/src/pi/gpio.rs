//! GPIO pins of a Raspberry Pi, through rppal.

use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};
use thiserror::Error;

use super::pins::{BoardOutput, Pins};
use crate::platform::gpio::{self, Gpio, InputPin, OutputPin, Trigger};

/// Nanoseconds per tick.
const TICK_NS: u64 = 500;
/// High time of STEP, ticks.
const STEP_PULSE_TICKS: u64 = 6;
/// Duration of the rise of INIT above which a warning is logged, ticks.
const SLOW_RISE_TICKS: u64 = 40;

/// BCM numbers of the pins.
#[derive(Debug, Clone, Copy, clap::Args)]
#[command(next_help_heading = "Pins (BCM numbers)")]
pub struct PinNumbers {
    /// INIT of the module
    #[arg(long, value_name = "BCM", default_value_t = 17)]
    pub init: u8,
    /// ECHO of the module, through a level shifter: it is 5 V
    #[arg(long, value_name = "BCM", default_value_t = 27)]
    pub echo: u8,
    /// BINH of the module
    #[arg(long, value_name = "BCM", default_value_t = 22)]
    pub binh: u8,
    /// BLNK of the module
    #[arg(long, value_name = "BCM", default_value_t = 23)]
    pub blnk: u8,
    /// STEP of the motor's driver
    #[arg(long, value_name = "BCM", default_value_t = 5)]
    pub step: u8,
    /// DIR of the motor's driver
    #[arg(long, value_name = "BCM", default_value_t = 6)]
    pub dir: u8,
    /// ENABLE of the motor's driver, low to hold the motor
    #[arg(long, value_name = "BCM", default_value_t = 13)]
    pub enable: u8,
    /// Index sensor, low at the index, if there is one
    #[arg(long, value_name = "BCM")]
    pub index: Option<u8>,
    /// Emergency stop, closed to ground unless pressed, if there is one
    #[arg(long, value_name = "BCM")]
    pub emergency_stop: Option<u8>,
}

/// Failure to use the GPIO pins.
#[derive(Debug, Error)]
pub enum GpioError {
    /// The computer is not a known Raspberry Pi.
    #[error("this is not a Raspberry Pi (or an unknown model)")]
    NotAPi,
    /// This user has no access to the pins.
    #[error("no permission to use the pins: {0}")]
    Permission(String),
    /// Any other error of the GPIO library.
    #[error("cannot use the pins: {0}")]
    Other(gpio::Error),
}

impl GpioError {
    /// Suggests a remedy.
    #[must_use]
    pub const fn help(&self) -> &'static str {
        match self {
            Self::NotAPi => {
                "on another computer use a board with the firmware (`sonard scan --port`), or try \
                 `sonard mock` without a board"
            }
            Self::Permission(_) => {
                "add yourself to the group `gpio` (`sudo usermod -aG gpio $USER`), then log in again"
            }
            Self::Other(_) => "check the pin numbers, and that no other program uses these pins",
        }
    }
}

impl From<gpio::Error> for GpioError {
    fn from(error: gpio::Error) -> Self {
        match error {
            gpio::Error::UnknownModel => Self::NotAPi,
            gpio::Error::PermissionDenied(path) => Self::Permission(path),
            error => Self::Other(error),
        }
    }
}

/// GPIO pins of this computer; released when dropped.
#[derive(Debug)]
pub struct GpioPins {
    init: OutputPin,
    binh: OutputPin,
    blnk: OutputPin,
    step: OutputPin,
    dir: OutputPin,
    enable: OutputPin,
    echo: InputPin,
    index: Option<InputPin>,
    emergency: Option<InputPin>,
}

impl GpioPins {
    /// Opens the pins at safe levels: no coil current, no firing.
    ///
    /// # Errors
    /// If the computer is not a Raspberry Pi, permission is missing, or a pin is in use.
    pub fn open(numbers: &PinNumbers) -> Result<Self, GpioError> {
        let gpio = Gpio::new()?;
        let low = |number| Ok::<_, GpioError>(gpio.get(number)?.into_output_low());
        let pulled_up = |number: Option<u8>| {
            number
                .map(|number| Ok::<_, GpioError>(gpio.get(number)?.into_input_pullup()))
                .transpose()
        };
        let mut echo = gpio.get(numbers.echo)?.into_input();
        echo.set_interrupt(Trigger::RisingEdge, None)?;
        Ok(Self {
            // The coils are switched off first.
            enable: gpio.get(numbers.enable)?.into_output_high(),
            init: low(numbers.init)?,
            binh: low(numbers.binh)?,
            blnk: low(numbers.blnk)?,
            step: low(numbers.step)?,
            dir: low(numbers.dir)?,
            echo,
            index: pulled_up(numbers.index)?,
            emergency: pulled_up(numbers.emergency_stop)?,
        })
    }
}

impl Pins for GpioPins {
    fn now(&mut self) -> u64 {
        now()
    }

    fn set(&mut self, output: BoardOutput, high: bool) {
        let pin = match output {
            BoardOutput::Init => &mut self.init,
            BoardOutput::Binh => &mut self.binh,
            BoardOutput::Blnk => &mut self.blnk,
            BoardOutput::Step => &mut self.step,
            BoardOutput::Dir => &mut self.dir,
            BoardOutput::Enable => &mut self.enable,
        };
        pin.write(high.into());
    }

    fn raise_init(&mut self) -> u64 {
        let before = now();
        self.init.set_high();
        let took = now() - before;
        if took > SLOW_RISE_TICKS {
            tracing::warn!("the time of INIT is uncertain by {} us", took / 2);
        }
        before + took / 2
    }

    fn pulse(&mut self) {
        self.step.set_high();
        let end = now() + STEP_PULSE_TICKS;
        while now() < end {
            std::hint::spin_loop();
        }
        self.step.set_low();
    }

    fn echo(&mut self) -> bool {
        self.echo.is_high()
    }

    fn next_echo(&mut self) -> Option<u64> {
        let event = self.echo.poll_interrupt(false, Some(Duration::ZERO)).ok().flatten()?;
        Some(ticks(event.timestamp))
    }

    fn at_index(&mut self) -> Option<bool> {
        self.index.as_ref().map(InputPin::is_low)
    }

    fn emergency(&mut self) -> Option<bool> {
        self.emergency.as_ref().map(InputPin::is_high)
    }
}

/// Time on the clock of the kernel's interrupt time stamps, ticks.
fn now() -> u64 {
    let time = clock_gettime(ClockId::Monotonic);
    let seconds = u64::try_from(time.tv_sec).unwrap_or(0);
    let nanoseconds = u32::try_from(time.tv_nsec).unwrap_or(0);
    ticks(Duration::new(seconds, nanoseconds))
}

fn ticks(time: Duration) -> u64 {
    u64::try_from(time.as_nanos() / u128::from(TICK_NS)).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_computer_is_an_error() {
        let numbers = PinNumbers {
            init: 17,
            echo: 27,
            binh: 22,
            blnk: 23,
            step: 5,
            dir: 6,
            enable: 13,
            index: None,
            emergency_stop: None,
        };
        let Err(error) = GpioPins::open(&numbers) else { return };
        assert!(matches!(error, GpioError::NotAPi | GpioError::Permission(_)), "{error}");
        assert!(!error.help().is_empty());
    }

    #[test]
    fn clock_counts_half_microseconds() {
        assert_eq!(ticks(Duration::from_millis(3)), 6_000);
        let before = now();
        std::thread::sleep(Duration::from_millis(2));
        assert!(now() - before >= 4_000);
    }
}

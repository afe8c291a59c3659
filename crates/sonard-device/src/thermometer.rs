//! Thermometer read from a file of a Linux driver (1-wire, hwmon, thermal).
#![warn(clippy::expect_used, clippy::indexing_slicing, clippy::panic)]

mod file;
mod plausibility;
mod scratchpad;

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use sonard_model::acoustics::Air;
use thiserror::Error;
use tokio::{
    sync::oneshot,
    time::{Instant, sleep, timeout},
};

use file::read_file;
pub use plausibility::{Admission, FastChange, MAX_SLOPE_K_S, MAX_STEP_K, Plausibility};
use scratchpad::Scratchpad;

/// Maximum attempts per reading: a 1-wire bus occasionally garbles one.
const MAX_ATTEMPTS: u32 = 3;
const RETRY_PAUSE: Duration = Duration::from_millis(300);
/// Time allowed for one attempt: a 1-wire conversion takes most of a second.
const READ_TIMEOUT: Duration = Duration::from_secs(10);

/// Thermometer file with the state of its plausibility checks.
#[derive(Debug)]
pub struct Thermometer {
    file: PathBuf,
    /// Time origin of `plausibility`.
    epoch: Instant,
    plausibility: Plausibility,
    last_valid: Option<(f64, Instant)>,
    /// Name of the chip at the first reading.
    chip: Option<String>,
    /// Pending read attempt.
    pending: Option<oneshot::Receiver<Result<Sample, ThermometerFault>>>,
    remark: Option<String>,
    has_remarked_registers: bool,
}

/// Failed or rejected reading of a thermometer.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{}: {fault}", file.display())]
pub struct ThermometerError {
    /// Path of the thermometer's file.
    pub file: PathBuf,
    /// Cause of the failure.
    pub fault: ThermometerFault,
}

/// Cause of a failed or rejected reading.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ThermometerFault {
    /// The file can't be opened or read.
    #[error("{0}")]
    Unreadable(String),
    /// The path is not a regular file.
    #[error("it is {0}, not a thermometer's file")]
    NotAFile(&'static str),
    /// The driver does not return.
    #[error("reading it takes more than {} s", READ_TIMEOUT.as_secs())]
    TimedOut,
    /// The file is longer than any thermometer's.
    #[error("it is too long for a thermometer's file")]
    TooLong,
    /// The file is binary.
    #[error("it is not a text file")]
    NotText,
    /// The file is empty.
    #[error("it is empty")]
    Empty,
    /// The two lines of `w1_slave` are incomplete.
    #[error("it is cut off: {0} is missing")]
    CutOff(&'static str),
    /// The text is not a number.
    #[error("{0:?} is not a number of thousandths of a degree")]
    NotANumber(String),
    /// The sensor's checksum is wrong.
    #[error("the sensor's checksum is wrong")]
    Checksum,
    /// All registers are equal.
    #[error("all registers of the sensor are {0:02x}: check its supply, ground and data line")]
    StuckBus(u8),
    /// A register has an impossible value.
    #[error("the sensor can't have these registers: {0}")]
    ImpossibleRegisters(String),
    /// The value is the power-on value of a DS18B20.
    #[error(
        "85 C is the value of a DS18B20 before its first conversion: check its supply and pull-up"
    )]
    PowerOnValue,
    /// The temperature is outside of the model's range for air.
    #[error("{0}")]
    OutOfAirRange(String),
    /// The sensor measures a part of the computer.
    #[error(
        "it belongs to {0}, which does not measure the air: give the path of the air's sensor (hwmon \
         numbers change from boot to boot; the path under /sys/devices does not)"
    )]
    NotAmbient(String),
    /// The file belongs to another chip than before.
    #[error("it belongs to {now} now and to {before} before: give a path that stays the same")]
    OtherChip {
        /// Chip at the first reading.
        before: String,
        /// Chip at present.
        now: String,
    },
    /// The temperature changed faster than that of air.
    #[error("{0}")]
    TooFast(FastChange),
}

/// Temperature as read from a file.
#[derive(Debug, Clone, PartialEq)]
struct Sample {
    temperature_c: f64,
    chip: Option<String>,
    /// `true` if the registers are not those of a genuine sensor.
    is_unusual: bool,
}

impl ThermometerFault {
    /// Returns `true` if an immediate retry may succeed.
    const fn is_transient(&self) -> bool {
        !matches!(
            self,
            Self::NotAFile(_) | Self::TimedOut | Self::NotAmbient(_) | Self::OtherChip { .. }
        )
    }
}

impl Thermometer {
    /// Creates a thermometer without reading it.
    #[must_use]
    pub fn new(file: impl Into<PathBuf>) -> Self {
        Self {
            file: file.into(),
            epoch: Instant::now(),
            plausibility: Plausibility::default(),
            last_valid: None,
            chip: None,
            pending: None,
            remark: None,
            has_remarked_registers: false,
        }
    }

    /// Reads the temperature, degrees Celsius. Takes a second with a 1-wire sensor, and at most
    /// about 30 s.
    ///
    /// # Errors
    /// If the file can't be read, or the value is impossible for the sensor or implausible for air.
    pub async fn read(&mut self) -> Result<f64, ThermometerError> {
        let mut attempts = 0;
        loop {
            let read = self.read_once().await;
            attempts += 1;
            match read {
                Ok(temperature_c) => {
                    self.last_valid = Some((temperature_c, Instant::now()));
                    return Ok(temperature_c);
                }
                Err(fault) if attempts == MAX_ATTEMPTS || !fault.is_transient() => {
                    return Err(ThermometerError { file: self.file.clone(), fault });
                }
                Err(_) => sleep(RETRY_PAUSE).await,
            }
        }
    }

    /// Last valid temperature, degrees Celsius, and its age.
    #[must_use]
    pub fn last_valid(&self) -> Option<(f64, Duration)> {
        self.last_valid.map(|(temperature_c, at)| (temperature_c, at.elapsed()))
    }

    /// Takes the pending remark on accepted readings, if any.
    pub fn take_remark(&mut self) -> Option<String> {
        self.remark.take()
    }

    async fn read_once(&mut self) -> Result<f64, ThermometerFault> {
        let sample = self.sample().await?;
        if let (Some(before), Some(now)) = (&self.chip, &sample.chip)
            && before != now
        {
            return Err(ThermometerFault::OtherChip { before: before.clone(), now: now.clone() });
        }
        let admitted = self.plausibility.admit(sample.temperature_c, self.epoch.elapsed());
        if let Admission::Persistent { from_c, waited } =
            admitted.map_err(ThermometerFault::TooFast)?
        {
            self.remark = Some(format!(
                "{}: {:.1} C after {from_c:.1} C is accepted, because it has lasted for {:.0} s",
                self.file.display(),
                sample.temperature_c,
                waited.as_secs_f64(),
            ));
        }
        if sample.is_unusual && !std::mem::replace(&mut self.has_remarked_registers, true) {
            self.remark = Some(format!(
                "{}: the sensor's reserved registers are not those of a DS18B20: a copy, which may be \
                 off by some degrees",
                self.file.display()
            ));
        }
        self.chip = sample.chip.or(self.chip.take());
        Ok(sample.temperature_c)
    }

    /// Reads a sample on a separate thread. A driver may block forever; the thread neither occupies
    /// the runtime nor prevents the program from exiting.
    async fn sample(&mut self) -> Result<Sample, ThermometerFault> {
        let mut pending = match self.pending.take() {
            Some(pending) => pending,
            None => {
                let (send, receive) = oneshot::channel();
                let file = self.file.clone();
                let thread = std::thread::Builder::new().name("thermometer".into());
                #[allow(
                    clippy::disallowed_methods,
                    reason = "its end is received as the end of a channel"
                )]
                let started = thread.spawn(move || drop(send.send(read_sample(&file))));
                started.map_err(|error| {
                    ThermometerFault::Unreadable(format!("no thread for it: {error}"))
                })?;
                receive
            }
        };
        match timeout(READ_TIMEOUT, &mut pending).await {
            Ok(Ok(sample)) => sample,
            Ok(Err(_)) => Err(ThermometerFault::Unreadable("the reading thread has ended".into())),
            Err(_) => {
                self.pending = Some(pending);
                Err(ThermometerFault::TimedOut)
            }
        }
    }
}

fn read_sample(file: &Path) -> Result<Sample, ThermometerFault> {
    let chip = file::chip(file);
    if let Some(chip) = chip.as_deref().filter(|chip| file::is_internal(chip)) {
        return Err(ThermometerFault::NotAmbient(chip.to_owned()));
    }
    parse(&read_file(file)?).map(|sample| Sample { chip, ..sample })
}

/// Parses a number of thousandths of a degree, or the two lines of `w1_slave`: registers with their
/// checksum and a `YES`, and `t=` with the number.
fn parse(text: &str) -> Result<Sample, ThermometerFault> {
    if text.trim().is_empty() {
        return Err(ThermometerFault::Empty);
    }
    if !text.contains("crc=") && !text.contains("t=") {
        // The first register of a truncated `w1_slave` looks like a number.
        let number = text.trim();
        if !text.ends_with('\n') && number.len() <= 2 && number != "0" {
            return Err(ThermometerFault::CutOff("the end of the line"));
        }
        let thousandths = parse_thousandths(text)?;
        let temperature_c = check_air(thousandths)?;
        return Ok(Sample { temperature_c, chip: None, is_unusual: false });
    }
    let (head, number) =
        text.split_once("t=").ok_or(ThermometerFault::CutOff("the temperature"))?;
    if !head.contains("YES") {
        return Err(ThermometerFault::Checksum);
    }
    let scratchpad = Scratchpad::parse(head)?;
    let thousandths = parse_thousandths(number)?;
    scratchpad.check(thousandths)?;
    let temperature_c = check_air(thousandths)?;
    Ok(Sample { temperature_c, chip: None, is_unusual: scratchpad.is_unusual() })
}

fn parse_thousandths(text: &str) -> Result<i32, ThermometerFault> {
    let text = text.trim();
    text.parse().map_err(|_| match text {
        "" => ThermometerFault::CutOff("the temperature"),
        _ => ThermometerFault::NotANumber(text.chars().take(40).collect()),
    })
}

fn check_air(thousandths: i32) -> Result<f64, ThermometerFault> {
    if thousandths == scratchpad::POWER_ON_THOUSANDTHS {
        return Err(ThermometerFault::PowerOnValue);
    }
    let temperature_c = f64::from(thousandths) / 1e3;
    match Air::new(temperature_c, 50.0, 101.325) {
        Ok(_) => Ok(temperature_c),
        Err(error) => Err(ThermometerFault::OutOfAirRange(error.to_string())),
    }
}

#[cfg(test)]
mod tests;

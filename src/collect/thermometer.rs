//! The air's temperature, where there is a thermometer.

use std::{path::PathBuf, time::Duration};

use crate::thermometer::read_thermometer;

/// Tries for one reading: a 1-wire bus garbles one now and then.
const TRIES: u32 = 3;
const BETWEEN: Duration = Duration::from_secs(1);

/// A thermometer's file.
#[derive(Debug, Clone)]
pub(super) struct Thermometer {
    file: Option<PathBuf>,
}

impl Thermometer {
    pub(super) fn new(file: Option<&str>) -> Self {
        Self { file: file.map(PathBuf::from) }
    }

    /// The temperature now, degrees Celsius; `None` without a thermometer.
    ///
    /// # Errors
    /// When it can't be read, in words.
    pub(super) async fn read(&self) -> Result<Option<f64>, String> {
        let Some(file) = &self.file else { return Ok(None) };
        let mut tries = 0;
        loop {
            let path = file.clone();
            let read = tokio::task::spawn_blocking(move || read_thermometer(&path)).await;
            tries += 1;
            match read.unwrap_or_else(|error| Err(error.to_string())) {
                Ok(temperature_c) => return Ok(Some(temperature_c)),
                Err(error) if tries == TRIES => return Err(error),
                Err(_) => tokio::time::sleep(BETWEEN).await,
            }
        }
    }
}

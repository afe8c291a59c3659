//! The air as it is known now: from the configuration, a thermometer's file, or the API.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tokio::{sync::watch, time::Instant};

use crate::{
    acoustics::{Air, AirError},
    config::AirKeys,
    scan::{AirSource, ScanAir},
};

/// A change smaller than this is no reason to predict everything anew, degrees: it moves a range
/// by less than 0.02 percent.
const NOTABLE_C: f64 = 0.1;

/// What a program says about the air; what it leaves out stays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AirOrder {
    /// Temperature, degrees Celsius.
    #[schemars(range(min = -20, max = 50))]
    pub temperature_c: f64,
    /// Relative humidity, percent.
    #[serde(default)]
    #[schemars(range(min = 0, max = 100))]
    pub humidity_percent: Option<f64>,
    /// Static pressure, kilopascals.
    #[serde(default)]
    #[schemars(range(min = 60, max = 110))]
    pub pressure_kpa: Option<f64>,
}

/// The air in force, with its age.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct AirStatus {
    /// Temperature, degrees Celsius.
    pub temperature_c: f64,
    /// Relative humidity, percent.
    pub humidity_percent: f64,
    /// Static pressure, kilopascals.
    pub pressure_kpa: f64,
    /// Speed of sound, metres a second.
    pub sound_speed_m_s: f64,
    /// Who gave the temperature.
    pub source: AirSource,
    /// How old it is, seconds; `null` for a fixed one.
    pub age_s: Option<f64>,
    /// Older than the configuration allows.
    pub stale: bool,
    /// Why the thermometer can't be read, if so.
    pub error: Option<String>,
}

/// What is known about the air. The newest reading counts, whoever gave it.
#[derive(Debug, Clone)]
pub(super) struct AirDesk {
    keys: AirKeys,
    humidity_percent: f64,
    pressure_kpa: f64,
    temperature_c: f64,
    source: AirSource,
    at: Option<Instant>,
    error: Option<String>,
    /// The air that predictions were made for last.
    settled: Option<Air>,
}

/// A thermometer's reading, or why there is none.
pub(super) type Reading = Result<f64, String>;

impl AirDesk {
    /// The air of the configuration.
    #[must_use]
    pub(super) fn new(keys: AirKeys) -> Self {
        Self {
            humidity_percent: keys.humidity_percent,
            pressure_kpa: keys.pressure_kpa,
            temperature_c: keys.temperature_c,
            source: AirSource::Configuration,
            at: None,
            error: None,
            settled: None,
            keys,
        }
    }

    /// Takes a thermometer's reading in.
    pub(super) fn read(&mut self, reading: &Reading, now: Instant) {
        match reading {
            Ok(temperature_c) => {
                if self.error.is_some() {
                    tracing::info!("the thermometer can be read again");
                }
                self.temperature_c = *temperature_c;
                (self.source, self.at, self.error) = (AirSource::File, Some(now), None);
            }
            Err(error) => {
                if self.error.is_none() {
                    tracing::warn!("the thermometer can't be read: {error}");
                }
                self.error = Some(error.clone());
            }
        }
    }

    /// Takes a program's word.
    ///
    /// # Errors
    /// When a figure is out of range; nothing was changed then.
    pub(super) fn order(&mut self, order: &AirOrder, now: Instant) -> Result<(), AirError> {
        let humidity_percent = order.humidity_percent.unwrap_or(self.humidity_percent);
        let pressure_kpa = order.pressure_kpa.unwrap_or(self.pressure_kpa);
        Air::new(order.temperature_c, humidity_percent, pressure_kpa)?;
        (self.humidity_percent, self.pressure_kpa) = (humidity_percent, pressure_kpa);
        self.temperature_c = order.temperature_c;
        (self.source, self.at) = (AirSource::Api, Some(now));
        Ok(())
    }

    /// The air to compute with: the one before, unless it changed notably.
    pub(super) fn settled(&mut self) -> Air {
        let now = self.air();
        let before = *self.settled.get_or_insert(now);
        let notable = (before.temperature_c() - now.temperature_c()).abs() >= NOTABLE_C
            || before.humidity_percent() != now.humidity_percent()
            || before.pressure_kpa() != now.pressure_kpa();
        *self.settled.insert(if notable { now } else { before })
    }

    /// As it stands in a scan's record, for ranges computed with `air`.
    #[must_use]
    pub(super) fn scan_air(&self, air: &Air, now: Instant) -> ScanAir {
        ScanAir {
            temperature_c: air.temperature_c(),
            sound_speed_m_s: air.sound_speed_m_s(),
            source: self.source,
            age_s: self.age_s(now),
        }
    }

    /// For whoever asks.
    #[must_use]
    pub(super) fn status(&self, now: Instant) -> AirStatus {
        let age_s = self.age_s(now);
        AirStatus {
            temperature_c: self.temperature_c,
            humidity_percent: self.humidity_percent,
            pressure_kpa: self.pressure_kpa,
            sound_speed_m_s: self.air().sound_speed_m_s(),
            source: self.source,
            age_s,
            stale: match age_s {
                Some(age_s) => age_s > self.keys.max_age_s,
                None => self.keys.file.is_some(),
            },
            error: self.error.clone(),
        }
    }

    /// Whether another air is known here than there.
    #[must_use]
    pub(super) fn differs(&self, other: &Self) -> bool {
        (self.temperature_c, self.source) != (other.temperature_c, other.source)
            || self.humidity_percent != other.humidity_percent
            || self.pressure_kpa != other.pressure_kpa
    }

    fn air(&self) -> Air {
        // Every way in checks the figures.
        Air::new(self.temperature_c, self.humidity_percent, self.pressure_kpa).unwrap_or_default()
    }

    fn age_s(&self, now: Instant) -> Option<f64> {
        self.at.map(|at| now.saturating_duration_since(at).as_secs_f64())
    }
}

/// Reads a thermometer every so often; a 1-wire conversion takes most of a second, so it is read
/// beside everything else.
#[must_use]
pub(super) fn watch_thermometer(keys: &AirKeys) -> watch::Receiver<Option<Reading>> {
    let (sender, receiver) = watch::channel(None);
    let Some(file) = keys.file.clone().map(PathBuf::from) else { return receiver };
    let every = Duration::from_secs_f64(keys.every_s);
    tokio::spawn(async move {
        while !sender.is_closed() {
            let path = file.clone();
            let reading = tokio::task::spawn_blocking(move || read_thermometer(&path)).await;
            sender.send_replace(reading.ok());
            tokio::select! {
                () = tokio::time::sleep(every) => {}
                () = sender.closed() => {}
            }
        }
    });
    receiver
}

/// The temperature in a file of a 1-wire or hwmon driver, degrees Celsius. A 1-wire conversion takes
/// most of a second.
///
/// # Errors
/// When it can't be read or is no temperature, in words.
pub fn read_thermometer(path: &Path) -> Result<f64, String> {
    let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    parse_thermometer(&text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Either a number of thousandths of a degree, or the two lines of `w1_slave`: a checksum's
/// `YES`, and `t=` with the number.
fn parse_thermometer(text: &str) -> Result<f64, String> {
    let number = match text.split_once("t=") {
        Some((head, tail)) if head.contains("YES") => tail,
        Some(_) => return Err("the sensor's checksum was wrong".into()),
        None => text,
    };
    let thousandths: i32 = number
        .trim()
        .parse()
        .map_err(|_| format!("{:?} is no number of thousandths of a degree", number.trim()))?;
    let temperature_c = f64::from(thousandths) / 1e3;
    // A DS18B20 that never measured says 85 degrees.
    match Air::new(temperature_c, 50.0, 101.325) {
        Ok(_) => Ok(temperature_c),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_read_and_nonsense_is_not_taken_for_a_temperature() {
        let w1 = "72 01 4b 46 7f ff 0e 10 57 : crc=57 YES\n72 01 4b 46 7f ff 0e 10 57 t=23125\n";
        assert_eq!(parse_thermometer(w1), Ok(23.125));
        assert_eq!(parse_thermometer("-1500\n"), Ok(-1.5));
        for (text, part) in [
            (w1.replace("YES", "NO"), "checksum"),
            ("85000".into(), "-20 to 50"),
            (String::new(), "thousandths"),
            ("warm".into(), "thousandths"),
        ] {
            let error = parse_thermometer(&text).expect_err("it is refused");
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn the_newest_reading_counts_and_its_age_is_told() {
        let (mut desk, start) = (AirDesk::new(AirKeys::default()), Instant::now());
        assert_eq!(desk.status(start).age_s, None);
        desk.read(&Ok(25.0), start);
        let later = start + Duration::from_secs(700);
        desk.read(&Err("gone".into()), later);
        let status = desk.status(later);
        assert_eq!((status.temperature_c, status.source), (25.0, AirSource::File));
        assert_eq!(status.age_s, Some(700.0));
        assert!(status.stale && status.error.is_some(), "{status:?}");
        let order =
            AirOrder { temperature_c: 21.0, humidity_percent: Some(30.0), pressure_kpa: None };
        desk.order(&order, later).expect("in range");
        let status = desk.status(later);
        assert_eq!((status.source, status.age_s), (AirSource::Api, Some(0.0)));
        assert!(desk.order(&AirOrder { temperature_c: 70.0, ..order }, later).is_err());
        assert_eq!(desk.status(later).temperature_c, 21.0);
    }

    #[test]
    fn small_changes_do_not_make_everything_be_predicted_anew() {
        let mut desk = AirDesk::new(AirKeys::default());
        let now = Instant::now();
        desk.read(&Ok(20.0), now);
        let first = desk.settled();
        for temperature_c in [20.04, 20.09, 19.95] {
            desk.read(&Ok(temperature_c), now);
            assert_eq!(desk.settled(), first);
        }
        desk.read(&Ok(20.11), now);
        assert_eq!(desk.settled().temperature_c(), 20.11);
    }
}

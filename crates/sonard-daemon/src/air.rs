//! The air as it is known now: from the configuration, a thermometer's file, or the API.

use std::time::Duration;

use sonard_api::{AirOrder, AirStatus, config::AirKeys};
use sonard_device::thermometer::Thermometer;
use sonard_model::acoustics::Air;
use sonard_records::{AirSource, ScanAir};
use sonard_runtime::supervisor::{Supervisor, Task};
use tokio::{sync::watch, time::Instant};

use super::{limits::ordered_air, refusal::Refusal};

/// A change smaller than this is no reason to predict everything anew, degrees: it moves a range
/// by less than 0.02 percent.
const NOTABLE_C: f64 = 0.1;

/// What is known about the air. The newest reading counts, whoever gave it.
#[derive(Debug, Clone)]
pub(super) struct AirControl {
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

impl AirControl {
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
                    tracing::info!("the thermometer has a valid temperature again");
                }
                self.temperature_c = *temperature_c;
                (self.source, self.at, self.error) = (AirSource::File, Some(now), None);
            }
            Err(error) => {
                if self.error.is_none() {
                    tracing::warn!(
                        "the thermometer has no valid temperature: {error}; ranges are computed with \
                         {:.1} C",
                        self.temperature_c
                    );
                }
                self.error = Some(error.clone());
            }
        }
    }

    /// Takes a program's word.
    ///
    /// # Errors
    /// When a figure is out of range; nothing was changed then.
    pub(super) fn order(&mut self, order: &AirOrder, now: Instant) -> Result<(), Refusal> {
        let air = ordered_air(order, self.humidity_percent, self.pressure_kpa)?;
        (self.humidity_percent, self.pressure_kpa) = (air.humidity_percent(), air.pressure_kpa());
        self.temperature_c = air.temperature_c();
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
pub(super) fn watch_thermometer(
    keys: &AirKeys,
    supervisor: &Supervisor,
) -> watch::Receiver<Option<Reading>> {
    let (sender, receiver) = watch::channel(None);
    let Some(mut thermometer) = keys.file.as_ref().map(Thermometer::new) else { return receiver };
    let every = Duration::from_secs_f64(keys.every_s);
    let watching = async move {
        while !sender.is_closed() {
            let reading = tokio::select! {
                reading = thermometer.read() => reading.map_err(|error| error.to_string()),
                () = sender.closed() => return,
            };
            if let Some(remark) = thermometer.take_remark() {
                tracing::warn!("{remark}");
            }
            sender.send_replace(Some(reading));
            tokio::select! {
                () = tokio::time::sleep(every) => {}
                () = sender.closed() => {}
            }
        }
    };
    drop(supervisor.spawn_finite(Task::Thermometer, watching));
    receiver
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_reading_counts_and_its_age_is_told() {
        let (mut control, start) = (AirControl::new(AirKeys::default()), Instant::now());
        assert_eq!(control.status(start).age_s, None);
        control.read(&Ok(25.0), start);
        let later = start + Duration::from_secs(700);
        control.read(&Err("gone".into()), later);
        let status = control.status(later);
        assert_eq!((status.temperature_c, status.source), (25.0, AirSource::File));
        assert_eq!(status.age_s, Some(700.0));
        assert!(status.stale && status.error.is_some(), "{status:?}");
        let order =
            AirOrder { temperature_c: 21.0, humidity_percent: Some(30.0), pressure_kpa: None };
        control.order(&order, later).expect("in range");
        let status = control.status(later);
        assert_eq!((status.source, status.age_s), (AirSource::Api, Some(0.0)));
        assert!(control.order(&AirOrder { temperature_c: 70.0, ..order }, later).is_err());
        assert_eq!(control.status(later).temperature_c, 21.0);
    }

    #[test]
    fn small_changes_do_not_make_everything_be_predicted_anew() {
        let mut control = AirControl::new(AirKeys::default());
        let now = Instant::now();
        control.read(&Ok(20.0), now);
        let first = control.settled();
        for temperature_c in [20.04, 20.09, 19.95] {
            control.read(&Ok(temperature_c), now);
            assert_eq!(control.settled(), first);
        }
        control.read(&Ok(20.11), now);
        assert_eq!(control.settled().temperature_c(), 20.11);
    }
}

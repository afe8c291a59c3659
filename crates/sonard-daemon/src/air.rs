//! Current air: from the configuration, the thermometer's file, or the API.

use std::time::Duration;

use sonard_api::{AirOrder, AirStatus, config::AirKeys};
use sonard_device::thermometer::Thermometer;
use sonard_model::acoustics::Air;
use sonard_records::{AirSource, ScanAir};
use sonard_runtime::supervisor::{Supervisor, Task};
use tokio::{sync::watch, time::Instant};

use super::{limits::air_from_order, order_error::OrderError};

/// Minimum temperature change for new predictions, degrees Celsius. A smaller change shifts a range
/// by less than 0.02 percent.
const MIN_CHANGE_C: f64 = 0.1;

/// Current air and its source. The newest value is used, from whichever source.
#[derive(Debug, Clone)]
pub(super) struct AirControl {
    keys: AirKeys,
    humidity_percent: f64,
    pressure_kpa: f64,
    temperature_c: f64,
    source: AirSource,
    at: Option<Instant>,
    error: Option<String>,
    /// Air of the last predictions.
    settled: Option<Air>,
}

/// Temperature in degrees Celsius, or the reason why there is none.
pub(super) type Reading = Result<f64, String>;

impl AirControl {
    /// Starts with the air of the configuration.
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

    /// Updates the air with a reading of the thermometer.
    pub(super) fn update(&mut self, reading: &Reading, now: Instant) {
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

    /// Sets the air by an order.
    ///
    /// # Errors
    /// When a value is out of range; the air is then unchanged.
    pub(super) fn order(&mut self, order: &AirOrder, now: Instant) -> Result<(), OrderError> {
        let air = air_from_order(order, self.humidity_percent, self.pressure_kpa)?;
        (self.humidity_percent, self.pressure_kpa) = (air.humidity_percent(), air.pressure_kpa());
        self.temperature_c = air.temperature_c();
        (self.source, self.at) = (AirSource::Api, Some(now));
        Ok(())
    }

    /// Air for predictions and ranges: the last one, unless the current air differs by at least
    /// `MIN_CHANGE_C` or in humidity or pressure.
    pub(super) fn settled(&mut self) -> Air {
        let now = self.air();
        let before = *self.settled.get_or_insert(now);
        let is_changed = (before.temperature_c() - now.temperature_c()).abs() >= MIN_CHANGE_C
            || before.humidity_percent() != now.humidity_percent()
            || before.pressure_kpa() != now.pressure_kpa();
        *self.settled.insert(if is_changed { now } else { before })
    }

    /// Air in the record of a scan whose ranges are computed with `air`.
    #[must_use]
    pub(super) fn scan_air(&self, air: &Air, now: Instant) -> ScanAir {
        ScanAir {
            temperature_c: air.temperature_c(),
            sound_speed_m_s: air.sound_speed_m_s(),
            source: self.source,
            age_s: self.age_s(now),
        }
    }

    /// Status of the air for the API.
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

    /// Returns `true` if temperature, source, humidity or pressure differ.
    #[must_use]
    pub(super) fn differs(&self, other: &Self) -> bool {
        (self.temperature_c, self.source) != (other.temperature_c, other.source)
            || self.humidity_percent != other.humidity_percent
            || self.pressure_kpa != other.pressure_kpa
    }

    fn air(&self) -> Air {
        // The values were validated when they were set.
        Air::new(self.temperature_c, self.humidity_percent, self.pressure_kpa).unwrap_or_default()
    }

    fn age_s(&self, now: Instant) -> Option<f64> {
        self.at.map(|at| now.saturating_duration_since(at).as_secs_f64())
    }
}

/// Starts a task that reads the thermometer periodically, if one is configured. A 1-wire conversion
/// takes most of a second, so it must not delay the device task.
#[must_use]
pub(super) fn watch_thermometer(
    keys: &AirKeys,
    supervisor: &Supervisor,
) -> watch::Receiver<Option<Reading>> {
    let (sender, receiver) = watch::channel(None);
    let Some(mut thermometer) = keys.file.as_ref().map(Thermometer::new) else { return receiver };
    let every = Duration::from_secs_f64(keys.every_s);
    let read_periodically = async move {
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
    drop(supervisor.spawn_finite(Task::Thermometer, read_periodically));
    receiver
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn newest_value_is_used_with_its_age() {
        let (mut control, start) = (AirControl::new(AirKeys::default()), Instant::now());
        assert_eq!(control.status(start).age_s, None);
        control.update(&Ok(25.0), start);
        let later = start + Duration::from_secs(700);
        control.update(&Err("gone".into()), later);
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
    fn small_changes_keep_predictions() {
        let mut control = AirControl::new(AirKeys::default());
        let now = Instant::now();
        control.update(&Ok(20.0), now);
        let first = control.settled();
        for temperature_c in [20.04, 20.09, 19.95] {
            control.update(&Ok(temperature_c), now);
            assert_eq!(control.settled(), first);
        }
        control.update(&Ok(20.11), now);
        assert_eq!(control.settled().temperature_c(), 20.11);
    }
}

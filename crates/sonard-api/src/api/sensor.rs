//! Sensor settings used for predictions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::acoustics::{Gain, Sensor, SensorError};

/// Request body of `PUT /v1/sensor`. An omitted field has the preset's value, or without a preset
/// that of the next scan.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorOrder {
    /// Name of a sensor preset; `GET /v1/sensors` lists them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("enum" = preset_choices()))]
    pub preset: Option<String>,
    /// Detection threshold, relative to the amplitude of a head-on, perfect wall (1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.000_001, max = 1))]
    pub threshold: Option<f64>,
    /// Slope of the threshold over range, decibels per metre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 100))]
    pub threshold_rise_db_per_m: Option<f64>,
    /// Receiver blanking after firing, microseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 100_000))]
    pub blanking_us: Option<f64>,
    /// Time for which an echo must exceed the threshold, microseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 10_000))]
    pub integration_us: Option<f64>,
    /// Quantization step of reported ranges, metres; 0 for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 1))]
    pub range_step_m: Option<f64>,
    /// Time-varying gain, which compensates spreading loss.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<Gain>,
}

/// Name of a sensor, with the settings that the API can change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SensorFigures {
    /// Name of the preset, or of the sensor in the configured file.
    pub name: String,
    /// Detection threshold (relative amplitude); `model.threshold` of the configuration takes
    /// precedence.
    pub threshold: f64,
    /// Slope of the threshold over range, decibels per metre.
    pub threshold_rise_db_per_m: f64,
    /// Receiver blanking after firing, microseconds.
    pub blanking_us: f64,
    /// Time for which an echo must exceed the threshold, microseconds.
    pub integration_us: f64,
    /// Quantization step of reported ranges, metres; 0 for none.
    pub range_step_m: f64,
    /// Time-varying gain, which compensates spreading loss.
    pub gain: Gain,
}

impl SensorFigures {
    /// Extracts the settings of a sensor.
    #[must_use]
    pub fn from_sensor(sensor: &Sensor) -> Self {
        Self {
            name: sensor.name.clone(),
            threshold: sensor.threshold,
            threshold_rise_db_per_m: sensor.threshold_rise_db_per_m,
            blanking_us: sensor.blanking_us,
            integration_us: sensor.integration_us,
            range_step_m: sensor.range_step_m,
            gain: sensor.gain.clone(),
        }
    }
}

/// Allowed values of `preset`; null is equivalent to an omitted field.
fn preset_choices() -> Vec<Option<&'static str>> {
    Sensor::preset_names().map(Some).chain([None]).collect()
}

impl SensorOrder {
    /// Returns `sensor` with this change applied.
    ///
    /// # Errors
    /// Unknown preset, or a value out of range.
    pub fn apply_to(&self, sensor: &Sensor) -> Result<Sensor, SensorError> {
        self.check()?;
        let mut changed = match &self.preset {
            Some(name) => Sensor::preset(name)?,
            None => sensor.clone(),
        };
        for (value, requested) in [
            (&mut changed.threshold, self.threshold),
            (&mut changed.threshold_rise_db_per_m, self.threshold_rise_db_per_m),
            (&mut changed.blanking_us, self.blanking_us),
            (&mut changed.integration_us, self.integration_us),
            (&mut changed.range_step_m, self.range_step_m),
        ] {
            *value = requested.unwrap_or(*value);
        }
        if let Some(gain) = &self.gain {
            changed.gain.clone_from(gain);
        }
        changed.check()?;
        Ok(changed)
    }

    /// Checks limits narrower than those of data files, so that a client's settings cost no more
    /// time than configured ones.
    fn check(&self) -> Result<(), SensorError> {
        let within = |field, value: Option<f64>, from: f64, to: f64, expected| match value {
            Some(value) if !(from..=to).contains(&value) => {
                Err(SensorError::OutOfRange { field, value, expected })
            }
            _ => Ok(()),
        };
        within("threshold", self.threshold, 1e-6, 1.0, "from 0.000001 to 1")?;
        within("blanking_us", self.blanking_us, 0.0, 1e5, "from 0 to 100000")?;
        within("integration_us", self.integration_us, 0.0, 1e4, "from 0 to 10000")?;
        match &self.gain {
            None => Ok(()),
            Some(Gain::Compensating { exponent, .. }) => {
                within("gain.exponent", Some(*exponent), 0.0, 2.0, "from 0 to 2")
            }
            Some(Gain::Steps { steps }) => {
                let count = Some(steps.len() as f64);
                within("gain.steps (count)", count, 1.0, 64.0, "from 1 to 64")?;
                steps.iter().try_for_each(|step| {
                    let gain_db = Some(step.gain_db);
                    within("gain.steps.gain_db", gain_db, -200.0, 200.0, "from -200 to 200")
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(text: &str) -> SensorOrder {
        serde_json::from_str(text).expect("an order")
    }

    #[test]
    fn omitted_fields_keep_their_values() {
        let mut before = Sensor::preset("senscomp-6500").expect("a preset");
        before.integration_us = 17.0;
        let changed = order(r#"{"threshold": 0.05}"#).apply_to(&before).expect("valid");
        assert_eq!((changed.threshold, changed.integration_us), (0.05, 17.0));
        let other = order(r#"{"preset": "hc-sr04", "blanking_us": 400}"#);
        let other = other.apply_to(&before).expect("valid");
        let preset = Sensor::preset("hc-sr04").expect("a preset");
        assert_eq!(other, Sensor { blanking_us: 400.0, ..preset });
        let gain = order(r#"{"gain": {"kind": "compensating"}}"#);
        assert_eq!(gain.apply_to(&before).map(|sensor| sensor.gain), Ok(Gain::default()));
    }

    #[test]
    fn out_of_range_values_are_named() {
        let before = Sensor::preset("senscomp-6500").expect("a preset");
        for (text, part) in [
            (r#"{"preset": "ear"}"#, "no sensor preset \"ear\""),
            (r#"{"threshold": 0}"#, "threshold is 0"),
            (r#"{"threshold": 1.5}"#, "threshold is 1.5"),
            (r#"{"blanking_us": -1}"#, "blanking_us is -1"),
            (r#"{"blanking_us": 1e9}"#, "blanking_us is 1000000000"),
            (r#"{"integration_us": 1e5}"#, "integration_us is 100000"),
            (r#"{"range_step_m": 2}"#, "range_step_m is 2"),
            (r#"{"threshold_rise_db_per_m": 101}"#, "threshold_rise_db_per_m is 101"),
            (r#"{"gain": {"kind": "compensating", "exponent": 1e300}}"#, "gain.exponent"),
            (
                r#"{"gain": {"kind": "steps", "steps": [{"until_us": null, "gain_db": 1e9}]}}"#,
                "gain_db",
            ),
            (r#"{"gain": {"kind": "steps", "steps": []}}"#, "count"),
        ] {
            let error = order(text).apply_to(&before).expect_err(text).to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}

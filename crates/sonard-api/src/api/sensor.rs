//! The sensor that ranges are predicted for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::acoustics::{Gain, Sensor, SensorError};

/// A change of the sensor; an omitted field is as in the preset, or without one as in the next scan.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorOrder {
    /// Name of a sensor that comes with the program: GET /v1/sensors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("enum" = preset_choices()))]
    pub preset: Option<String>,
    /// Least amplitude detected; a head-on, perfect wall gives 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.000_001, max = 1))]
    pub threshold: Option<f64>,
    /// What the threshold gains with each metre of range, decibels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 100))]
    pub threshold_rise_db_per_m: Option<f64>,
    /// From firing until the receiver listens, microseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 100_000))]
    pub blanking_us: Option<f64>,
    /// How long an echo has to stay above the threshold, microseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 10_000))]
    pub integration_us: Option<f64>,
    /// Whole steps in which ranges are told, metres; 0 for ranges as they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 1))]
    pub range_step_m: Option<f64>,
    /// How the amplifier follows the spreading of the sound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<Gain>,
}

/// Those figures of a sensor that a program may change, and its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SensorFigures {
    /// The preset's name, or that of the configured file's sensor.
    pub name: String,
    /// Least amplitude detected; `model.threshold` of the configuration goes before it.
    pub threshold: f64,
    /// What the threshold gains with each metre of range, decibels.
    pub threshold_rise_db_per_m: f64,
    /// From firing until the receiver listens, microseconds.
    pub blanking_us: f64,
    /// How long an echo has to stay above the threshold, microseconds.
    pub integration_us: f64,
    /// Whole steps in which ranges are told, metres; 0 for ranges as they are.
    pub range_step_m: f64,
    /// How the amplifier follows the spreading of the sound.
    pub gain: Gain,
}

impl SensorFigures {
    /// Those of a sensor.
    #[must_use]
    pub fn of(sensor: &Sensor) -> Self {
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

/// What `preset` may be: null is as if it were left out.
fn preset_choices() -> Vec<Option<&'static str>> {
    Sensor::preset_names().map(Some).chain([None]).collect()
}

impl SensorOrder {
    /// The sensor that it makes of one.
    ///
    /// # Errors
    /// When there is no such preset, or a figure is out of range.
    pub fn applied_to(&self, before: &Sensor) -> Result<Sensor, SensorError> {
        self.check()?;
        let mut sensor = match &self.preset {
            Some(name) => Sensor::preset(name)?,
            None => before.clone(),
        };
        for (figure, wanted) in [
            (&mut sensor.threshold, self.threshold),
            (&mut sensor.threshold_rise_db_per_m, self.threshold_rise_db_per_m),
            (&mut sensor.blanking_us, self.blanking_us),
            (&mut sensor.integration_us, self.integration_us),
            (&mut sensor.range_step_m, self.range_step_m),
        ] {
            *figure = wanted.unwrap_or(*figure);
        }
        if let Some(gain) = &self.gain {
            sensor.gain.clone_from(gain);
        }
        sensor.check()?;
        Ok(sensor)
    }

    /// Narrower than a data file: what a client asks for is to cost no more than what is configured.
    fn check(&self) -> Result<(), SensorError> {
        let within = |field, value: Option<f64>, from: f64, to: f64, expected| match value {
            Some(value) if !(from..=to).contains(&value) => {
                Err(SensorError::Figure { field, value, expected })
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
                within("gain.steps (how many)", count, 1.0, 64.0, "from 1 to 64")?;
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
    fn what_is_left_out_is_as_in_the_preset_or_as_it_was() {
        let mut before = Sensor::preset("senscomp-6500").expect("a preset");
        before.integration_us = 17.0;
        let changed = order(r#"{"threshold": 0.05}"#).applied_to(&before).expect("it is right");
        assert_eq!((changed.threshold, changed.integration_us), (0.05, 17.0));
        let other = order(r#"{"preset": "hc-sr04", "blanking_us": 400}"#);
        let other = other.applied_to(&before).expect("it is right");
        let preset = Sensor::preset("hc-sr04").expect("a preset");
        assert_eq!(other, Sensor { blanking_us: 400.0, ..preset });
        let gain = order(r#"{"gain": {"kind": "compensating"}}"#);
        assert_eq!(gain.applied_to(&before).map(|sensor| sensor.gain), Ok(Gain::default()));
    }

    #[test]
    fn figures_out_of_range_are_named() {
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
            (r#"{"gain": {"kind": "steps", "steps": []}}"#, "how many"),
        ] {
            let error = order(text).applied_to(&before).expect_err(text).to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}

//! What is known about a ranger: one data file a preset, with a source for each figure.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Face;
use crate::geometry::DVec2;

/// The data files that come with the program, by name.
const PRESETS: [(&str, &str); 3] = [
    ("senscomp-6500", include_str!("../../sensors/senscomp-6500.json")),
    ("bozma-kuc-60khz", include_str!("../../sensors/bozma-kuc-60khz.json")),
    ("hc-sr04", include_str!("../../sensors/hc-sr04.json")),
];

/// A ranger's data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// The preset's name.
    pub name: String,
    /// What it is, in a sentence.
    pub description: String,
    /// Carrier frequency, hertz.
    pub frequency_hz: f64,
    /// Shape of the radiating face, and with it the beam pattern.
    pub aperture: Aperture,
    /// Face and housing as a reflector; without it sound passes the ranger as if it were not
    /// there.
    #[serde(default)]
    pub face: Option<Face>,
    /// Where it sits on the rotation axis.
    #[serde(default)]
    pub mounting: Mounting,
    /// What it sends.
    pub pulse: Pulse,
    /// From firing until the receiver listens, microseconds.
    pub blanking_us: f64,
    /// The same when the blanking is shortened by hand, microseconds.
    #[serde(default)]
    pub short_blanking_us: Option<f64>,
    /// After an echo, how long the detector is held before it can report another, microseconds.
    #[serde(default = "default_rearm_us")]
    pub rearm_us: f64,
    /// Farthest range it is made for, metres.
    pub max_range_m: f64,
    /// Least amplitude that is detected, relative to a head-on, perfectly reflecting wall with
    /// gain compensation.
    pub threshold: f64,
    /// For each figure above, by field name, where it comes from.
    pub sources: BTreeMap<String, String>,
}

/// Shape of the radiating face.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Aperture {
    /// Circular piston in a baffle.
    Piston {
        /// Radius, metres.
        radius_m: f64,
    },
    /// Line aperture in the plane of the scan.
    Line {
        /// Half length, metres.
        half_length_m: f64,
    },
    /// Amplitude `exp(-2 theta^2 / theta_o^2)` one way (Bozma and Kuc, equation 3).
    Gaussian {
        /// Half beam angle `theta_o`, degrees.
        half_angle_deg: f64,
        /// Radius of the face, metres; the beam does not follow from it.
        radius_m: f64,
    },
}

/// Where the transducer sits on the rotation axis, and turns with it.
///
/// Ranges are measured from the face, or from the middle between transmitter and receiver: half
/// the way of the sound. What is met ahead lies `ahead_m` farther from the axis.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mounting {
    /// The middle of the face in front of the axis, metres.
    pub ahead_m: f64,
    /// The same to the left of it, metres.
    pub left_m: f64,
    /// Transmitter and receiver side by side, their middles this far apart, metres: the
    /// transmitter on the left. 0 for a transducer that does both.
    pub separation_m: f64,
    /// Height of its middle in a scene with heights, metres.
    pub z_m: Option<f64>,
    /// How far its axis points up, degrees.
    pub tilt_deg: f64,
}

impl Mounting {
    /// Transmitter and receiver with the axis at `axis`, looking into `direction_rad`.
    #[must_use]
    pub fn places(&self, axis: DVec2, direction_rad: f64) -> [DVec2; 2] {
        let turn = DVec2::from_angle(direction_rad);
        [0.5, -0.5].map(|side| {
            let left_m = self.left_m + side * self.separation_m;
            axis + turn.rotate(DVec2::new(self.ahead_m, left_m))
        })
    }

    /// Whether it is one transducer on the axis itself, so that turning does not move it.
    #[must_use]
    pub fn is_on_axis(&self) -> bool {
        self.ahead_m == 0.0 && self.left_m == 0.0 && self.separation_m == 0.0
    }
}

/// What the ranger sends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Pulse {
    /// So many cycles of the carrier at full strength, as transducer and receiver pass them.
    Burst {
        /// Number of cycles.
        cycles: f64,
        /// Standard deviation of the Gaussian band filter that transducer and receiver are
        /// together, hertz.
        bandwidth_hz: f64,
    },
    /// A sine under a Gaussian envelope.
    Gaussian {
        /// Standard deviation of the envelope, microseconds.
        sigma_us: f64,
    },
}

/// Why a sensor's data can't be used.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SensorError {
    /// Not JSON, or not of a sensor's form.
    #[error("line {line}, column {column}: {field}: {message}")]
    Form {
        /// Line in the text, from 1.
        line: usize,
        /// Column in the line, from 1.
        column: usize,
        /// Which field, as far as it was understood.
        field: String,
        /// What is wrong.
        message: String,
    },
    /// A figure out of range.
    #[error("{field} is {value}: it must be {expected}")]
    Figure {
        /// Which field.
        field: &'static str,
        /// What it holds.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// No preset of that name.
    #[error("there is no sensor preset \"{name}\"; there are: {known}")]
    UnknownPreset {
        /// What was asked for.
        name: String,
        /// Every preset's name.
        known: String,
    },
}

impl Sensor {
    /// The names of the presets, the default one first.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        PRESETS.iter().map(|(name, _)| *name)
    }

    /// A sensor that comes with the program.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn preset(name: &str) -> Result<Self, SensorError> {
        match PRESETS.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => Self::from_json(text),
            None => Err(SensorError::UnknownPreset {
                name: name.to_owned(),
                known: Self::preset_names().collect::<Vec<_>>().join(", "),
            }),
        }
    }

    /// A sensor from the text of a data file.
    ///
    /// # Errors
    /// When the text is not a sensor's, or a figure is out of range.
    pub fn from_json(text: &str) -> Result<Self, SensorError> {
        let mut json = serde_json::Deserializer::from_str(text);
        let sensor: Self = serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let field = error.path().to_string();
            form_error(field, error.inner())
        })?;
        json.end().map_err(|error| form_error("end of file".to_owned(), &error))?;
        sensor.check()?;
        Ok(sensor)
    }

    /// Checks that every figure makes sense.
    ///
    /// # Errors
    /// Names the first that does not.
    pub fn check(&self) -> Result<(), SensorError> {
        positive("frequency_hz", self.frequency_hz)?;
        match self.aperture {
            Aperture::Piston { radius_m } => positive("aperture.radius_m", radius_m)?,
            Aperture::Line { half_length_m } => {
                positive("aperture.half_length_m", half_length_m)?;
            }
            Aperture::Gaussian { half_angle_deg, radius_m } => {
                positive("aperture.half_angle_deg", half_angle_deg)?;
                positive("aperture.radius_m", radius_m)?;
            }
        }
        if let Some(Face { radius_m, reflectance }) = self.face {
            positive("face.radius_m", radius_m)?;
            at_most_1("face.reflectance", reflectance)?;
        }
        match self.pulse {
            Pulse::Burst { cycles, bandwidth_hz } => {
                positive("pulse.cycles", cycles)?;
                positive("pulse.bandwidth_hz", bandwidth_hz)?;
            }
            Pulse::Gaussian { sigma_us } => positive("pulse.sigma_us", sigma_us)?,
        }
        let Mounting { ahead_m, left_m, separation_m, z_m, tilt_deg } = self.mounting;
        within("mounting.ahead_m", ahead_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.left_m", left_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.separation_m", separation_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.z_m", z_m.unwrap_or(0.0), 1000.0, "from -1000 to 1000 metres")?;
        within("mounting.tilt_deg", tilt_deg, 90.0, "from -90 to 90 degrees")?;
        not_negative("blanking_us", self.blanking_us)?;
        not_negative("short_blanking_us", self.short_blanking_us.unwrap_or(0.0))?;
        not_negative("rearm_us", self.rearm_us)?;
        positive("max_range_m", self.max_range_m)?;
        positive("threshold", self.threshold)
    }

    /// How long the pulse lasts, seconds (a Gaussian one: three sigma to each side).
    #[must_use]
    pub fn pulse_s(&self) -> f64 {
        match self.pulse {
            Pulse::Burst { cycles, .. } => cycles / self.frequency_hz,
            Pulse::Gaussian { sigma_us } => 6.0 * sigma_us * 1e-6,
        }
    }

    /// Half the width of the face in the plane of the scan, metres.
    #[must_use]
    pub const fn half_width_m(&self) -> f64 {
        match self.aperture {
            Aperture::Piston { radius_m } | Aperture::Gaussian { radius_m, .. } => radius_m,
            Aperture::Line { half_length_m } => half_length_m,
        }
    }
}

const fn default_rearm_us() -> f64 {
    440.0
}

fn form_error(field: String, error: &serde_json::Error) -> SensorError {
    let message = error.to_string();
    // serde_json appends the place, which is reported apart.
    let message = message.split(" at line ").next().unwrap_or_default().to_owned();
    SensorError::Form { line: error.line(), column: error.column(), field, message }
}

fn positive(field: &'static str, value: f64) -> Result<(), SensorError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(SensorError::Figure { field, value, expected: "a finite number greater than 0" })
    }
}

fn not_negative(field: &'static str, value: f64) -> Result<(), SensorError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(SensorError::Figure { field, value, expected: "a finite number, 0 or more" })
    }
}

fn within(
    field: &'static str,
    value: f64,
    most: f64,
    expected: &'static str,
) -> Result<(), SensorError> {
    if value.abs() <= most { Ok(()) } else { Err(SensorError::Figure { field, value, expected }) }
}

fn at_most_1(field: &'static str, value: f64) -> Result<(), SensorError> {
    if (0.0..=1.0).contains(&value) {
        Ok(())
    } else {
        Err(SensorError::Figure { field, value, expected: "from 0 to 1" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_of_every_preset_has_a_source() {
        for (name, text) in PRESETS {
            let sensor = Sensor::preset(name).expect(name);
            assert_eq!(sensor.name, name);
            let fields: serde_json::Map<String, serde_json::Value> =
                serde_json::from_str(text).expect("an object");
            let figures = fields
                .keys()
                .filter(|key| !["name", "description", "sources"].contains(&key.as_str()));
            for figure in figures {
                let source = sensor.sources.get(figure);
                assert!(source.is_some_and(|text| text.len() > 20), "{name}: {figure}");
            }
            for key in sensor.sources.keys() {
                assert!(fields.contains_key(key), "{name}: a source for nothing: {key}");
            }
        }
    }

    #[test]
    fn wrong_data_are_named() {
        let text = PRESETS[0].1;
        for (wrong, part) in [
            (text.replace("49400.0", "-1"), "frequency_hz is -1"),
            (text.replace("0.0193", "0"), "aperture.radius_m"),
            (text.replace("\"blanking_us\": 2380.0", "\"blanking\": 2380.0"), "blanking"),
            (text.replace("10.7,", "\"far\","), "max_range_m"),
            (text.replace("\"piston\"", "\"horn\""), "aperture"),
            (text.trim_end().trim_end_matches('}').to_owned(), "line 2"),
            (format!("{text} x"), "end of file"),
        ] {
            let error = Sensor::from_json(&wrong).expect_err(part).to_string();
            assert!(error.contains(part), "{error} lacks {part}");
        }
        let error = Sensor::preset("sonar").expect_err("unknown").to_string();
        assert!(error.contains("senscomp-6500"), "{error}");
    }

    #[test]
    fn threshold_is_what_a_wall_at_the_rated_range_gives() {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let loss_db = 2.0
            * sensor.max_range_m
            * crate::acoustics::Air::default().absorption_db_per_m(sensor.frequency_hz);
        let amplitude = 10f64.powf(-loss_db / 20.0);
        assert!((amplitude / sensor.threshold - 1.0).abs() < 0.01, "{amplitude}");
    }
}

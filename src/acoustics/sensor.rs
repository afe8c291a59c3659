//! What is known about a ranger: one data file a preset, with a source for each figure.

use std::{
    collections::BTreeMap,
    f64::consts::{FRAC_PI_2, PI},
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Face;
use crate::geometry::{DVec2, wrap_pi};

/// The data files that come with the program, by name.
const PRESETS: [(&str, &str); 6] = [
    ("senscomp-6500", include_str!("../../sensors/senscomp-6500.json")),
    ("polaroid-chirp", include_str!("../../sensors/polaroid-chirp.json")),
    ("bozma-kuc-60khz", include_str!("../../sensors/bozma-kuc-60khz.json")),
    ("pioneer", include_str!("../../sensors/pioneer.json")),
    ("fullwave-line", include_str!("../../sensors/fullwave-line.json")),
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
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
    /// How long an echo has to stay above the threshold to be taken for one, microseconds; time
    /// below it counts back. 0 for a plain threshold.
    #[serde(default, skip_serializing_if = "is_default")]
    pub integration_us: f64,
    /// Farthest range it is made for, metres.
    pub max_range_m: f64,
    /// How the amplifier follows the spreading of the sound.
    #[serde(default, skip_serializing_if = "is_default")]
    pub gain: Gain,
    /// How the face answers to a pulse.
    #[serde(default, skip_serializing_if = "is_default")]
    pub response: Response,
    /// What edges send back in the experiments that the figures come from; without it, `utd`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge_law: Option<EdgeLawKind>,
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
        /// Full strength up to this angle from the axis, degrees.
        #[serde(default = "right_angle_deg")]
        full_within_deg: f64,
        /// Nothing beyond this angle, with a cosine's slope between the two, degrees.
        #[serde(default = "right_angle_deg")]
        none_beyond_deg: f64,
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

impl Aperture {
    /// Share of the face that is seen at an angle from its axis, radians: `cos` for a disc (Kuc and
    /// Siegel), the line's own window; 0 behind.
    #[must_use]
    pub fn obliquity(&self, theta_rad: f64) -> f64 {
        let theta_rad = wrap_pi(theta_rad).abs();
        match *self {
            Self::Piston { .. } => theta_rad.cos().max(0.0),
            Self::Line { full_within_deg, none_beyond_deg, .. } => {
                let theta_deg = theta_rad.to_degrees();
                if theta_deg <= full_within_deg {
                    1.0
                } else if theta_deg >= none_beyond_deg {
                    0.0
                } else {
                    let part = (theta_deg - full_within_deg) / (none_beyond_deg - full_within_deg);
                    0.5 * (1.0 + (PI * part).cos())
                }
            }
            Self::Gaussian { .. } => f64::from(u8::from(theta_rad < FRAC_PI_2)),
        }
    }
}

/// What the ranger sends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// Bursts of several frequencies, one after the other.
    Chirp {
        /// The bursts in order.
        parts: Vec<ChirpPart>,
        /// As for a burst; centred on the sensor's `frequency_hz`.
        bandwidth_hz: f64,
    },
}

/// One frequency of a chirp.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChirpPart {
    /// Number of cycles.
    pub cycles: f64,
    /// Frequency, hertz.
    pub frequency_hz: f64,
}

/// How the amplifier follows the spreading of the sound.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Gain {
    /// Makes up for it: the threshold is the same for all ranges.
    Compensating {
        /// Power of the time with which the gain still rises while an echo sounds: 0 if each echo
        /// is made up for by the length of its way, 0.5 in a plane, 1 in space.
        #[serde(default)]
        exponent: f64,
        /// Whether it makes up for what the air absorbs as well.
        #[serde(default)]
        air: bool,
    },
    /// Rises in steps; between them the threshold in force drifts up with the range.
    Steps {
        /// The steps in order; the last one's `until_us` is `null`.
        steps: Vec<GainStep>,
    },
}

/// What edges send back; see [`EdgeLaw`](super::edge::EdgeLaw).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeLawKind {
    /// By the wedge's angle and the aspect.
    Utd,
    /// One ratio to a plane at the same range.
    KucSiegel,
    /// One scattering strength, level with planes at the face.
    BozmaKuc,
}

/// A step of the gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GainStep {
    /// When it ends, microseconds after firing; `null` for the last.
    pub until_us: Option<f64>,
    /// Gain, decibels above what makes up for the spreading from a wall at 1 m.
    pub gain_db: f64,
}

/// How the face answers to a pulse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Response {
    /// By its beam pattern: every echo has the shape of one on the axis, only weaker.
    #[default]
    Stationary,
    /// Point by point: echoes off the axis are longer and begin earlier, and nulls fill up (see
    /// [`ApertureResponse`](super::ApertureResponse)).
    Full,
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
            Aperture::Line { half_length_m, full_within_deg, none_beyond_deg } => {
                positive("aperture.half_length_m", half_length_m)?;
                within_half_turn("aperture.full_within_deg", full_within_deg, 0.0)?;
                within_half_turn("aperture.none_beyond_deg", none_beyond_deg, full_within_deg)?;
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
        self.pulse.check()?;
        let Mounting { ahead_m, left_m, separation_m, z_m, tilt_deg } = self.mounting;
        within("mounting.ahead_m", ahead_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.left_m", left_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.separation_m", separation_m, 1.0, "from -1 to 1 metre")?;
        within("mounting.z_m", z_m.unwrap_or(0.0), 1000.0, "from -1000 to 1000 metres")?;
        within("mounting.tilt_deg", tilt_deg, 90.0, "from -90 to 90 degrees")?;
        not_negative("blanking_us", self.blanking_us)?;
        not_negative("short_blanking_us", self.short_blanking_us.unwrap_or(0.0))?;
        not_negative("rearm_us", self.rearm_us)?;
        not_negative("integration_us", self.integration_us)?;
        self.gain.check()?;
        positive("max_range_m", self.max_range_m)?;
        positive("threshold", self.threshold)
    }

    /// How long the pulse lasts, seconds (a Gaussian one: three sigma to each side).
    #[must_use]
    pub fn pulse_s(&self) -> f64 {
        match &self.pulse {
            Pulse::Burst { cycles, .. } => cycles / self.frequency_hz,
            Pulse::Gaussian { sigma_us } => 6.0 * sigma_us * 1e-6,
            Pulse::Chirp { parts, .. } => {
                parts.iter().map(|part| part.cycles / part.frequency_hz).sum()
            }
        }
    }

    /// Half the width of the face in the plane of the scan, metres.
    #[must_use]
    pub const fn half_width_m(&self) -> f64 {
        match self.aperture {
            Aperture::Piston { radius_m } | Aperture::Gaussian { radius_m, .. } => radius_m,
            Aperture::Line { half_length_m, .. } => half_length_m,
        }
    }
}

impl Pulse {
    fn check(&self) -> Result<(), SensorError> {
        match self {
            Self::Burst { cycles, bandwidth_hz } => {
                positive("pulse.cycles", *cycles)?;
                positive("pulse.bandwidth_hz", *bandwidth_hz)
            }
            Self::Gaussian { sigma_us } => positive("pulse.sigma_us", *sigma_us),
            Self::Chirp { parts, bandwidth_hz } => {
                positive("pulse.parts (how many)", parts.len() as f64)?;
                for part in parts {
                    positive("pulse.parts.cycles", part.cycles)?;
                    positive("pulse.parts.frequency_hz", part.frequency_hz)?;
                }
                positive("pulse.bandwidth_hz", *bandwidth_hz)
            }
        }
    }
}

impl Default for Gain {
    fn default() -> Self {
        Self::Compensating { exponent: 0.0, air: false }
    }
}

impl Gain {
    /// Whether the absorption of the air is made up for.
    #[must_use]
    pub const fn makes_up_for_air(&self) -> bool {
        matches!(self, Self::Compensating { air: true, .. })
    }

    fn check(&self) -> Result<(), SensorError> {
        let steps = match self {
            Self::Compensating { exponent, .. } => return not_negative("gain.exponent", *exponent),
            Self::Steps { steps } => steps,
        };
        positive("gain.steps (how many)", steps.len() as f64)?;
        let mut last_us = 0.0;
        for (i, step) in steps.iter().enumerate() {
            let is_last = i + 1 == steps.len();
            let field = "gain.steps.until_us";
            match step.until_us {
                None if is_last => {}
                Some(until_us) if !is_last && until_us.is_finite() && until_us > last_us => {
                    last_us = until_us;
                }
                other => {
                    let value = other.unwrap_or(f64::NAN);
                    let expected = "later than the step before, and null for the last step only";
                    return Err(SensorError::Figure { field, value, expected });
                }
            }
            if !step.gain_db.is_finite() {
                let (field, value) = ("gain.steps.gain_db", step.gain_db);
                return Err(SensorError::Figure { field, value, expected: "a finite number" });
            }
        }
        Ok(())
    }
}

const fn default_rearm_us() -> f64 {
    440.0
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

const fn right_angle_deg() -> f64 {
    90.0
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

fn within_half_turn(field: &'static str, value: f64, from: f64) -> Result<(), SensorError> {
    if (from..=180.0).contains(&value) {
        Ok(())
    } else {
        let expected = "up to 180 degrees, and none_beyond_deg at least full_within_deg";
        Err(SensorError::Figure { field, value, expected })
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
            (
                text.replace("\"until_us\": 5120.0", "\"until_us\": 120.0"),
                "gain.steps.until_us is 120",
            ),
            (text.replace("\"until_us\": 5120.0", "\"until_us\": null"), "gain.steps.until_us"),
            (text.trim_end().trim_end_matches('}').to_owned(), "EOF"),
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

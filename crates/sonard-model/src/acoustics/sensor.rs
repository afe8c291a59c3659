//! What is known about a ranger: one data file a preset, with a source for each figure.

mod aperture;
mod detector;
mod figures;
mod gain;
mod mounting;
mod pulse;

pub(super) use aperture::level_at;
pub use aperture::{Aperture, BeamPoint};
pub use detector::Detector;
pub use gain::{Gain, GainStep};
pub use mounting::Mounting;
pub use pulse::{ChirpPart, Pulse};

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use self::{
    detector::{check_firings, is_once, once},
    figures::{at_most_1, from_0_to, not_negative, positive},
};
use super::Face;

/// The data files that come with the program, by name.
const PRESETS: [(&str, &str); 7] = [
    ("senscomp-6500", include_str!("../../../../sensors/senscomp-6500.json")),
    ("polaroid-chirp", include_str!("../../../../sensors/polaroid-chirp.json")),
    ("bozma-kuc-60khz", include_str!("../../../../sensors/bozma-kuc-60khz.json")),
    ("pioneer", include_str!("../../../../sensors/pioneer.json")),
    ("fullwave-line", include_str!("../../../../sensors/fullwave-line.json")),
    ("hc-sr04", include_str!("../../../../sensors/hc-sr04.json")),
    ("lego-nxt", include_str!("../../../../sensors/lego-nxt.json")),
];

/// A threshold that rises faster is a range at which the module gives up.
const MOST_RISE_DB_PER_M: f64 = 100.0;
/// Coarser ones are no ranges.
const MOST_RANGE_STEP_M: f64 = 1.0;

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
    #[serde(default, skip_serializing_if = "Mounting::is_default")]
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
    /// Time-variable gain of the amplifier.
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
    /// What the threshold gains with each metre of range beside what the gain says, decibels: a module that hears
    /// worse and worse from afar, for whatever reason. `threshold` is the one at range 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub threshold_rise_db_per_m: f64,
    /// Whole steps in which the module tells ranges, metres, each rounded to the nearest; 0 for ranges as they are.
    #[serde(default, skip_serializing_if = "is_default")]
    pub range_step_m: f64,
    /// What the detector watches.
    #[serde(default, skip_serializing_if = "is_default")]
    pub detector: Detector,
    /// How many firings a reading is the mean of; it matters where there is noise.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub averaged_firings: u32,
    /// For each figure above, by field name, where it comes from.
    pub sources: BTreeMap<String, String>,
}

/// What edges send back; see [`EdgeLaw`](super::edge::EdgeLaw).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum EdgeLawKind {
    /// Uniform coefficients for the wedge's angle and aspect (Kouyoumjian and Pathak).
    Utd,
    /// One ratio to a plane at the same range, whatever the aspect.
    KucSiegel,
    /// One scattering strength, whatever the aspect, level with planes at the face.
    BozmaKuc,
}

/// How the face answers to a pulse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Response {
    /// By its beam pattern: every echo has the shape of one on the axis, only weaker.
    #[default]
    Stationary,
    /// Point by point: echoes off the axis are longer and begin earlier, and the pattern's nulls fill
    /// up.
    Full,
}

/// An error in a sensor's data.
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

    /// The data file of a sensor that comes with the program, as it is shipped.
    #[must_use]
    pub fn preset_text(name: &str) -> Option<&'static str> {
        PRESETS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    /// A sensor that comes with the program.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn preset(name: &str) -> Result<Self, SensorError> {
        match Self::preset_text(name) {
            Some(text) => Self::from_json(text),
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
        self.aperture.check()?;
        if let Some(Face { radius_m, reflectance }) = self.face {
            positive("face.radius_m", radius_m)?;
            at_most_1("face.reflectance", reflectance)?;
        }
        self.pulse.check()?;
        self.mounting.check()?;
        not_negative("blanking_us", self.blanking_us)?;
        not_negative("short_blanking_us", self.short_blanking_us.unwrap_or(0.0))?;
        not_negative("rearm_us", self.rearm_us)?;
        not_negative("integration_us", self.integration_us)?;
        self.gain.check()?;
        positive("max_range_m", self.max_range_m)?;
        positive("threshold", self.threshold)?;
        from_0_to("threshold_rise_db_per_m", self.threshold_rise_db_per_m, MOST_RISE_DB_PER_M)?;
        from_0_to("range_step_m", self.range_step_m, MOST_RANGE_STEP_M)?;
        check_firings(self.averaged_firings)
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
            Aperture::Piston { radius_m, .. }
            | Aperture::Gaussian { radius_m, .. }
            | Aperture::Table { radius_m, .. } => radius_m,
            Aperture::Line { half_length_m, .. } => half_length_m,
        }
    }
}

const fn default_rearm_us() -> f64 {
    440.0
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn form_error(field: String, error: &serde_json::Error) -> SensorError {
    let message = error.to_string();
    // serde_json appends the place, which is reported apart.
    let message = message.split(" at line ").next().unwrap_or_default().to_owned();
    SensorError::Form { line: error.line(), column: error.column(), field, message }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acoustics::{Air, BeamPattern, Receiver};

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
        let with_points = |points: &str| {
            let table = format!(
                r#""aperture": {{"shape": "table", "points": [{points}], "radius_m": 0.01}}"#
            );
            text.replace(r#""aperture": {"shape": "piston", "radius_m": 0.0193}"#, &table)
        };
        for (wrong, part) in [
            (text.replace("49400.0", "-1"), "frequency_hz is -1"),
            (text.replacen('{', r#"{"averaged_firings": 0,"#, 1), "averaged_firings is 0"),
            (text.replacen('{', r#"{"detector": "cycle","#, 1), "detector"),
            (text.replace("0.0193", "0"), "aperture.radius_m"),
            (text.replace("\"blanking_us\": 2380.0", "\"blanking\": 2380.0"), "blanking"),
            (text.replace("10.7,", "\"far\","), "max_range_m"),
            (text.replace("\"piston\"", "\"horn\""), "aperture"),
            (
                text.replace("\"until_us\": 5120.0", "\"until_us\": 120.0"),
                "gain.steps.until_us is 120",
            ),
            (text.replace("\"until_us\": 5120.0", "\"until_us\": null"), "gain.steps.until_us"),
            (
                text.replace(
                    "\"threshold\": 0.0175",
                    "\"threshold\": 0.0175, \"threshold_rise_db_per_m\": -1",
                ),
                "threshold_rise_db_per_m is -1",
            ),
            (
                text.replace("\"threshold\": 0.0175", "\"threshold\": 0.0175, \"range_step_m\": 2"),
                "range_step_m is 2",
            ),
            (text.replace("0.0193", "0.0193, \"skirts_db\": 3"), "aperture.skirts_db is 3"),
            (with_points(r#"{"angle_deg": 0, "level_db": 0}"#), "aperture.points (how many) is 1"),
            (
                with_points(
                    r#"{"angle_deg": 0, "level_db": 0}, {"angle_deg": 20, "level_db": -3}"#,
                ),
                "null at the last point",
            ),
            (
                with_points(
                    r#"{"angle_deg": 0, "level_db": -1}, {"angle_deg": 20, "level_db": null}"#,
                ),
                "0 at 0 degrees",
            ),
            (
                with_points(
                    r#"{"angle_deg": 0, "level_db": 0}, {"angle_deg": 0, "level_db": null}"#,
                ),
                "farther out",
            ),
            (text.trim_end().trim_end_matches('}').to_owned(), "EOF"),
            (format!("{text} x"), "end of file"),
        ] {
            let error = Sensor::from_json(&wrong).expect_err(part).to_string();
            assert!(error.contains(part), "{error} lacks {part}");
        }
        let error = Sensor::preset("sonar").expect_err("unknown").to_string();
        assert!(error.contains("senscomp-6500"), "{error}");
    }

    /// Half the arc over which a rigid wall is heard at a range, degrees.
    fn half_arc_deg(sensor: &Sensor, range_m: f64) -> f64 {
        let air = Air::default();
        let receiver = Receiver::new(sensor, air.sound_speed_m_s());
        let beam = BeamPattern::new(sensor, air.sound_speed_m_s());
        let loss_db = 2.0 * range_m * air.absorption_db_per_m(sensor.frequency_hz);
        let threshold = receiver.threshold_at(2e6 * range_m / air.sound_speed_m_s());
        beam.angle_at((threshold * 10f64.powf(loss_db / 20.0)).sqrt()).to_degrees()
    }

    /// The arena's sweeps (docs/reality.md): a wall before the ranger answers over some 100 degrees at 0.28 m and over
    /// 60 at 0.81 m, and that at 1.8 m over a score or less.
    #[test]
    fn a_lego_nxt_hears_walls_over_narrower_arcs_from_afar() {
        let sensor = Sensor::preset("lego-nxt").expect("a preset");
        let [near, middle, far] = [0.28, 0.81, 1.8].map(|range_m| half_arc_deg(&sensor, range_m));
        assert!((45.0..60.0).contains(&near), "{near}");
        assert!((28.0..42.0).contains(&middle), "{middle}");
        assert!((5.0..22.0).contains(&far), "{far}");
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

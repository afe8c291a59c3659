//! Sensor parameters: one data file per preset, with a source for each figure.

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

/// Data files shipped with the program, by name.
const PRESETS: [(&str, &str); 7] = [
    ("senscomp-6500", include_str!("../../../../sensors/senscomp-6500.json")),
    ("polaroid-chirp", include_str!("../../../../sensors/polaroid-chirp.json")),
    ("bozma-kuc-60khz", include_str!("../../../../sensors/bozma-kuc-60khz.json")),
    ("pioneer", include_str!("../../../../sensors/pioneer.json")),
    ("fullwave-line", include_str!("../../../../sensors/fullwave-line.json")),
    ("hc-sr04", include_str!("../../../../sensors/hc-sr04.json")),
    ("lego-nxt", include_str!("../../../../sensors/lego-nxt.json")),
];

/// A steeper rise amounts to a maximum range.
const MAX_RISE_DB_PER_M: f64 = 100.0;
const MAX_RANGE_STEP_M: f64 = 1.0;

/// Parameters of an ultrasonic ranger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Name of the preset.
    pub name: String,
    /// One-sentence description of the sensor.
    pub description: String,
    /// Carrier frequency of the pulse, hertz.
    pub frequency_hz: f64,
    /// Shape of the radiating face, which determines the beam pattern.
    pub aperture: Aperture,
    /// Face and housing as a reflector; if absent, sound passes the ranger unobstructed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub face: Option<Face>,
    /// Position of the transducer relative to the rotation axis.
    #[serde(default, skip_serializing_if = "Mounting::is_default")]
    pub mounting: Mounting,
    /// Transmitted pulse shape and bandwidth.
    pub pulse: Pulse,
    /// Receiver blanking after firing, microseconds.
    pub blanking_us: f64,
    /// Receiver blanking when shortened by hand, microseconds.
    #[serde(default)]
    pub short_blanking_us: Option<f64>,
    /// Hold-off of the detector after an echo, microseconds.
    #[serde(default = "default_rearm_us")]
    pub rearm_us: f64,
    /// Minimum time above the threshold for a detection, microseconds; time below it counts back. 0
    /// for a plain threshold.
    #[serde(default, skip_serializing_if = "is_default")]
    pub integration_us: f64,
    /// Maximum rated range, metres.
    pub max_range_m: f64,
    /// Time-variable gain of the amplifier.
    #[serde(default, skip_serializing_if = "is_default")]
    pub gain: Gain,
    /// Response of the face to a pulse.
    #[serde(default, skip_serializing_if = "is_default")]
    pub response: Response,
    /// Edge diffraction law in the experiments that the figures come from; `utd` if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge_law: Option<EdgeLawKind>,
    /// Detection threshold as an amplitude relative to a head-on, perfectly reflecting wall with
    /// gain compensation.
    pub threshold: f64,
    /// Rise of the threshold with range, dB/m, in addition to the gain: loss of sensitivity of the
    /// module with range, whatever its cause. `threshold` applies at range 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub threshold_rise_db_per_m: f64,
    /// Range resolution of the module, metres; ranges are rounded to the nearest step. 0 for
    /// unquantized ranges.
    #[serde(default, skip_serializing_if = "is_default")]
    pub range_step_m: f64,
    /// Signal that the detector compares with the threshold.
    #[serde(default, skip_serializing_if = "is_default")]
    pub detector: Detector,
    /// Number of firings averaged per reading; relevant only with noise.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub averaged_firings: u32,
    /// Source of each figure above, by field name.
    pub sources: BTreeMap<String, String>,
}

/// Edge diffraction law; see [`EdgeLaw`](super::edge::EdgeLaw).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum EdgeLawKind {
    /// Uniform coefficients for the wedge's angle and aspect (Kouyoumjian and Pathak).
    Utd,
    /// Constant ratio to a plane at the same range, independent of aspect.
    KucSiegel,
    /// Constant scattering strength, independent of aspect, equal to a plane's at the face.
    BozmaKuc,
}

/// Response of the face to a pulse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Response {
    /// Beam pattern: every echo has the shape of one on the axis, attenuated.
    #[default]
    Stationary,
    /// Point by point: off-axis echoes are longer and begin earlier, and the nulls of the pattern
    /// are filled.
    Full,
}

/// Error in a sensor's data.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SensorError {
    /// Invalid JSON, or not a sensor's structure.
    #[error("line {line}, column {column}: {field}: {message}")]
    Malformed {
        /// Line in the text, from 1.
        line: usize,
        /// Column in the line, from 1.
        column: usize,
        /// Path of the field, as far as it was parsed.
        field: String,
        /// Description of the error.
        message: String,
    },
    /// Value out of range.
    #[error("{field} is {value}: it must be {expected}")]
    OutOfRange {
        /// Path of the field.
        field: &'static str,
        /// Value outside the range.
        value: f64,
        /// Description of the valid range.
        expected: &'static str,
    },
    /// Request of a preset that does not exist.
    #[error("there is no sensor preset \"{name}\"; known presets: {known}")]
    UnknownPreset {
        /// Name of the requested preset.
        name: String,
        /// Names of all presets.
        known: String,
    },
}

impl Sensor {
    /// Names of the presets, the default one first.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        PRESETS.iter().map(|(name, _)| *name)
    }

    /// Data file of a shipped sensor, verbatim.
    #[must_use]
    pub fn preset_text(name: &str) -> Option<&'static str> {
        PRESETS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    /// Loads a shipped sensor.
    ///
    /// # Errors
    /// If there is no preset of that name.
    pub fn preset(name: &str) -> Result<Self, SensorError> {
        match Self::preset_text(name) {
            Some(text) => Self::from_json(text),
            None => Err(SensorError::UnknownPreset {
                name: name.to_owned(),
                known: Self::preset_names().collect::<Vec<_>>().join(", "),
            }),
        }
    }

    /// Parses a sensor from the text of a data file.
    ///
    /// # Errors
    /// If the text is not a sensor's, or a value is out of range.
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

    /// Checks that every value is in range.
    ///
    /// # Errors
    /// Returns the first value that is not.
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
        from_0_to("threshold_rise_db_per_m", self.threshold_rise_db_per_m, MAX_RISE_DB_PER_M)?;
        from_0_to("range_step_m", self.range_step_m, MAX_RANGE_STEP_M)?;
        check_firings(self.averaged_firings)
    }

    /// Duration of the pulse, seconds (for a Gaussian: three sigma on each side).
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

    /// Half width of the face in the scan plane, metres.
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
    // serde_json appends the position, which is reported separately.
    let message = message.split(" at line ").next().unwrap_or_default().to_owned();
    SensorError::Malformed { line: error.line(), column: error.column(), field, message }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::acoustics::{Air, BeamPattern, Receiver};

    #[test]
    fn presets_name_their_sources() {
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
    fn rejects_invalid_data() {
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

    /// Half the arc over which a rigid wall is detected at a range, degrees.
    fn half_arc_deg(sensor: &Sensor, range_m: f64) -> f64 {
        let air = Air::default();
        let receiver = Receiver::new(sensor, air.sound_speed_m_s());
        let beam = BeamPattern::new(sensor, air.sound_speed_m_s());
        let loss_db = 2.0 * range_m * air.absorption_db_per_m(sensor.frequency_hz);
        let threshold = receiver.threshold_at(2e6 * range_m / air.sound_speed_m_s());
        beam.angle_at((threshold * 10f64.powf(loss_db / 20.0)).sqrt()).to_degrees()
    }

    /// Measured sweeps of the arena (docs/reality.md): a wall ahead is detected over some 100
    /// degrees at 0.28 m, over 60 at 0.81 m, and over 20 or less at 1.8 m.
    #[test]
    fn lego_nxt_arcs_narrow_with_range() {
        let sensor = Sensor::preset("lego-nxt").expect("a preset");
        let [near, middle, far] = [0.28, 0.81, 1.8].map(|range_m| half_arc_deg(&sensor, range_m));
        assert!((45.0..60.0).contains(&near), "{near}");
        assert!((28.0..42.0).contains(&middle), "{middle}");
        assert!((5.0..22.0).contains(&far), "{far}");
    }

    #[test]
    fn threshold_fits_the_rated_range() {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let loss_db = 2.0
            * sensor.max_range_m
            * crate::acoustics::Air::default().absorption_db_per_m(sensor.frequency_hz);
        let amplitude = 10f64.powf(-loss_db / 20.0);
        assert!((amplitude / sensor.threshold - 1.0).abs() < 0.01, "{amplitude}");
    }
}

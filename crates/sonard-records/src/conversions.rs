//! Conversion between model types and records: air, settings, predictions and paths.

use serde_json::Value;
use sonard_model::{
    acoustics::{Air, AirError},
    model::{Interaction, Mechanism, OptionKeys, Options, Path, Prediction, Simulator},
    scene::Scene,
};

use crate::{
    AirRecord, InteractionKind, InteractionRecord, ModelRecord, PathRecord, Point, SimRecord,
};

impl From<&Air> for AirRecord {
    fn from(air: &Air) -> Self {
        Self {
            temperature_c: air.temperature_c(),
            humidity_percent: air.humidity_percent(),
            pressure_kpa: air.pressure_kpa(),
            sound_speed_m_s: air.sound_speed_m_s(),
        }
    }
}

impl TryFrom<&AirRecord> for Air {
    type Error = AirError;

    /// Reconstructs the air of a log. A speed of sound that differs from the computed one was set
    /// by hand and is kept.
    fn try_from(record: &AirRecord) -> Result<Self, AirError> {
        let air = Self::new(record.temperature_c, record.humidity_percent, record.pressure_kpa)?;
        if (air.sound_speed_m_s() - record.sound_speed_m_s).abs() < 1e-9 {
            Ok(air)
        } else {
            air.with_sound_speed(record.sound_speed_m_s)
        }
    }
}

impl From<&Options> for ModelRecord {
    /// Engine and settings in the form of a log record; unset values are omitted.
    fn from(options: &Options) -> Self {
        let mut settings = serde_json::Map::new();
        if let Ok(Value::Object(values)) = serde_json::to_value(OptionKeys::from(options)) {
            settings.extend(values.into_iter().filter(|(_, value)| !value.is_null()));
        }
        settings.remove("engine");
        // Omitted when `false`, for logs that predate these settings.
        for later in ["double_diffraction", "without_crosstalk"] {
            if settings.get(later) == Some(&Value::Bool(false)) {
                settings.remove(later);
            }
        }
        Self { engine: options.engine.kind().name().to_owned(), settings }
    }
}

impl ModelRecord {
    /// Options of a log's model; `None` if this program lacks the engine or a setting. Early logs
    /// contain the defaults of all engines, which are ignored.
    #[must_use]
    pub fn options(&self) -> Option<Options> {
        let mut settings = self.settings.clone();
        settings.insert("engine".into(), self.engine.clone().into());
        let known = serde_json::to_value(OptionKeys::default()).ok()?;
        if settings.keys().any(|key| known.get(key).is_none()) {
            return None;
        }
        let keys: OptionKeys = serde_json::from_value(settings.into()).ok()?;
        Some(keys.engine_options())
    }
}

impl SimRecord {
    /// Record of a prediction.
    #[must_use]
    pub fn from_prediction(simulator: &Simulator, prediction: &Prediction) -> Self {
        let arrival = prediction.arrival.as_ref();
        Self {
            status: prediction.status,
            range_m: prediction.range_m,
            amplitude: prediction.amplitude,
            margin_db: prediction.margin_db,
            path: arrival.map(|arrival| {
                PathRecord::from_path(simulator.scene(), &arrival.path, arrival.length_m)
            }),
            crosstalk: None,
        }
    }
}

impl PathRecord {
    /// Record of a path with its round-trip length in metres and the ids of the reflectors in its
    /// scene.
    ///
    /// # Panics
    /// If the path belongs to another scene.
    #[must_use]
    pub fn from_path(scene: &Scene, path: &Path, length_m: f64) -> Self {
        let interaction = |interaction: &Interaction| InteractionRecord {
            kind: interaction.mechanism.into(),
            id: interaction.mechanism.name(scene),
            point: Point::rounded(interaction.point, interaction.z_m),
        };
        Self {
            kind: path.kind(),
            order: path.order() as u32,
            interactions: path.interactions.iter().map(interaction).collect(),
            length_m,
        }
    }
}

impl From<Mechanism> for InteractionKind {
    fn from(mechanism: Mechanism) -> Self {
        match mechanism {
            Mechanism::Reflection(_) => Self::Reflection,
            Mechanism::Diffraction(_) => Self::Diffraction,
            Mechanism::Scattering { .. } => Self::Scattering,
            Mechanism::Transducer => Self::Transducer,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sonard_model::model::{ConeOptions, EngineKind, EngineOptions, FanOptions, PathOptions};

    #[test]
    fn air_round_trips() {
        for air in [
            Air::default(),
            Air::new(-12.5, 80.0, 99.0).expect("in range"),
            Air::new(7.0, 81.0, 99.0).expect("in range").with_sound_speed(340.0).expect("in range"),
        ] {
            assert_eq!(Air::try_from(&AirRecord::from(&air)), Ok(air));
        }
    }

    #[test]
    fn options_round_trip() {
        let paths = PathOptions { double_diffraction: true, lossless: true, ..Default::default() };
        let fan = FanOptions { ray_spacing_deg: 0.5, ..FanOptions::default() };
        let cone = ConeOptions { aperture_deg: Some(15.0) };
        let engines = [EngineOptions::default(), paths.into(), fan.into(), cone.into()];
        for engine in engines {
            let options = Options { max_range_m: Some(4.0), ..engine.into() };
            assert_eq!(ModelRecord::from(&options).options(), Some(options));
        }
        let record = ModelRecord::from(&Options::default());
        assert_eq!(
            serde_json::to_string(&record).expect("JSON"),
            r#"{"engine":"paths","ideal_receiver":false,"lossless":false}"#
        );
        let unknown = ModelRecord { engine: "rays".into(), ..record.clone() };
        assert_eq!(unknown.options(), None);
        let mut unknown = record;
        unknown.settings.insert("bounces".into(), 3.into());
        assert_eq!(unknown.options(), None);
    }

    #[test]
    fn accepts_early_records() {
        for engine in [EngineKind::Paths, EngineKind::Fan, EngineKind::Cone] {
            let text = format!(
                r#"{{"engine":"{}","max_range_m":4.0,"ideal_receiver":false,"lossless":false,
                "ray_spacing_deg":0.05}}"#,
                engine.name()
            );
            let record: ModelRecord = serde_json::from_str(&text).expect("a record");
            let options = Options { max_range_m: Some(4.0), ..engine.options().into() };
            assert_eq!(record.options(), Some(options));
        }
    }
}

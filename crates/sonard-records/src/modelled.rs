//! Records of the model's words: air, settings, predictions and paths, and back from them.

use sonard_model::{
    acoustics::{Air, AirError},
    model::{Bend, FACE_NAME, Options, Path, Prediction, RecordedPath, Reflector, Simulator},
    scene::Scene,
};

use crate::{AirRecord, ModelRecord, PathRecord, SimRecord};

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

    /// The air a log was taken in; a speed of sound that the state does not explain was given by hand and
    /// stays.
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
    /// Engine and settings as they stand in a log.
    fn from(options: &Options) -> Self {
        let mut settings = serde_json::Map::new();
        if let Ok(serde_json::Value::Object(values)) = serde_json::to_value(options) {
            settings.extend(values.into_iter().filter(|(_, value)| !value.is_null()));
        }
        settings.remove("engine");
        Self { engine: options.engine.name().to_owned(), settings }
    }
}

impl ModelRecord {
    /// The options that a log's model was run with; `None` if this program has no such engine or
    /// setting.
    #[must_use]
    pub fn options(&self) -> Option<Options> {
        let mut settings = self.settings.clone();
        settings.insert("engine".into(), self.engine.clone().into());
        serde_json::from_value(settings.into()).ok()
    }
}

impl SimRecord {
    /// A prediction as it stands in a log.
    #[must_use]
    pub fn of(simulator: &Simulator, prediction: &Prediction) -> Self {
        let arrival = prediction.arrival.as_ref();
        Self {
            status: prediction.status,
            range_m: prediction.range_m,
            amplitude: prediction.amplitude,
            margin_db: prediction.margin_db,
            path: arrival
                .map(|arrival| PathRecord::of(simulator.scene(), &arrival.path, arrival.length_m)),
        }
    }
}

impl PathRecord {
    /// A path of so many metres there and back, with the names of what it meets in its scene.
    ///
    /// # Panics
    /// If the path is of another scene.
    #[must_use]
    pub fn of(scene: &Scene, path: &Path, length_m: f64) -> Self {
        let path = RecordedPath::from(path);
        let mut edges = path.bends.iter().map(|bend| bend.name(scene));
        let name = |met: &Option<Reflector>| {
            met.map_or_else(|| FACE_NAME.to_owned(), |reflector| reflector.name(scene))
        };
        Self {
            kind: path.kind,
            order: path.walls.len() as u32,
            walls: path.walls.iter().map(name).collect(),
            edge: edges.next(),
            second_edge: edges.next(),
            length_m,
        }
    }

    /// The path of a log's record in its scene; `None` if the scene lacks one of its names.
    #[must_use]
    pub fn path(&self, scene: &Scene) -> Option<RecordedPath> {
        let met = |name: &String| {
            if name == FACE_NAME { Some(None) } else { Reflector::named(scene, name).map(Some) }
        };
        let walls = self.walls.iter().map(met);
        let edges = self.edge.iter().chain(&self.second_edge);
        let bends = edges.map(|name| Bend::named(scene, name));
        Some(RecordedPath {
            kind: self.kind,
            walls: walls.collect::<Option<_>>()?,
            bends: bends.collect::<Option<_>>()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn air_survives_its_record() {
        for air in [
            Air::default(),
            Air::new(-12.5, 80.0, 99.0).expect("in range"),
            Air::new(7.0, 81.0, 99.0).expect("in range").with_sound_speed(340.0).expect("in range"),
        ] {
            assert_eq!(Air::try_from(&AirRecord::from(&air)), Ok(air));
        }
    }

    #[test]
    fn options_survive_their_record() {
        let options = Options {
            max_range_m: Some(4.0),
            double_diffraction: true,
            ray_spacing_deg: 0.5,
            ..Options::default()
        };
        for options in [Options::default(), options] {
            assert_eq!(ModelRecord::from(&options).options(), Some(options));
        }
        let unknown = ModelRecord { engine: "rays".into(), ..ModelRecord::from(&options) };
        assert_eq!(unknown.options(), None);
    }
}

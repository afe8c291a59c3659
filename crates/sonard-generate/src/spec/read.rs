//! From the text of a specification to what it says, with the files that it names.

use std::{collections::BTreeMap, io};

use serde::{Deserialize, Serialize};
use sonard_model::{
    acoustics::Sensor,
    model::OptionKeys,
    scene::{Scene, shipped, suggest},
};
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::{Spec, SpecError, check, error::Fault};
use crate::seed::sha256;

/// Gives the text of a file that a specification names.
pub(crate) type ReadFile<'a> = &'a dyn Fn(&str) -> io::Result<String>;

/// A specification with all that it names: everything that a set follows from.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Resolved {
    specification: Spec,
    /// Texts of scene files by the names that the specification has for them.
    scenes: BTreeMap<String, String>,
    /// The same of sensors' data files.
    sensors: BTreeMap<String, String>,
}

/// A specification that was checked, with what it names.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub(crate) spec: Spec,
    pub(crate) scenes: BTreeMap<String, Scene>,
    /// In the order of `sensor.any_of`.
    pub(crate) sensors: Vec<Sensor>,
    /// All of it as JSON: whoever has this has the set.
    pub(crate) text: String,
    /// Its digest.
    pub(crate) sha256: String,
}

/// From a TOML file.
pub(crate) fn from_toml(file: &str, text: &str, read: ReadFile<'_>) -> Result<Loaded, SpecError> {
    let at = |offset: usize| Some(place(text, offset));
    let syntax = |error: toml::de::Error| SpecError {
        file: file.to_owned(),
        place: error.span().and_then(|span| at(span.start)),
        field: String::new(),
        message: error.message().to_owned(),
        help: "the file is TOML: [section] lines, and key = value below them".to_owned(),
    };
    let spans = DeTable::parse(text).map_err(syntax)?;
    let locate = |fault: Fault| SpecError {
        file: file.to_owned(),
        place: offset_of(spans.get_ref(), &fault.field).and_then(at),
        field: fault.field,
        message: fault.message,
        help: fault.help,
    };
    unknown_model_key(spans.get_ref()).map_err(locate)?;
    let deserializer = toml::Deserializer::parse(text).map_err(syntax)?;
    let spec: Spec = serde_path_to_error::deserialize(deserializer).map_err(|error| {
        let (field, inner) = (error.path().to_string(), error.into_inner());
        let place = inner.span().and_then(|span| at(span.start));
        let (message, help) = worded(inner.message());
        let field = if field == "." { String::new() } else { field };
        SpecError { file: file.to_owned(), place, field, message, help }
    })?;
    let named = Named::of(&spec, read).map_err(locate)?;
    named.load(spec).map_err(locate)
}

/// From what [`Loaded::text`] was.
pub(crate) fn from_json(file: &str, text: &str) -> Result<Loaded, SpecError> {
    let fault = |field: String, place, message: String, help: String| SpecError {
        file: file.to_owned(),
        place,
        field,
        message,
        help,
    };
    let mut json = serde_json::Deserializer::from_str(text);
    let resolved: Resolved = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let (field, inner) = (error.path().to_string(), error.into_inner());
        let place = Some((inner.line(), inner.column()));
        let help = "give spec.json of a data set as it was written";
        fault(field, place, inner.to_string(), help.to_owned())
    })?;
    let named = Named { scenes: resolved.scenes, sensors: resolved.sensors };
    named
        .load(resolved.specification)
        .map_err(|found| fault(found.field, None, found.message, found.help))
}

/// Texts of the files that a specification names.
struct Named {
    scenes: BTreeMap<String, String>,
    sensors: BTreeMap<String, String>,
}

impl Named {
    fn of(spec: &Spec, read: ReadFile<'_>) -> Result<Self, Fault> {
        let mut scenes = BTreeMap::new();
        for (index, keys) in spec.scene.iter().enumerate() {
            let Some(name) = &keys.file else { continue };
            let text = shipped::text(name).map_or_else(|| read(name), |text| Ok(text.to_owned()));
            let text = text.map_err(|error| {
                let known: Vec<_> = shipped::names().map(str::to_owned).collect();
                let help = format!(
                    "give a file beside the specification, or {}",
                    suggest(name, &known, "shipped scenes")
                );
                Fault::new(format!("scene[{index}].file"), format!("{name}: {error}"), help)
            })?;
            scenes.insert(name.clone(), text);
        }
        let mut sensors = BTreeMap::new();
        for (index, name) in spec.sensor.any_of.iter().enumerate() {
            let preset = Sensor::preset_text(name).map(|text| Ok(text.to_owned()));
            let text = preset.unwrap_or_else(|| read(name)).map_err(|error| {
                let known: Vec<_> = Sensor::preset_names().map(str::to_owned).collect();
                let help = format!(
                    "give a file beside the specification, or {}",
                    suggest(name, &known, "presets")
                );
                Fault::new(format!("sensor.any_of[{index}]"), format!("{name}: {error}"), help)
            })?;
            sensors.insert(name.clone(), text);
        }
        Ok(Self { scenes, sensors })
    }

    fn load(self, spec: Spec) -> Result<Loaded, Fault> {
        let mut scenes = BTreeMap::new();
        for (index, keys) in spec.scene.iter().enumerate() {
            let Some((name, text)) =
                keys.file.as_ref().and_then(|name| self.scenes.get_key_value(name))
            else {
                continue;
            };
            let field = format!("scene[{index}].file");
            let scene = Scene::from_json(text).map_err(|error| {
                Fault::new(&*field, format!("{name}: {error}"), "mend the file")
            })?;
            if scene.robot.is_some() {
                let help = "take `robot` out of the scene: here a ranger stands alone";
                return Err(Fault::new(field, format!("{name} has a robot's body"), help));
            }
            scenes.insert(name.clone(), scene);
        }
        let sensor = |(index, name): (usize, &String)| {
            let text = self.sensors.get(name).map_or("", String::as_str);
            Sensor::from_json(text).map_err(|error| {
                let field = format!("sensor.any_of[{index}]");
                Fault::new(field, format!("{name}: {error}"), "mend the file")
            })
        };
        let named = spec.sensor.any_of.iter().enumerate();
        let sensors: Vec<Sensor> = named.map(sensor).collect::<Result<_, _>>()?;
        check::check(&spec, &sensors, &scenes)?;
        let Self { scenes: scene_texts, sensors: sensor_texts } = self;
        let resolved = Resolved { specification: spec, scenes: scene_texts, sensors: sensor_texts };
        // Structures of numbers that were checked and texts: there is nothing that JSON has no words for.
        let text = serde_json::to_string_pretty(&resolved).unwrap_or_default() + "\n";
        let sha256 = sha256(text.as_bytes());
        Ok(Loaded { spec: resolved.specification, scenes, sensors, text, sha256 })
    }
}

/// A key of `[model]` that there is not: the settings of the model are read in other files, too, which say that
/// themselves.
fn unknown_model_key(root: &DeTable<'_>) -> Result<(), Fault> {
    let Some(model) = entry(root, "model").and_then(|model| model.get_ref().as_table()) else {
        return Ok(());
    };
    let known: Vec<String> = match serde_json::to_value(OptionKeys::default()) {
        Ok(serde_json::Value::Object(keys)) => keys.into_iter().map(|(key, _)| key).collect(),
        _ => Vec::new(),
    };
    let unknown = model.keys().find(|key| !known.iter().any(|one| one == &**key.get_ref()));
    match unknown {
        None => Ok(()),
        Some(key) => {
            let help = suggest(key.get_ref(), &known, "keys");
            Err(Fault::new(
                format!("model.{}", key.get_ref()),
                format!("unknown field `{}`", key.get_ref()),
                help,
            ))
        }
    }
}

fn entry<'a, 'i>(table: &'a DeTable<'i>, name: &str) -> Option<&'a Spanned<DeValue<'i>>> {
    table.iter().find(|(key, _)| **key.get_ref() == *name).map(|(_, value)| value)
}

/// Where a field's value begins, by a name such as `scene[0].width_m`; where it is not there, what it would be in.
fn offset_of(root: &DeTable<'_>, field: &str) -> Option<usize> {
    let steps = field.split(['.', '[']).map(|step| step.trim_end_matches(']'));
    let mut at: Option<&Spanned<DeValue<'_>>> = None;
    for step in steps.filter(|step| !step.is_empty()) {
        let next = match at {
            None => entry(root, step),
            Some(value) => match value.get_ref() {
                DeValue::Table(table) => entry(table, step),
                DeValue::Array(array) => {
                    step.parse().ok().and_then(|index: usize| array.get(index))
                }
                _ => None,
            },
        };
        match next {
            Some(value) => at = Some(value),
            None => break,
        }
    }
    at.map(|value| value.span().start)
}

/// serde's words, with what would be right apart.
fn worded(message: &str) -> (String, String) {
    match message.split_once(", expected ") {
        Some((wrong, expected)) => (wrong.to_owned(), format!("expected {expected}")),
        None => (message.to_owned(), "see `sonard generate --example`".to_owned()),
    }
}

/// Line and column of a byte, from 1.
fn place(text: &str, offset: usize) -> (usize, usize) {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    let begins = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
    (line, String::from_utf8_lossy(&before[begins..]).chars().count() + 1)
}

//! Parsing of a specification, and loading of the files that it references.

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

use super::{Spec, SpecError, check, error::SpecFault};
use crate::seed::sha256;

/// Reader of a file that a specification references.
pub(crate) type ReadFile<'a> = &'a dyn Fn(&str) -> io::Result<String>;

/// Specification with all referenced files, which determines the whole set.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ResolvedSpec {
    specification: Spec,
    /// Texts of scene files, by their names in the specification.
    scenes: BTreeMap<String, String>,
    /// Texts of sensor files, by their names in the specification.
    sensors: BTreeMap<String, String>,
}

/// Validated specification with its scenes and sensors.
#[derive(Debug)]
pub(crate) struct LoadedSpec {
    pub(crate) spec: Spec,
    pub(crate) scenes: BTreeMap<String, Scene>,
    /// Sensors in the order of `sensor.any_of`.
    pub(crate) sensors: Vec<Sensor>,
    /// Specification and files as JSON, sufficient to regenerate the set.
    pub(crate) text: String,
    /// SHA-256 of `text`, hexadecimal.
    pub(crate) sha256: String,
}

/// Loads a specification from TOML.
pub(crate) fn from_toml(
    file: &str,
    text: &str,
    read: ReadFile<'_>,
) -> Result<LoadedSpec, SpecError> {
    let at = |offset: usize| Some(place(text, offset));
    let syntax = |error: toml::de::Error| SpecError {
        file: file.to_owned(),
        position: error.span().and_then(|span| at(span.start)),
        field: String::new(),
        message: error.message().to_owned(),
        help: "the file is TOML: [section] lines, with key = value lines after them".to_owned(),
    };
    let spans = DeTable::parse(text).map_err(syntax)?;
    let locate = |fault: SpecFault| SpecError {
        file: file.to_owned(),
        position: offset_of(spans.get_ref(), &fault.field).and_then(at),
        field: fault.field,
        message: fault.message,
        help: fault.help,
    };
    unknown_model_key(spans.get_ref()).map_err(locate)?;
    let deserializer = toml::Deserializer::parse(text).map_err(syntax)?;
    let spec: Spec = serde_path_to_error::deserialize(deserializer).map_err(|error| {
        let (field, inner) = (error.path().to_string(), error.into_inner());
        let place = inner.span().and_then(|span| at(span.start));
        let (message, help) = split_message(inner.message());
        let field = if field == "." { String::new() } else { field };
        SpecError { file: file.to_owned(), position: place, field, message, help }
    })?;
    let files = ReferencedFiles::read(&spec, read).map_err(locate)?;
    files.load(spec).map_err(locate)
}

/// Loads a specification from [`LoadedSpec::text`].
pub(crate) fn from_json(file: &str, text: &str) -> Result<LoadedSpec, SpecError> {
    let fault = |field: String, place, message: String, help: String| SpecError {
        file: file.to_owned(),
        position: place,
        field,
        message,
        help,
    };
    let mut json = serde_json::Deserializer::from_str(text);
    let resolved: ResolvedSpec = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let (field, inner) = (error.path().to_string(), error.into_inner());
        let place = Some((inner.line(), inner.column()));
        let help = "give the unmodified spec.json of a data set";
        fault(field, place, inner.to_string(), help.to_owned())
    })?;
    let files = ReferencedFiles { scenes: resolved.scenes, sensors: resolved.sensors };
    files
        .load(resolved.specification)
        .map_err(|found| fault(found.field, None, found.message, found.help))
}

/// Texts of the files that a specification references.
struct ReferencedFiles {
    scenes: BTreeMap<String, String>,
    sensors: BTreeMap<String, String>,
}

impl ReferencedFiles {
    fn read(spec: &Spec, read_file: ReadFile<'_>) -> Result<Self, SpecFault> {
        let mut scenes = BTreeMap::new();
        for (index, keys) in spec.scene.iter().enumerate() {
            let Some(name) = &keys.file else { continue };
            let text =
                shipped::text(name).map_or_else(|| read_file(name), |text| Ok(text.to_owned()));
            let text = text.map_err(|error| {
                let known: Vec<_> = shipped::names().map(str::to_owned).collect();
                let help = format!(
                    "give a file next to the specification, or {}",
                    suggest(name, &known, "shipped scenes")
                );
                SpecFault::new(format!("scene[{index}].file"), format!("{name}: {error}"), help)
            })?;
            scenes.insert(name.clone(), text);
        }
        let mut sensors = BTreeMap::new();
        for (index, name) in spec.sensor.any_of.iter().enumerate() {
            let preset = Sensor::preset_text(name).map(|text| Ok(text.to_owned()));
            let text = preset.unwrap_or_else(|| read_file(name)).map_err(|error| {
                let known: Vec<_> = Sensor::preset_names().map(str::to_owned).collect();
                let help = format!(
                    "give a file next to the specification, or {}",
                    suggest(name, &known, "presets")
                );
                SpecFault::new(format!("sensor.any_of[{index}]"), format!("{name}: {error}"), help)
            })?;
            sensors.insert(name.clone(), text);
        }
        Ok(Self { scenes, sensors })
    }

    fn load(self, spec: Spec) -> Result<LoadedSpec, SpecFault> {
        let mut scenes = BTreeMap::new();
        for (index, keys) in spec.scene.iter().enumerate() {
            let Some((name, text)) =
                keys.file.as_ref().and_then(|name| self.scenes.get_key_value(name))
            else {
                continue;
            };
            let field = format!("scene[{index}].file");
            let scene = Scene::from_json(text).map_err(|error| {
                SpecFault::new(&*field, format!("{name}: {error}"), "correct the file")
            })?;
            if scene.robot.is_some() {
                let help =
                    "remove `robot` from the scene: data sets simulate a ranger without a body";
                return Err(SpecFault::new(field, format!("{name} has a robot body"), help));
            }
            scenes.insert(name.clone(), scene);
        }
        let sensor = |(index, name): (usize, &String)| {
            let text = self.sensors.get(name).map_or("", String::as_str);
            Sensor::from_json(text).map_err(|error| {
                let field = format!("sensor.any_of[{index}]");
                SpecFault::new(field, format!("{name}: {error}"), "correct the file")
            })
        };
        let files = spec.sensor.any_of.iter().enumerate();
        let sensors: Vec<Sensor> = files.map(sensor).collect::<Result<_, _>>()?;
        check::check(&spec, &sensors, &scenes)?;
        let Self { scenes: scene_texts, sensors: sensor_texts } = self;
        let resolved =
            ResolvedSpec { specification: spec, scenes: scene_texts, sensors: sensor_texts };
        // Checked numbers and texts are always serializable as JSON.
        let text = serde_json::to_string_pretty(&resolved).unwrap_or_default() + "\n";
        let sha256 = sha256(text.as_bytes());
        Ok(LoadedSpec { spec: resolved.specification, scenes, sensors, text, sha256 })
    }
}

/// Rejects unknown keys of `[model]`. Serde does not, because other files that embed these settings
/// have further keys and check them themselves.
fn unknown_model_key(root: &DeTable<'_>) -> Result<(), SpecFault> {
    let Some(model) = table_entry(root, "model").and_then(|model| model.get_ref().as_table())
    else {
        return Ok(());
    };
    let known: Vec<String> = match serde_json::to_value(OptionKeys::default()) {
        Ok(serde_json::Value::Object(keys)) => keys.into_iter().map(|(key, _)| key).collect(),
        _ => Vec::new(),
    };
    let unknown = model.keys().find(|key| !known.iter().any(|name| name == &**key.get_ref()));
    match unknown {
        None => Ok(()),
        Some(key) => {
            let help = suggest(key.get_ref(), &known, "keys");
            Err(SpecFault::new(
                format!("model.{}", key.get_ref()),
                format!("unknown field `{}`", key.get_ref()),
                help,
            ))
        }
    }
}

fn table_entry<'a, 'i>(table: &'a DeTable<'i>, name: &str) -> Option<&'a Spanned<DeValue<'i>>> {
    table.iter().find(|(key, _)| **key.get_ref() == *name).map(|(_, value)| value)
}

/// Returns the offset of a field such as `scene[0].width_m`, or of the innermost value that exists
/// on its path.
fn offset_of(root: &DeTable<'_>, field: &str) -> Option<usize> {
    let steps = field.split(['.', '[']).map(|step| step.trim_end_matches(']'));
    let mut at: Option<&Spanned<DeValue<'_>>> = None;
    for step in steps.filter(|step| !step.is_empty()) {
        let next = match at {
            None => table_entry(root, step),
            Some(value) => match value.get_ref() {
                DeValue::Table(table) => table_entry(table, step),
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

/// Splits a message of serde into fault and advice.
fn split_message(message: &str) -> (String, String) {
    match message.split_once(", expected ") {
        Some((wrong, expected)) => (wrong.to_owned(), format!("expected {expected}")),
        None => (message.to_owned(), "see `sonard generate --example`".to_owned()),
    }
}

/// Returns line and column of a byte offset, from 1.
fn place(text: &str, offset: usize) -> (usize, usize) {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    let begins = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
    (line, String::from_utf8_lossy(&before[begins..]).chars().count() + 1)
}

//! Merges configuration file, environment and options, and keeps the source of each value for error
//! messages.

mod error;

use std::{collections::BTreeMap, marker::PhantomData, ops::Range};

use sonard_model::scene::suggest;
use toml::{Value, de::DeTable};

use super::{
    keys::Keys,
    schema::{ConfigForm, Key, Section, ValueKind},
};

pub use error::{ConfigError, Origin};

/// Configuration values collected so far; later sources override earlier ones.
#[derive(Debug, Clone, Default)]
pub struct ConfigLayers<K = Keys> {
    given: BTreeMap<(String, String), (Value, Origin)>,
    form: PhantomData<K>,
}

/// Key of sections that accept any key.
static FREE_KEY: Key = Key {
    name: String::new(),
    about: String::new(),
    kind: ValueKind::Scalar,
    default: None,
    example: None,
    is_soft_default: false,
};

impl<K: ConfigForm> ConfigLayers<K> {
    /// Configuration with default values only.
    #[must_use]
    pub const fn new() -> Self {
        Self { given: BTreeMap::new(), form: PhantomData }
    }

    /// Merges the text of a file over the previous values; `name` identifies it in error messages.
    ///
    /// # Errors
    /// Invalid TOML, or an unknown section or key.
    pub fn with_file(mut self, name: &str, text: &str) -> Result<Self, ConfigError> {
        let at = |span: Range<usize>| position(name, text, span.start);
        let syntax = |error: toml::de::Error| ConfigError {
            origin: at(error.span().unwrap_or(0..0)),
            message: error.message().to_owned(),
            help: "expected TOML: [section] lines, each followed by lines key = value".into(),
        };
        let spans = DeTable::parse(text).map_err(syntax)?;
        let values: toml::Table = toml::from_str(text).map_err(syntax)?;
        for (section, entries) in spans.get_ref() {
            let (section_at, section) = (at(section.span()), section.get_ref());
            check_section::<K>(section, &section_at)?;
            let Some(entries) = entries.get_ref().as_table() else {
                return Err(ConfigError {
                    origin: section_at,
                    message: format!("{section} is a section, not a key"),
                    help: format!("write [{section}] on a line of its own, its keys below"),
                });
            };
            for (key, value) in entries {
                find_key::<K>(section, key.get_ref(), &at(key.span()))?;
                let Some(given) = values.get(&**section).and_then(|s| s.get(&**key.get_ref()))
                else {
                    continue;
                };
                let origin = at(value.span());
                self.set(section, key.get_ref(), given.clone(), origin);
            }
        }
        Ok(self)
    }

    /// Merges environment variables of the form `SONARD_SECTION_KEY` over the previous values.
    /// Other variables are ignored.
    ///
    /// # Errors
    /// Unknown key, or a value of the wrong type.
    pub fn with_environment(
        mut self,
        variables: impl IntoIterator<Item = (String, String)>,
    ) -> Result<Self, ConfigError> {
        for (variable, value) in variables {
            let Some(name) = variable.strip_prefix("SONARD_") else { continue };
            let name = name.to_lowercase();
            let Some((section, key)) = name.split_once('_') else { continue };
            if K::sections().iter().any(|known| known.name == section) {
                self.text(section, key, &value, Origin::Environment(variable.clone()))?;
            }
        }
        Ok(self)
    }

    /// Merges one option `section.key=value` over the previous values.
    ///
    /// # Errors
    /// Wrong syntax, unknown key, or a value of the wrong type.
    pub fn with_option(mut self, option: &str, setting: &str) -> Result<Self, ConfigError> {
        let origin = Origin::Option(format!("{option} {setting}"));
        let parts =
            setting.split_once('=').and_then(|(name, value)| Some((name.split_once('.')?, value)));
        let Some(((section, key), value)) = parts else {
            return Err(ConfigError {
                origin,
                message: "expected SECTION.KEY=VALUE".into(),
                help: "for example plan.step_deg=1.8".into(),
            });
        };
        check_section::<K>(section.trim(), &origin)?;
        self.text(section.trim(), key.trim(), value.trim(), origin)?;
        Ok(self)
    }

    /// Returns the effective values, after validation of types and ranges.
    ///
    /// # Errors
    /// First value that is of the wrong type or out of range.
    pub fn into_keys(self) -> Result<K, ConfigError> {
        let mut table = toml::Table::new();
        for ((section, name), (value, origin)) in &self.given {
            let key = find_key::<K>(section, name, origin)?;
            let value = validate(section, name, key, value, origin)?;
            let entries = table.entry(section.clone()).or_insert_with(|| toml::Table::new().into());
            if let (Some(entries), Some(value)) = (entries.as_table_mut(), value) {
                entries.insert(name.clone(), value);
            }
        }
        table.try_into().map_err(|error: toml::de::Error| ConfigError {
            origin: self
                .given
                .into_values()
                .next()
                .map_or_else(|| Origin::Option("defaults".into()), |(_, origin)| origin),
            message: error.message().to_owned(),
            help: format!("`{}` shows every key", K::DOCUMENTED_BY),
        })
    }

    /// Returns the source of a value; `None` if it is the default.
    #[must_use]
    pub fn origin(&self, section: &str, key: &str) -> Option<&Origin> {
        self.given.get(&(section.to_owned(), key.to_owned())).map(|(_, origin)| origin)
    }

    fn text(
        &mut self,
        section: &str,
        name: &str,
        text: &str,
        origin: Origin,
    ) -> Result<(), ConfigError> {
        let key = find_key::<K>(section, name, &origin)?;
        let value = match key.kind {
            ValueKind::Text | ValueKind::Choice(_) => Value::String(text.to_owned()),
            ValueKind::Texts => {
                let parts = text.split(',').map(str::trim).filter(|part| !part.is_empty());
                Value::Array(parts.map(|part| Value::String(part.to_owned())).collect())
            }
            ValueKind::Scalar => toml::from_str::<toml::Table>(&format!("value = {text}"))
                .ok()
                .and_then(|mut table| table.remove("value"))
                .unwrap_or_else(|| Value::String(text.to_owned())),
            // "nan" is a number in TOML; the range check rejects it.
            ValueKind::Number { .. } | ValueKind::Whole { .. } | ValueKind::Switch => {
                toml::from_str::<toml::Table>(&format!("value = {text}"))
                    .ok()
                    .and_then(|mut table| table.remove("value"))
                    .ok_or_else(|| invalid(section, name, key, text, origin.clone()))?
            }
        };
        self.set(section, name, value, origin);
        Ok(())
    }

    fn set(&mut self, section: &str, key: &str, value: Value, origin: Origin) {
        self.given.insert((section.to_owned(), key.to_owned()), (value, origin));
    }
}

fn check_section<K: ConfigForm>(name: &str, origin: &Origin) -> Result<(), ConfigError> {
    if K::sections().iter().any(|known| known.name == name) {
        return Ok(());
    }
    let known: Vec<String> = K::sections().iter().map(|section| section.name.clone()).collect();
    Err(ConfigError {
        origin: origin.clone(),
        message: format!("unknown section [{name}]"),
        help: suggest(name, &known, "sections"),
    })
}

fn find_key<K: ConfigForm>(
    section: &str,
    name: &str,
    origin: &Origin,
) -> Result<&'static Key, ConfigError> {
    let here: Option<&'static Section> = K::sections().iter().find(|known| known.name == section);
    if here.is_some_and(|here| here.free) {
        return Ok(&FREE_KEY);
    }
    here.and_then(|here| here.keys.iter().find(|key| key.name == name)).ok_or_else(|| {
        let elsewhere =
            K::sections().iter().find(|known| known.keys.iter().any(|key| key.name == name));
        let known: Vec<String> =
            here.into_iter().flat_map(|known| &known.keys).map(|key| key.name.clone()).collect();
        ConfigError {
            origin: origin.clone(),
            message: format!("unknown key {name} in [{section}]"),
            help: match elsewhere {
                Some(other) => format!("`{name}` belongs in [{}]", other.name),
                None => suggest(name, &known, "keys"),
            },
        }
    })
}

/// Validates a value; `None` for an empty string where the key is optional.
fn validate(
    section: &str,
    name: &str,
    key: &Key,
    value: &Value,
    origin: &Origin,
) -> Result<Option<Value>, ConfigError> {
    let reject = || Err(invalid(section, name, key, &value.to_string(), origin.clone()));
    match (&key.kind, value) {
        (ValueKind::Number { min, max }, Value::Float(number))
            if (*min..=*max).contains(number) => {}
        (
            ValueKind::Number { min, max } | ValueKind::Whole { min, max },
            Value::Integer(number),
        ) if (*min..=*max).contains(&(*number as f64)) => {}
        (ValueKind::Switch, Value::Boolean(_)) => {}
        (ValueKind::Choice(words), Value::String(word)) if words.contains(word) => {}
        (ValueKind::Choice(words), Value::String(word)) => {
            let error = invalid(section, name, key, &value.to_string(), origin.clone());
            return Err(ConfigError { help: suggest(word, words, "choices"), ..error });
        }
        (ValueKind::Text, Value::String(text)) if text.is_empty() && key.default.is_none() => {
            return Ok(None);
        }
        (ValueKind::Text, Value::String(_)) => {}
        (ValueKind::Scalar, Value::String(_) | Value::Integer(_) | Value::Boolean(_)) => {}
        (ValueKind::Scalar, Value::Float(number)) if number.is_finite() => {}
        (ValueKind::Texts, Value::Array(texts)) if texts.iter().all(Value::is_str) => {}
        _ => return reject(),
    }
    Ok(Some(value.clone()))
}

fn invalid(section: &str, name: &str, key: &Key, value: &str, origin: Origin) -> ConfigError {
    ConfigError {
        origin,
        message: format!("{section}.{name} is {value}"),
        help: format!("expected: {}", key.kind.description()),
    }
}

/// Converts a byte offset to line and column.
fn position(file: &str, text: &str, byte: usize) -> Origin {
    let before = text.get(..byte).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    Origin::File {
        file: file.to_owned(),
        line: before.matches('\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::{super::sections, *};
    use proptest::prelude::*;

    fn read(text: &str) -> Result<Keys, ConfigError> {
        ConfigLayers::new().with_file("s.toml", text)?.into_keys()
    }

    #[test]
    fn later_sources_override() {
        let file = "[plan]\nstep_deg = 3.6\nto_deg = 90\n[device]\nport = \"a\"\n";
        let environment =
            [("SONARD_PLAN_STEP_DEG", "1.8"), ("SONARD_DEVICE_PORT", "b"), ("HOME", "x")];
        let keys = ConfigLayers::<Keys>::new()
            .with_file("s.toml", file)
            .and_then(|l| l.with_environment(environment.map(|(k, v)| (k.into(), v.into()))))
            .and_then(|l| l.with_option("--set", "device.port=c"))
            .and_then(ConfigLayers::into_keys)
            .expect("valid");
        assert_eq!((keys.plan.step_deg, keys.plan.to_deg), (1.8, 90.0));
        assert_eq!(keys.device.port.as_deref(), Some("c"));
    }

    #[test]
    fn errors_have_place_and_help() {
        for (text, place, message, help) in [
            (
                "[plan]\nstep_dge = 1",
                "s.toml:2:1",
                "unknown key step_dge",
                "did you mean `step_deg`?",
            ),
            ("[paln]\n", "s.toml:1:2", "unknown section [paln]", "did you mean `plan`?"),
            ("[plan]\nstep_deg = 0", "s.toml:2:12", "plan.step_deg is 0", "0.01 to 360"),
            ("[plan]\nstep_deg = nan", "s.toml:2:12", "plan.step_deg is nan", "0.01 to 360"),
            ("[plan]\n\n  pings_per_stop = 1.5", "s.toml:3:20", "is 1.5", "Whole number, 1 to 255"),
            (
                "[scanning]\nmode = \"on-requst\"",
                "s.toml:2:8",
                "on-requst",
                "did you mean `on-request`?",
            ),
            ("[log]\ndaily = \"yes\"", "s.toml:2:9", "log.daily is \"yes\"", "true or false"),
            ("[server]\nport = 3", "s.toml:2:1", "unknown key port", "`port` belongs in [device]"),
            ("plan = 3", "s.toml:1:1", "plan is a section", "[plan]"),
            ("[plan]\nstep_deg = ", "s.toml:2:", "", "TOML"),
            ("[plan]\nto_deg = 1\nto_deg = 2", "s.toml:3:1", "duplicate", "TOML"),
        ] {
            let error = read(text).expect_err(text);
            let shown = error.to_string();
            assert!(shown.starts_with(place) && shown.contains(message), "{text:?}: {shown}");
            assert!(error.help.contains(help), "{text:?}: {}", error.help);
        }
        for (option, message) in [
            ("plan.step_deg", "expected SECTION.KEY=VALUE"),
            ("plan.step_deg=fast", "plan.step_deg is fast"),
            ("plan.hosts=1", "unknown key hosts"),
        ] {
            let error = ConfigLayers::<Keys>::new().with_option("--set", option).expect_err(option);
            assert!(error.to_string().contains(message), "{error}");
        }
    }

    #[test]
    fn empty_text_unsets_optional_key() {
        let keys = read("[device]\nport = \"\"\n[server]\nsocket = \"\"\n").expect("reads");
        assert_eq!((keys.device.port, keys.server.socket), (None, String::new()));
    }

    #[test]
    fn list_from_comma_separated_text() {
        let keys = ConfigLayers::<Keys>::new()
            .with_option("--set", "server.hosts=robot, robot.local")
            .and_then(ConfigLayers::into_keys);
        assert_eq!(keys.expect("reads").server.hosts, ["robot", "robot.local"]);
    }

    /// Tokens of a configuration file, valid and invalid.
    fn piece() -> impl Strategy<Value = String> {
        let keys = sections().iter().flat_map(|section| {
            let names = section.keys.iter().map(|key| key.name.clone());
            names.chain([format!("[{}]\n", section.name)])
        });
        let marks = [
            "=", " = ", "\n", "\"", "[", "]", "{", "#", "1", "-0.5", "nan", "true", "\u{e9}",
            "1e999",
        ];
        let words: Vec<String> = keys.chain(marks.map(str::to_owned)).collect();
        prop_oneof![4 => prop::sample::select(words), 1 => "\\PC{0,8}"]
    }

    proptest! {
        /// No text causes a panic, and each error has a position within the text.
        #[test]
        fn errors_lie_within_the_text(pieces in prop::collection::vec(piece(), 0..40)) {
            let text = pieces.concat();
            if let Err(error) = read(&text) {
                let Origin::File { line, column, .. } = error.origin else {
                    return Err(TestCaseError::fail(format!("{error}")));
                };
                let lines = text.split('\n').count();
                prop_assert!((1..=lines).contains(&line), "{error} of {lines} lines");
                let length = text.split('\n').nth(line - 1).map_or(0, |line| line.chars().count());
                prop_assert!((1..=length + 1).contains(&column), "{error}: {length} long");
            }
        }
    }
}

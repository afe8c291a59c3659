//! Sections and keys of a configuration, read from the JSON schema of its type.

use std::sync::LazyLock;

use schemars::{JsonSchema, generate::SchemaSettings};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Map, Value};

use super::keys::Keys;

/// Type of a configuration file. Sections, keys, texts, ranges and defaults are derived from its
/// JSON schema.
pub trait ConfigForm: Default + Serialize + DeserializeOwned + JsonSchema {
    /// Comment at the head of the documented configuration file.
    const HEAD: &'static str;
    /// Command that prints the documented configuration file.
    const DOCUMENTED_BY: &'static str;

    /// Returns all sections in the order of the file, cached after the first call of
    /// [`read_sections`].
    fn sections() -> &'static [Section];
}

impl ConfigForm for Keys {
    const HEAD: &'static str = "\
# Configuration of `sonard run`, with every key and its default. Defaults that depend on how the
# daemon is started are commented out, and so are examples of keys without a default. Environment
# variables (SONARD_PLAN_STEP_DEG=1.8) override this file, and command line options (--set
# plan.step_deg=1.8) override both. `sonard run --check` validates the configuration and prints the
# effective values. `systemctl reload` (SIGHUP) applies changes; those of keys marked (restart) take
# effect at the next start.
";
    const DOCUMENTED_BY: &'static str = "sonard run --print-config";

    fn sections() -> &'static [Section] {
        static SECTIONS: LazyLock<Vec<Section>> = LazyLock::new(read_sections::<Keys>);
        &SECTIONS
    }
}

/// Section of a configuration file.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Name of the section.
    pub name: String,
    /// Description of the section.
    pub about: String,
    /// Keys of the section, in the order of the file.
    pub keys: Vec<Key>,
    /// `true` if the section accepts any key, with a text, number or boolean.
    pub free: bool,
}

/// Schema attribute of defaults that the environment overrides.
const DEFAULT_YIELDS: &str = "x-default-yields";

/// Key of a section.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Name of the key, with its unit.
    pub name: String,
    /// Description of the key.
    pub about: String,
    /// Type and range of values.
    pub kind: ValueKind,
    /// Default value; `None` for an optional key.
    pub default: Option<Value>,
    /// Example value, for keys without a default.
    pub example: Option<Value>,
    /// `true` if the environment of the program (such as systemd's directories) overrides the
    /// default. A documented file must not set such a default.
    pub is_soft_default: bool,
}

/// Type and range of a key's values.
#[derive(Debug, Clone, PartialEq)]
pub enum ValueKind {
    /// Finite number within a range.
    Number {
        /// Minimum of the range, inclusive.
        min: f64,
        /// Maximum of the range, inclusive.
        max: f64,
    },
    /// Integer within a range.
    Whole {
        /// Minimum of the range, inclusive.
        min: f64,
        /// Maximum of the range, inclusive.
        max: f64,
    },
    /// Boolean: `true` or `false`.
    Switch,
    /// Enumeration of fixed strings.
    Choice(Vec<String>),
    /// String of any content.
    Text,
    /// List of strings.
    Texts,
    /// String, number or boolean.
    Scalar,
}

impl ValueKind {
    /// Describes the allowed values in a sentence.
    #[must_use]
    pub fn description(&self) -> String {
        match self {
            Self::Number { min, max } => format!("Number, {min} to {max}."),
            Self::Whole { min, max } => format!("Whole number, {min} to {max}."),
            Self::Switch => "true or false.".into(),
            Self::Choice(words) => format!("One of \"{}\".", words.join("\", \"")),
            Self::Text => "Text.".into(),
            Self::Texts => "List of texts.".into(),
            Self::Scalar => "Text, number, true or false.".into(),
        }
    }

    /// Formats a value as TOML.
    #[must_use]
    pub fn toml(&self, value: &Value) -> String {
        match (self, value.as_f64()) {
            // 20.0 instead of 20 indicates that fractions are allowed.
            (Self::Number { .. }, Some(number)) => format!("{number:?}"),
            _ => value.to_string(),
        }
    }
}

/// Returns the sections of the configuration of `sonard run`.
#[must_use]
pub fn sections() -> &'static [Section] {
    Keys::sections()
}

/// Reads the sections of a configuration type from its schema.
#[must_use]
pub fn read_sections<K: ConfigForm>() -> Vec<Section> {
    let generator = SchemaSettings::default().with(|s| s.inline_subschemas = true);
    let schema = generator.into_generator().into_root_schema_for::<K>().to_value();
    let defaults = serde_json::to_string(&K::default()).unwrap_or_default();
    let section = |(name, of): (&String, &Value)| {
        // A key's name can occur in several sections, so the search begins at the section's name.
        let at = defaults.find(&format!("\"{name}\":{{")).unwrap_or(0);
        let keys = properties(of, defaults.get(at..).unwrap_or_default());
        Section {
            name: name.clone(),
            about: text(of, "description"),
            keys: keys.into_iter().map(|(name, of)| read_key(name, of)).collect(),
            free: of.get("additionalProperties").is_some_and(|more| *more != false),
        }
    };
    properties(&schema, &defaults).into_iter().map(section).collect()
}

/// Returns the properties of an object in the order of declaration, which only the serialized text
/// preserves.
fn properties<'a>(of: &'a Value, serialized: &str) -> Vec<(&'a String, &'a Value)> {
    let map = of.get("properties").and_then(Value::as_object);
    let mut properties: Vec<_> = map.into_iter().flat_map(Map::iter).collect();
    properties.sort_by_key(|(name, _)| serialized.find(&format!("\"{name}\":")));
    properties
}

fn read_key(name: &str, of: &Value) -> Key {
    Key {
        name: name.to_owned(),
        about: text(of, "description"),
        kind: kind(of),
        default: of.get("default").filter(|default| !default.is_null()).cloned(),
        example: of.get("examples").and_then(|examples| examples.get(0)).cloned(),
        is_soft_default: of.get(DEFAULT_YIELDS).is_some_and(|yields| *yields == true),
    }
}

fn kind(of: &Value) -> ValueKind {
    let words = choices(of);
    if !words.is_empty() {
        return ValueKind::Choice(words);
    }
    let bound = |name, otherwise| of.get(name).and_then(Value::as_f64).unwrap_or(otherwise);
    let (min, max) = (bound("minimum", f64::MIN), bound("maximum", f64::MAX));
    let is = |expected: &str| match of.get("type") {
        Some(Value::Array(types)) => types.iter().any(|kind| kind == expected),
        Some(kind) => kind == expected,
        None => false,
    };
    match () {
        () if is("integer") => ValueKind::Whole { min, max },
        () if is("number") => ValueKind::Number { min, max },
        () if is("boolean") => ValueKind::Switch,
        () if is("array") => ValueKind::Texts,
        () => ValueKind::Text,
    }
}

/// Returns the variants of an enumeration schema.
fn choices(of: &Value) -> Vec<String> {
    let listed = of.get("enum").and_then(Value::as_array).into_iter().flatten().collect::<Vec<_>>();
    let described = of.get("oneOf").and_then(Value::as_array).into_iter().flatten();
    let constants = described.filter_map(|variant| variant.get("const"));
    // An optional enumeration is `anyOf` of its variants and null.
    let either = of.get("anyOf").and_then(Value::as_array).into_iter().flatten();
    listed
        .into_iter()
        .chain(constants)
        .filter_map(|word| word.as_str().map(str::to_owned))
        .chain(either.flat_map(choices))
        .collect()
}

/// Returns a string property with line breaks replaced by spaces.
fn text(of: &Value, name: &str) -> String {
    of.get(name).and_then(Value::as_str).unwrap_or_default().replace('\n', " ")
}

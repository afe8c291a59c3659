//! What is known about each key, taken from the schema of the type that holds them.

use std::sync::LazyLock;

use schemars::{JsonSchema, generate::SchemaSettings};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Map, Value};

use super::keys::Keys;

/// A file of sections and keys: its type says what there is, with a doc comment, a range and a
/// default each, and everything else follows from it.
pub trait Form: Default + Serialize + DeserializeOwned + JsonSchema {
    /// What stands above the first section of the file that documents every key.
    const HEAD: &'static str;
    /// What prints that file.
    const DOCUMENTED_BY: &'static str;

    /// Every section, in the order of the file. Read once and kept: see [`read_sections`].
    fn sections() -> &'static [Section];
}

impl Form for Keys {
    const HEAD: &'static str = "\
# Configuration of `sonard run`. Every key is here, with its default; in a comment if that depends
# on how the daemon is started; a key without one stands in a comment with an example. Over the file
# go environment variables (SONARD_PLAN_STEP_DEG=1.8), over those the options of the command line
# (--set plan.step_deg=1.8). `sonard run --check` reads it all and says what is in force. `systemctl
# reload` (SIGHUP) takes changes in; those of keys marked (restart) wait for the next start.
";
    const DOCUMENTED_BY: &'static str = "sonard run --print-config";

    fn sections() -> &'static [Section] {
        static SECTIONS: LazyLock<Vec<Section>> = LazyLock::new(read_sections::<Keys>);
        &SECTIONS
    }
}

/// A section of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Its name.
    pub name: String,
    /// What it is about.
    pub about: String,
    /// Its keys, in the order of the file.
    pub keys: Vec<Key>,
    /// Whether any key may stand in it, with a text, a number or a switch.
    pub free: bool,
}

/// Marks in the schema what [`Key::default_yields`] says.
const DEFAULT_YIELDS: &str = "x-default-yields";

/// A key of a section.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Its name, with the unit.
    pub name: String,
    /// What it means.
    pub about: String,
    /// What may be given.
    pub kind: Kind,
    /// What is in force when nothing is given; `None` if that is nothing.
    pub default: Option<Value>,
    /// What one could give, for keys without a default.
    pub example: Option<Value>,
    /// Whether the default gives way to something about how the program is started: a file that
    /// shows the default must not set it.
    pub default_yields: bool,
}

/// The kind of value of a key.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Any finite number between two.
    Number {
        /// Least.
        min: f64,
        /// Greatest.
        max: f64,
    },
    /// A whole number between two.
    Whole {
        /// Least.
        min: f64,
        /// Greatest.
        max: f64,
    },
    /// `true` or `false`.
    Switch,
    /// One of some words.
    Choice(Vec<String>),
    /// Text.
    Text,
    /// A list of texts.
    Texts,
    /// Text, number or switch.
    Any,
}

impl Kind {
    /// What may be given, as a sentence.
    #[must_use]
    pub fn wanted(&self) -> String {
        match self {
            Self::Number { min, max } => format!("Number, {min} to {max}."),
            Self::Whole { min, max } => format!("Whole number, {min} to {max}."),
            Self::Switch => "true or false.".into(),
            Self::Choice(words) => format!("One of \"{}\".", words.join("\", \"")),
            Self::Text => "Text.".into(),
            Self::Texts => "List of texts.".into(),
            Self::Any => "Text, number, true or false.".into(),
        }
    }

    /// A value of this kind as it stands in the file.
    #[must_use]
    pub fn toml(&self, value: &Value) -> String {
        match (self, value.as_f64()) {
            // 20.0 and not 20: the file shows that fractions are welcome.
            (Self::Number { .. }, Some(number)) => format!("{number:?}"),
            _ => value.to_string(),
        }
    }
}

/// The sections of the configuration of `sonard run`.
#[must_use]
pub fn sections() -> &'static [Section] {
    Keys::sections()
}

/// Reads a form's sections from its schema.
#[must_use]
pub fn read_sections<K: Form>() -> Vec<Section> {
    let generator = SchemaSettings::default().with(|s| s.inline_subschemas = true);
    let schema = generator.into_generator().into_root_schema_for::<K>().to_value();
    let defaults = serde_json::to_string(&K::default()).unwrap_or_default();
    let section = |(name, of): (&String, &Value)| {
        // A key's name may stand in several sections: it is looked for behind the section's.
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

/// The properties of an object in the order of declaration, which only serialized text has kept.
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
        default_yields: of.get(DEFAULT_YIELDS).is_some_and(|yields| *yields == true),
    }
}

fn kind(of: &Value) -> Kind {
    let words = choices(of);
    if !words.is_empty() {
        return Kind::Choice(words);
    }
    let bound = |name, otherwise| of.get(name).and_then(Value::as_f64).unwrap_or(otherwise);
    let (min, max) = (bound("minimum", f64::MIN), bound("maximum", f64::MAX));
    let is = |wanted: &str| match of.get("type") {
        Some(Value::Array(types)) => types.iter().any(|kind| kind == wanted),
        Some(kind) => kind == wanted,
        None => false,
    };
    match () {
        () if is("integer") => Kind::Whole { min, max },
        () if is("number") => Kind::Number { min, max },
        () if is("boolean") => Kind::Switch,
        () if is("array") => Kind::Texts,
        () => Kind::Text,
    }
}

/// The words of an enumeration, with or without a description each.
fn choices(of: &Value) -> Vec<String> {
    let listed = of.get("enum").and_then(Value::as_array).into_iter().flatten().collect::<Vec<_>>();
    let described = of.get("oneOf").and_then(Value::as_array).into_iter().flatten();
    let constants = described.filter_map(|one| one.get("const"));
    // Where it may be left out, it is one of two: the words, or nothing.
    let either = of.get("anyOf").and_then(Value::as_array).into_iter().flatten();
    listed
        .into_iter()
        .chain(constants)
        .filter_map(|word| word.as_str().map(str::to_owned))
        .chain(either.flat_map(choices))
        .collect()
}

/// A text on one line.
fn text(of: &Value, name: &str) -> String {
    of.get(name).and_then(Value::as_str).unwrap_or_default().replace('\n', " ")
}

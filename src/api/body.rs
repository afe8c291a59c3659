//! How strictly what programs send is read.

use serde::{Deserialize, Deserializer, de::Error as _};
use serde_json::Value;

/// The fields of bodies that are lists, of objects.
const LISTS: [&str; 1] = ["steps"];

/// Whether there is a list elsewhere: its values, without names, would be read as the fields of an object.
pub(crate) fn has_list(value: &Value) -> bool {
    match value {
        Value::Array(_) => true,
        Value::Object(fields) => fields.iter().any(|(name, value)| match value {
            Value::Array(values) if LISTS.contains(&name.as_str()) => values.iter().any(has_list),
            _ => has_list(value),
        }),
        _ => false,
    }
}

/// What is read only if nothing in it is unknown, however deep: a key that is left out by mistyping it
/// would silently keep its default.
pub(crate) struct Strict<T>(pub(crate) T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Strict<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut unknown = None;
        let value = serde_ignored::deserialize(deserializer, |path| {
            unknown.get_or_insert_with(|| path.to_string());
        })?;
        match unknown {
            None => Ok(Self(value)),
            Some(name) => Err(D::Error::custom(format!("unknown field `{name}`"))),
        }
    }
}

//! Strict deserialization of request bodies.

use serde::{Deserialize, Deserializer, de::Error as _};
use serde_json::Value;

/// Names of the body fields that hold lists.
const LISTS: [&str; 6] = ["steps", "scans", "sweeps", "azimuths_deg", "ranges_m", "fit"];

/// Returns `true` if a request body contains a list where the API has none.
///
/// serde would read the values of such a list as the fields of an object, in order.
#[must_use]
pub fn has_list(value: &Value) -> bool {
    match value {
        Value::Array(_) => true,
        Value::Object(fields) => fields.iter().any(|(name, value)| match value {
            Value::Array(values) if LISTS.contains(&name.as_str()) => values.iter().any(has_list),
            _ => has_list(value),
        }),
        _ => false,
    }
}

/// Value of a request body without unknown fields at any depth.
///
/// A mistyped key would otherwise silently keep its default.
#[derive(Debug)]
pub struct Strict<T>(pub T);

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

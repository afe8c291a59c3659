//! Fast check of a scene's text: valid JSON without ambiguities for serde.

use std::{collections::HashSet, fmt};

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};

/// Returns `true` if no object has duplicate members and no array is in place of an object; serde's
/// derived code would accept both. Memory is needed only for the member names of the open objects.
///
/// # Errors
/// If the text is not JSON.
pub(super) fn is_unambiguous(text: &str) -> serde_json::Result<bool> {
    let mut json = serde_json::Deserializer::from_str(text);
    let is_plain = ValueKind::Scene.deserialize(&mut json)?;
    json.end()?;
    Ok(is_plain)
}

/// Expected kind of a JSON value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ValueKind {
    Scene,
    /// A list of objects.
    Objects,
    /// An object of objects.
    Named,
    Object,
    Robot,
    Any,
}

impl ValueKind {
    fn for_member(self, name: &str) -> Self {
        match (self, name) {
            (Self::Scene, "walls" | "cylinders") => Self::Objects,
            (Self::Scene, "materials" | "poses") => Self::Named,
            (Self::Scene, "robot") => Self::Robot,
            (Self::Named, _) | (Self::Robot, "circle") => Self::Object,
            _ => Self::Any,
        }
    }
}

impl<'de> DeserializeSeed<'de> for ValueKind {
    type Value = bool;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<bool, D::Error> {
        json.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for ValueKind {
    type Value = bool;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_bool<E>(self, _: bool) -> Result<bool, E> {
        Ok(true)
    }

    fn visit_i64<E>(self, _: i64) -> Result<bool, E> {
        Ok(true)
    }

    fn visit_u64<E>(self, _: u64) -> Result<bool, E> {
        Ok(true)
    }

    fn visit_f64<E>(self, _: f64) -> Result<bool, E> {
        Ok(true)
    }

    fn visit_str<E>(self, _: &str) -> Result<bool, E> {
        Ok(true)
    }

    fn visit_unit<E>(self) -> Result<bool, E> {
        Ok(true)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<bool, A::Error> {
        let element = if self == Self::Objects { Self::Object } else { Self::Any };
        let mut is_plain = matches!(self, Self::Objects | Self::Any);
        while let Some(is_element_plain) = list.next_element_seed(element)? {
            is_plain &= is_element_plain;
        }
        Ok(is_plain)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<bool, A::Error> {
        let mut names: HashSet<String> = HashSet::new();
        let mut is_plain = true;
        while let Some(name) = object.next_key::<String>()? {
            is_plain &= object.next_value_seed(self.for_member(&name))?;
            is_plain &= names.insert(name);
        }
        Ok(is_plain)
    }
}

//! What a plan changed since the collection began.

use serde_json::Value;

use super::{CollectionKeys, History, Plan, Poses, numbers_of};

/// Keys that do not matter for what is collected.
const FREE: [&str; 3] = ["collection.folder", "collection.patience_s", "device.port"];

/// What differs from the plan the journal knows, one line each; nothing if it is the same.
pub(super) fn since(history: &History, now: &Plan, sensor_sha256: &str) -> Vec<String> {
    let Some(before) = history.plans.last() else { return Vec::new() };
    let keys = serde_json::to_value(&now.keys).unwrap_or_default();
    let mut changes = Vec::new();
    // What an earlier version did not know yet was as it is by default.
    let mut then = serde_json::to_value(CollectionKeys::default()).unwrap_or_default();
    merge(&mut then, &before.keys);
    compare("", &then, &keys, &mut changes);
    if before.scene.sha256 != now.scene.sha256 {
        changes.push(format!("the scene {} is not the one it was", now.scene.name));
    }
    if before.sensor_sha256 != sensor_sha256 {
        changes.push(format!("the data of the sensor {} is not what it was", now.sensor.name));
    }
    if let (Poses::Listed(listed), Some(known)) = (&now.poses, &before.poses)
        && changes.is_empty()
        && numbers_of(listed, &history.poses) != known.iter().map(|n| Some(*n)).collect::<Vec<_>>()
    {
        changes.push("the poses in the file are not those they were".into());
    }
    changes
}

/// Puts values over others, deep.
fn merge(under: &mut Value, over: &Value) {
    match (under, over) {
        (Value::Object(under), Value::Object(over)) => {
            for (key, over) in over {
                merge(under.entry(key.clone()).or_insert(Value::Null), over);
            }
        }
        (under, over) => *under = over.clone(),
    }
}

fn compare(at: &str, before: &Value, now: &Value, changes: &mut Vec<String>) {
    let nothing = serde_json::Map::new();
    match (before.as_object(), now.as_object()) {
        (None, None) if before != now => {
            let shown =
                |value: &Value| if value.is_null() { "not set".into() } else { value.to_string() };
            changes.push(format!("{at} was {} and is {}", shown(before), shown(now)));
        }
        (None, None) => {}
        (before, now) => {
            let (before, now) = (before.unwrap_or(&nothing), now.unwrap_or(&nothing));
            let added = now.keys().filter(|key| !before.contains_key(*key));
            for key in before.keys().chain(added) {
                let place = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
                if !FREE.contains(&place.as_str()) {
                    let of = |map: &serde_json::Map<String, Value>| map.get(key).cloned();
                    let (was, is) = (of(before).unwrap_or_default(), of(now).unwrap_or_default());
                    compare(&place, &was, &is, changes);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_key_that_matters_is_named_with_both_values() {
        let before = json!({
            "collection": {"repeats": 3, "folder": "a"},
            "device": {"port": null, "serial": "x"},
            "conditions": {"door": "open"},
        });
        let now = json!({
            "collection": {"repeats": 5, "folder": "b"},
            "device": {"port": "/dev/x", "serial": "x"},
            "conditions": {"carpet": true},
        });
        let mut changes = Vec::new();
        compare("", &before, &now, &mut changes);
        assert_eq!(
            changes,
            [
                "collection.repeats was 3 and is 5",
                "conditions.door was \"open\" and is not set",
                "conditions.carpet was not set and is true",
            ]
        );
        compare("", &now, &now, &mut changes);
        assert_eq!(changes.len(), 3);
    }

    #[test]
    fn values_are_put_over_others_key_by_key() {
        let mut values = json!({"sensor": {"lossless": false, "engine": "paths"}, "poses": {}});
        merge(&mut values, &json!({"sensor": {"engine": "fan"}, "conditions": {"door": "open"}}));
        let expected = json!({
            "sensor": {"lossless": false, "engine": "fan"},
            "poses": {}, "conditions": {"door": "open"},
        });
        assert_eq!(values, expected);
    }
}

//! Differences between the current plan and the plan in the journal.

use serde_json::Value;

use super::{CollectionHistory, CollectionKeys, CollectionPlan, Poses, find_numbers};

/// Keys that do not affect the collected scans.
const IGNORED_KEYS: [&str; 3] = ["collection.folder", "collection.retry_limit_s", "device.port"];

/// Lists the differences from the journal's last plan, one message each.
pub(super) fn plan_changes(
    history: &CollectionHistory,
    now: &CollectionPlan,
    sensor_sha256: &str,
) -> Vec<String> {
    let Some(before) = history.plans.last() else { return Vec::new() };
    let keys = serde_json::to_value(&now.keys).unwrap_or_default();
    let mut changes = Vec::new();
    // Keys added by a later version had their default value.
    let mut old_keys = serde_json::to_value(CollectionKeys::default()).unwrap_or_default();
    merge(&mut old_keys, &before.keys);
    compare("", &old_keys, &keys, &mut changes);
    if before.scene.sha256 != now.scene.sha256 {
        changes.push(format!("scene {} changed", now.scene.name));
    }
    if before.sensor_sha256 != sensor_sha256 {
        changes.push(format!("data of sensor {} changed", now.sensor.name));
    }
    if let (Poses::Listed(listed), Some(known)) = (&now.poses, &before.poses)
        && changes.is_empty()
        && find_numbers(listed, &history.poses)
            != known.iter().map(|n| Some(*n)).collect::<Vec<_>>()
    {
        changes.push("poses in the file changed".into());
    }
    changes
}

/// Overrides values recursively.
fn merge(base: &mut Value, overrides: &Value) {
    match (base, overrides) {
        (Value::Object(base), Value::Object(overrides)) => {
            for (key, value) in overrides {
                merge(base.entry(key.clone()).or_insert(Value::Null), value);
            }
        }
        (base, overrides) => *base = overrides.clone(),
    }
}

fn compare(path: &str, before: &Value, now: &Value, changes: &mut Vec<String>) {
    let empty = serde_json::Map::new();
    match (before.as_object(), now.as_object()) {
        (None, None) if before != now => {
            let shown =
                |value: &Value| if value.is_null() { "not set".into() } else { value.to_string() };
            changes.push(format!("{path} changed from {} to {}", shown(before), shown(now)));
        }
        (None, None) => {}
        (before, now) => {
            let (before, now) = (before.unwrap_or(&empty), now.unwrap_or(&empty));
            let added = now.keys().filter(|key| !before.contains_key(*key));
            for key in before.keys().chain(added) {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                if !IGNORED_KEYS.contains(&path.as_str()) {
                    let before = before.get(key).unwrap_or(&Value::Null);
                    let now = now.get(key).unwrap_or(&Value::Null);
                    compare(&path, before, now, changes);
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
    fn lists_changed_keys() {
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
                "collection.repeats changed from 3 to 5",
                "conditions.door changed from \"open\" to not set",
                "conditions.carpet changed from not set to true",
            ]
        );
        compare("", &now, &now, &mut changes);
        assert_eq!(changes.len(), 3);
    }

    #[test]
    fn merges_key_by_key() {
        let mut values = json!({"sensor": {"lossless": false, "engine": "paths"}, "poses": {}});
        merge(&mut values, &json!({"sensor": {"engine": "fan"}, "conditions": {"door": "open"}}));
        let expected = json!({
            "sensor": {"lossless": false, "engine": "fan"},
            "poses": {}, "conditions": {"door": "open"},
        });
        assert_eq!(values, expected);
    }
}

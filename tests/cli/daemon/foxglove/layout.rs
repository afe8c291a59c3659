//! The layout that is shipped names topics and fields that there are.

use std::collections::BTreeMap;

use serde_json::Value;

use super::{start, viewer::Viewer};

const LAYOUT: &str = include_str!("../../../../config/foxglove-layout.json");

/// Fields of a message by name, each with its type, and those of the types that it is made of.
struct Definition<'a> {
    own: BTreeMap<&'a str, &'a str>,
    parts: BTreeMap<&'a str, BTreeMap<&'a str, &'a str>>,
}

fn fields(text: &str) -> BTreeMap<&str, &str> {
    let lines = text.lines().filter(|line| !line.contains('=') && !line.is_empty());
    lines.filter_map(|line| line.split_once(' ')).map(|(kind, name)| (name, kind)).collect()
}

impl<'a> Definition<'a> {
    fn of(schema: &'a str) -> Self {
        let rule = "=".repeat(80);
        let mut parts = schema.split(rule.as_str());
        let own = fields(parts.next().expect("its own"));
        let parts = parts.filter_map(|part| {
            let (name, text) = part.trim_start().strip_prefix("MSG: ")?.split_once('\n')?;
            Some((name, fields(text)))
        });
        Self { own, parts: parts.collect() }
    }

    fn has(&self, path: &[&str]) -> bool {
        let mut fields = &self.own;
        for (place, name) in path.iter().enumerate() {
            let Some(kind) = fields.get(name) else { return false };
            match self.parts.get(kind.trim_end_matches("[]")) {
                Some(part) => fields = part,
                None => return place + 1 == path.len(),
            }
        }
        true
    }
}

/// Every text of the layout that begins like a topic.
fn named<'a>(value: &'a Value, found: &mut Vec<&'a str>) {
    match value {
        Value::String(text) if text.starts_with('/') => found.push(text),
        Value::Array(values) => values.iter().for_each(|value| named(value, found)),
        Value::Object(fields) => {
            found.extend(fields.keys().map(String::as_str).filter(|key| key.starts_with('/')));
            fields.values().for_each(|value| named(value, found));
        }
        _ => {}
    }
}

#[test]
fn topics_and_fields_exist() {
    let layout: Value = serde_json::from_str(LAYOUT).expect("JSON");
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = start(folder.path(), &["--set", "foxglove.map=true"]);
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    let mut viewer = Viewer::new(daemon.connect(), "foxglove.sdk.v1");
    viewer.wait_for_channels();
    let mut found = Vec::new();
    named(&layout, &mut found);
    assert!(found.len() > 7, "{found:?}");
    for path in found {
        let (topic, field) = path.split_once('.').unwrap_or((path, ""));
        let (_, channel) = viewer.channels.get(topic).unwrap_or_else(|| panic!("no topic {topic}"));
        let schema = channel["schema"].as_str().expect("text");
        let fields: Vec<&str> = field.split('.').filter(|name| !name.is_empty()).collect();
        assert!(Definition::of(schema).has(&fields), "{path}: {schema}");
    }
    // Points are coloured by a field of theirs, which the message itself names.
    viewer.subscribe_to_all();
    let reported = viewer.until("/sonar/points");
    let (_, cloud) = reported.of("/sonar/points").next().expect("a cloud");
    let plan = &layout["configById"]["3D!plan"];
    let coloured = plan["topics"].as_object().expect("topics").values();
    let by: Vec<&str> = coloured.filter_map(|topic| topic["colorField"].as_str()).collect();
    assert!(!by.is_empty());
    for name in by {
        let wanted = format!("{name}\0");
        assert!(cloud.windows(wanted.len()).any(|bytes| bytes == wanted.as_bytes()), "{name}");
    }
    // Each panel is in the arrangement once, and the arrangement has no others.
    let mut placed = Vec::new();
    panels(&layout["layout"], &mut placed);
    placed.sort_unstable();
    let panels: Vec<&str> =
        layout["configById"].as_object().expect("panels").keys().map(String::as_str).collect();
    assert_eq!(placed, panels);
    daemon.stop();
}

fn panels<'a>(place: &'a Value, found: &mut Vec<&'a str>) {
    match place {
        Value::String(panel) => found.push(panel),
        split => ["first", "second"].iter().for_each(|side| panels(&split[*side], found)),
    }
}

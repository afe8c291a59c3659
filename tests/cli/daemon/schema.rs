//! Validation of values by the part of JSON Schema that the API's document uses.

use serde_json::Value;

/// Returns each mismatch with its place. `document` resolves references.
pub(crate) fn misfits(schema: &Value, document: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    check(schema, document, value, "", &mut found);
    found
}

fn check(schema: &Value, document: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
    if let Some(reference) = schema["$ref"].as_str() {
        let pointer = reference.strip_prefix('#').expect("a reference within the document");
        let target = document.pointer(pointer).unwrap_or_else(|| panic!("no {reference}"));
        check(target, document, value, at, found);
    }
    let known = [
        "$ref",
        "type",
        "properties",
        "required",
        "additionalProperties",
        "items",
        "minItems",
        "maxItems",
        "enum",
        "const",
        "oneOf",
        "anyOf",
        "exclusiveMinimum",
        "minimum",
        "maximum",
        "description",
        "format",
        "title",
        "default",
        "examples",
        "$schema",
        "x-default-yields",
    ];
    for word in schema.as_object().into_iter().flat_map(|schema| schema.keys()) {
        assert!(known.contains(&word.as_str()), "the check does not know {word:?}");
    }
    let mut misfit = |what: String| found.push(format!("{at}: {what}"));
    let types = match &schema["type"] {
        Value::String(one) => vec![one.as_str()],
        Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    if !types.is_empty() && !types.iter().any(|kind| is(value, kind)) {
        misfit(format!("{value} is not {types:?}"));
    }
    if let Some(words) = schema["enum"].as_array()
        && !words.contains(value)
    {
        misfit(format!("{value} is none of {words:?}"));
    }
    if schema.get("const").is_some_and(|constant| constant != value) {
        misfit(format!("{value} is not {}", schema["const"]));
    }
    if let (Some(number), Some(minimum)) = (value.as_f64(), schema["minimum"].as_f64())
        && number < minimum
    {
        misfit(format!("{number} is less than {minimum}"));
    }
    for word in ["oneOf", "anyOf"] {
        let Some(choices) = schema[word].as_array() else { continue };
        let fitting = choices.iter().filter(|one| misfits(one, document, value).is_empty()).count();
        if fitting == 0 || (word == "oneOf" && fitting > 1) {
            found.push(format!("{at}: {value} fits {fitting} of {word}"));
        }
    }
    if let Some(object) = value.as_object() {
        for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if !object.contains_key(name) {
                found.push(format!("{at}: no {name}"));
            }
        }
        for (name, value) in object {
            match schema["properties"].get(name) {
                Some(property) => check(property, document, value, &format!("{at}.{name}"), found),
                None if schema["additionalProperties"] == false => {
                    found.push(format!("{at}: {name} is not in the document"));
                }
                None => {}
            }
        }
    }
    if let Some(values) = value.as_array() {
        let count = values.len() as u64;
        let few = schema["minItems"].as_u64().is_some_and(|least| count < least);
        let many = schema["maxItems"].as_u64().is_some_and(|most| count > most);
        if few || many {
            found.push(format!("{at}: {count} items"));
        }
    }
    if let (Some(items), Some(values)) = (schema.get("items"), value.as_array()) {
        for (index, value) in values.iter().enumerate() {
            check(items, document, value, &format!("{at}[{index}]"), found);
        }
    }
}

fn is(value: &Value, kind: &str) -> bool {
    match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("no type {other}"),
    }
}

#[test]
fn detects_mismatches() {
    let document = serde_json::json!({"a": {"type": "object", "properties": {
        "x": {"type": ["number", "null"]}, "k": {"enum": ["u", "v"]},
        "p": {"type": "array", "minItems": 2, "maxItems": 2}}, "required": ["x"]}});
    let schema = serde_json::json!({"$ref": "#/a"});
    for (value, faults) in [
        (serde_json::json!({"x": 1.5, "k": "u"}), 0),
        (serde_json::json!({"x": null}), 0),
        (serde_json::json!({"k": "w"}), 2),
        (serde_json::json!({"x": "1"}), 1),
        (serde_json::json!(3), 1),
        (serde_json::json!({"x": 1, "p": [0, 0]}), 0),
        (serde_json::json!({"x": 1, "p": [0]}), 1),
        (serde_json::json!({"x": 1, "p": [0, 0, 0]}), 1),
    ] {
        assert_eq!(misfits(&schema, &document, &value).len(), faults, "{value}");
    }
}

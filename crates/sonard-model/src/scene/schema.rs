//! JSON Schema of scene files.

use schemars::Schema;
use serde_json::{Value, json};

use super::file::SceneFile;

/// JSON Schema of scene files, as printed by `sonard scene schema`.
///
/// Covers structure, ranges and combinations of fields. Only
/// [`Scene::from_json`](super::Scene::from_json) checks that materials exist, that names are unique
/// and that walls have a length.
#[must_use]
pub fn json_schema() -> Value {
    schemars::schema_for!(SceneFile).to_value()
}

/// Requires `from` and `to`, or a `polyline` that may be `closed`.
pub(super) fn one_shape_of_wall(schema: &mut Schema) {
    schema.insert(
        "oneOf".to_owned(),
        json!([
            { "required": ["from", "to"], "properties": { "polyline": false, "closed": false } },
            { "required": ["polyline"], "properties": { "from": false, "to": false } },
        ]),
    );
}

/// Requires a `circle` or an `outline`.
pub(super) fn one_shape_of_robot(schema: &mut Schema) {
    schema.insert(
        "oneOf".to_owned(),
        json!([{ "required": ["circle"] }, { "required": ["outline"] }]),
    );
}

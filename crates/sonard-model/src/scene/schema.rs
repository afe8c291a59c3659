//! The JSON Schema of scene files.

use schemars::Schema;
use serde_json::{Value, json};

use super::file::SceneFile;

/// The JSON Schema of scene files, as `sonard scene schema` prints it.
///
/// It states what a schema can: shapes, ranges and which fields go together. That materials
/// exist, that names differ and that walls have a length is checked by
/// [`Scene::from_json`](super::Scene::from_json) alone.
#[must_use]
pub fn json_schema() -> Value {
    schemars::schema_for!(SceneFile).to_value()
}

/// A wall is `from` and `to`, or a `polyline` that may be `closed`.
pub(super) fn one_shape_of_wall(schema: &mut Schema) {
    schema.insert(
        "oneOf".to_owned(),
        json!([
            { "required": ["from", "to"], "properties": { "polyline": false, "closed": false } },
            { "required": ["polyline"], "properties": { "from": false, "to": false } },
        ]),
    );
}

/// A body is a `circle` or an `outline`.
pub(super) fn one_shape_of_robot(schema: &mut Schema) {
    schema.insert(
        "oneOf".to_owned(),
        json!([{ "required": ["circle"] }, { "required": ["outline"] }]),
    );
}

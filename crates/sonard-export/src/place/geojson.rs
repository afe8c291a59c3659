//! GeoJSON (RFC 7946) of a place in its own metres.

use serde_json::{Map, Value, json};
use sonard_interpret::interpret::{Feature, lines::MapLine};

use super::Findings;
use crate::columns::logged_word;

/// How such a file begins.
const HEAD: &str = r#"{"sonard":"#;

/// Whether a file that begins so is GeoJSON of this program.
#[must_use]
pub fn begins_geojson(head: &[u8]) -> bool {
    head.starts_with(HEAD.as_bytes())
}

/// Lines and features as a `FeatureCollection`, a geometry a line of text.
///
/// RFC 7946 knows degrees of longitude and latitude only. A room has none: coordinates are metres in its own
/// frame, which the member `sonard` says. Nothing that the format has would keep GDAL from taking them for degrees.
#[must_use]
pub fn to_geojson(place: &Findings<'_>) -> String {
    let about = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "units": "metres",
        "frame": "local: x and y of the scene, x to the right, y up",
        "time": place.time,
        "provenance": place.provenance.and_then(logged_word),
        "scene": place.scene,
    });
    let lines = place.lines.iter().map(line);
    let all: Vec<_> = lines.chain(place.features.iter().map(feature)).collect();
    let all: Vec<_> = all.iter().map(Value::to_string).collect();
    format!(
        "{HEAD}{about},\"type\":\"FeatureCollection\",\"features\":[\n{}\n]}}\n",
        all.join(",\n")
    )
}

fn line(line: &MapLine) -> Value {
    let ends = line.ends.map(|end| end.to_array());
    json!({
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": ends},
        "properties": {
            "what": "line", "kind": line.kind, "length_m": line.length_m(), "confidence": line.confidence,
            "terminal_first": line.terminal[0], "terminal_last": line.terminal[1],
            "seen_from_x_m": line.seen_from.x, "seen_from_y_m": line.seen_from.y,
        },
    })
}

/// One of which only the direction is known has no geometry.
fn feature(feature: &Feature) -> Value {
    let at = feature.x_m.zip(feature.y_m);
    let geometry = at.map(|(x_m, y_m)| json!({"type": "Point", "coordinates": [x_m, y_m]}));
    let mut properties = Map::new();
    properties.insert("what".to_owned(), "feature".into());
    flatten(&mut properties, "", serde_json::to_value(feature).unwrap_or_default());
    json!({"type": "Feature", "geometry": geometry, "properties": properties})
}

/// Columns of a table, which is what properties are to a map on the screen: `probabilities_plane`, `beams_first`.
fn flatten(properties: &mut Map<String, Value>, name: &str, value: Value) {
    let within =
        |part: &str| if name.is_empty() { part.to_owned() } else { format!("{name}_{part}") };
    match value {
        Value::Object(parts) => {
            for (part, value) in parts {
                flatten(properties, &within(&part), value);
            }
        }
        Value::Array(ends) => {
            for (part, value) in ["first", "last"].into_iter().zip(ends) {
                flatten(properties, &within(part), value);
            }
        }
        value => {
            properties.insert(name.to_owned(), value);
        }
    }
}

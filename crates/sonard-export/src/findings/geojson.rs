//! GeoJSON (RFC 7946) of a place in local metres.

use serde_json::{Map, Value, json};
use sonard_interpret::interpret::{Feature, lines::MapLine};

use super::PlaceFindings;
use crate::columns::serialized_name;

/// Beginning of GeoJSON files by this program.
const HEAD: &str = r#"{"sonard":"#;

/// Returns `true` if `head` is the beginning of GeoJSON by this program.
#[must_use]
pub fn is_geojson(head: &[u8]) -> bool {
    head.starts_with(HEAD.as_bytes())
}

/// Converts lines and features to a `FeatureCollection`, with one geometry per line of text.
///
/// RFC 7946 only defines longitude and latitude in degrees, which a room does not have: coordinates
/// are metres in the local frame, as stated by the member `sonard`. No member of the format keeps
/// GDAL from reading them as degrees.
#[must_use]
pub fn to_geojson(place: &PlaceFindings<'_>) -> String {
    let header = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "units": "metres",
        "frame": "local: x and y of the scene, x to the right, y up",
        "time": place.time,
        "provenance": place.provenance.and_then(serialized_name),
        "scene": place.scene,
    });
    let lines = place.lines.iter().map(line);
    let all: Vec<_> = lines.chain(place.features.iter().map(feature)).collect();
    let all: Vec<_> = all.iter().map(Value::to_string).collect();
    format!(
        "{HEAD}{header},\"type\":\"FeatureCollection\",\"features\":[\n{}\n]}}\n",
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

/// Converts a feature; without a known position its geometry is null.
fn feature(feature: &Feature) -> Value {
    let at = feature.x_m.zip(feature.y_m);
    let geometry = at.map(|(x_m, y_m)| json!({"type": "Point", "coordinates": [x_m, y_m]}));
    let mut properties = Map::new();
    properties.insert("what".to_owned(), "feature".into());
    flatten(&mut properties, "", serde_json::to_value(feature).unwrap_or_default());
    json!({"type": "Feature", "geometry": geometry, "properties": properties})
}

/// Flattens nested values to properties, as shown by map viewers: `probabilities_plane`,
/// `beams_first`.
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

use std::collections::BTreeMap;

use byteorder::LittleEndian;
use serde::Deserialize;
use serde_json::Value;
use sonard_interpret::interpret::{
    Extents, Feature, InterpretSettings, Sweep,
    grid::{Grid, GridShape},
    interpret,
    lines::{LineKind, MapLine},
};
use sonard_model::geometry::DVec2;
use sonard_records::Provenance;

use crate::{
    PlaceFindings, is_geojson,
    ros::interface::{MARKERS, OCCUPANCY_GRID},
    to_geojson, write_findings,
};

use super::scans::{Full, simulated};

fn lines() -> Vec<MapLine> {
    let line = |kind, ends: [[f64; 2]; 2]| MapLine {
        ends: ends.map(DVec2::from),
        terminal: [true, false],
        kind,
        confidence: 0.75,
        seen_from: DVec2::new(0.5, 0.25),
    };
    vec![
        line(LineKind::Sonar, [[0.0, 0.0], [2.0, 0.0]]),
        line(LineKind::Laser, [[2.0, 0.0], [2.0, 1.5]]),
    ]
}

/// Features of a simulated scan.
fn features() -> Vec<Feature> {
    let scans = simulated();
    let session = scans[0].session.as_deref().expect("it has one");
    let extents = Extents::from_session(session).expect("good");
    let sweeps: Vec<_> =
        scans.iter().map(|scan| (scan.scan, Sweep::from_scan(scan).expect("good"))).collect();
    let features = interpret(&sweeps, &extents, &InterpretSettings::default());
    assert!(!features.is_empty());
    features
}

fn grid() -> Grid {
    let shape = GridShape::covering(DVec2::new(-1.0, 2.0), DVec2::new(-0.8, 2.1), 0.05);
    Grid::from_probabilities(shape.expect("good"), &[0.1, 0.9, 0.5, 0.26, 0.999])
}

const fn place<'a>(
    grid: Option<&'a Grid>,
    lines: &'a [MapLine],
    features: &'a [Feature],
) -> PlaceFindings<'a> {
    let (provenance, scene) = (Some(Provenance::Simulated), Some("simple-room"));
    PlaceFindings { time: None, provenance, scene, grid, lines, features }
}

#[derive(Debug, Deserialize)]
struct OccupancyGrid {
    _stamp: (i32, u32),
    frame_id: String,
    _map_load_time: (i32, u32),
    resolution: f32,
    width: u32,
    height: u32,
    origin: [f64; 7],
    data: Vec<i8>,
}

#[test]
fn grid_topic_is_transient_local() {
    let grid = grid();
    let mut bytes = Vec::new();
    write_findings(&mut bytes, &place(Some(&grid), &[], &[])).expect("memory takes it");
    let messages: Vec<_> = mcap::MessageStream::new(&bytes).expect("a recording").collect();
    let [Ok(message)] = &messages[..] else { panic!("{messages:?}") };
    assert_eq!(message.channel.topic, "/map");
    let schema = message.channel.schema.as_ref().expect("a schema");
    assert_eq!(&*schema.data, OCCUPANCY_GRID.definition().as_bytes());
    assert!(message.channel.metadata["offered_qos_profiles"].contains("transient_local"));
    let (read, length) =
        cdr_encoding::from_bytes::<OccupancyGrid, LittleEndian>(&message.data[4..]).expect("CDR");
    assert_eq!(length, message.data.len() - 4);
    assert_eq!((read.frame_id.as_str(), read.resolution), ("map", 0.05));
    assert_eq!((read.width, read.height), (4, 2));
    assert_eq!(read.origin, [-1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    // Row by row from the lower left; missing cells and 0.5 are unknown.
    assert_eq!(read.data, [10, 90, -1, 26, 100, -1, -1, -1]);
}

#[test]
fn lines_and_features_are_markers() {
    let (lines, features) = (lines(), features());
    let mut bytes = Vec::new();
    write_findings(&mut bytes, &place(None, &lines, &features)).expect("memory takes it");
    let topics: BTreeMap<_, _> = mcap::MessageStream::new(&bytes)
        .expect("a recording")
        .map(|message| message.expect("a message").channel)
        .map(|channel| (channel.topic.clone(), channel.schema.clone().expect("a schema")))
        .collect();
    assert_eq!(topics.keys().collect::<Vec<_>>(), ["/sonar/features", "/sonar/lines"]);
    for schema in topics.values() {
        assert_eq!(&*schema.data, MARKERS.definition().as_bytes());
    }
}

#[test]
fn geojson_has_lines_and_features() {
    let (lines, mut features) = (lines(), features());
    (features[0].x_m, features[0].y_m) = (None, None);
    let text = to_geojson(&place(None, &lines, &features));
    assert!(is_geojson(text.as_bytes()) && !is_geojson(b"{\"type\":\"FeatureCollection\"}"));
    let read: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(read["type"], "FeatureCollection");
    assert_eq!(read["sonard"]["units"], "metres");
    assert_eq!(read["sonard"]["provenance"], "simulated");
    let found = read["features"].as_array().expect("a list");
    assert_eq!(found.len(), lines.len() + features.len());
    for (read, line) in found.iter().zip(&lines) {
        assert_eq!(read["geometry"]["type"], "LineString");
        let ends: [[f64; 2]; 2] =
            serde_json::from_value(read["geometry"]["coordinates"].clone()).expect("places");
        assert_eq!(ends, line.ends.map(|end| end.to_array()));
        assert_eq!(read["properties"]["length_m"], line.length_m());
        assert_eq!(read["properties"]["terminal_first"], line.terminal[0]);
        assert_eq!(read["properties"]["seen_from_y_m"], line.seen_from.y);
    }
    for (read, feature) in found[lines.len()..].iter().zip(&features) {
        match feature.x_m.zip(feature.y_m) {
            Some((x_m, y_m)) => {
                assert_eq!(read["geometry"]["coordinates"], serde_json::json!([x_m, y_m]));
            }
            None => assert_eq!(read["geometry"], Value::Null),
        }
        assert_eq!(read["properties"]["confidence"], feature.confidence);
        assert_eq!(read["properties"]["what"], "feature");
        assert_eq!(read["properties"]["beams_last"], feature.beams[1]);
        let properties = read["properties"].as_object().expect("an object");
        assert!(properties.values().all(|value| !value.is_object() && !value.is_array()));
    }
}

#[test]
fn reports_full_disk() {
    let grid = grid();
    let written = write_findings(Full(500), &place(Some(&grid), &[], &[]));
    assert!(matches!(written, Err(crate::ExportError::Write(_))), "{written:?}");
}

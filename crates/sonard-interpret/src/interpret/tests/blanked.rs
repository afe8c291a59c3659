//! Walls within the blanking interval, which return no reading but repeated echoes.

use std::sync::Arc;

use super::{features, scan};
use crate::interpret::{FeatureKind, InterpretSettings, Reason};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::{Options, Simulator},
    scene::{Scene, shipped},
};

fn simulator() -> Simulator {
    let text = shipped::text("simple-room").expect("a shipped scene");
    let scene = Arc::new(Scene::from_json(text).expect("a scene"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    Simulator::new(scene, sensor, Air::default(), Options::default()).expect("a model")
}

/// At `fig9` the east wall is 15 cm ahead, and its third echo arrives from 47 cm.
#[test]
fn repeat_of_a_near_wall_is_no_edge() {
    let simulator = simulator();
    let pose = simulator.scene().pose("fig9").expect("a pose");
    let found = features(&[scan(&simulator, 1, &pose)], &InterpretSettings::default());
    let ahead = found.iter().find(|feature| feature.bearing_deg == 0.0).expect("an arc ahead");
    assert!(ahead.range_m.is_some_and(|range_m| (range_m - 0.469).abs() < 1e-3), "{ahead:?}");
    assert_eq!(ahead.reason, Some(Reason::Reflections), "{ahead:?}");
    assert!(ahead.confidence < 0.5, "{ahead:?}");
}

/// A rectangular room without furniture has no edges.
#[test]
fn empty_room_has_no_edges() {
    let simulator = simulator();
    for (column, row) in (0..5).flat_map(|column| (0..4).map(move |row| (column, row))) {
        let (x_m, y_m) = (0.09 + 0.18 * f64::from(column), 0.09 + 0.18 * f64::from(row));
        let pose = Pose { x_m, y_m, heading_deg: 17.0 * f64::from(column) };
        let found = features(&[scan(&simulator, 1, &pose)], &InterpretSettings::default());
        let edges: Vec<_> =
            found.iter().filter(|feature| feature.kind == FeatureKind::Edge).collect();
        assert!(edges.is_empty(), "({x_m}, {y_m}): {edges:?}");
    }
}

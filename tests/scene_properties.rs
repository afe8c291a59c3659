//! Scene files from any text: no panic, errors that point into the text, and what is accepted
//! keeps the rules.

use proptest::{prelude::*, sample::Index};
use serde_json::{Value, json};
use sonard::{
    geometry::Pose,
    scene::{Scene, shipped},
};

/// Properties of every text.
fn check(text: &str) -> Result<(), TestCaseError> {
    match Scene::from_json(text) {
        Ok(scene) => keeps_the_rules(&scene),
        Err(error) => {
            prop_assert!(text.get(error.span.clone()).is_some(), "{error} points outside");
            prop_assert!(!error.message().is_empty() && !error.help().is_empty(), "{error:?}");
            let line = text.split('\n').nth(error.line - 1);
            prop_assert!(line.is_some(), "{error}: no such line");
            let columns = line.unwrap_or_default().chars().count() + 1;
            prop_assert!((1..=columns).contains(&error.column), "{error}: no such column");
            Ok(())
        }
    }
}

fn keeps_the_rules(scene: &Scene) -> Result<(), TestCaseError> {
    let mut ids: Vec<&str> = scene.walls.iter().map(|wall| &*wall.id).collect();
    ids.extend(scene.cylinders.iter().map(|cylinder| &*cylinder.id));
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    prop_assert_eq!(ids.len(), count, "an id twice");
    for wall in &scene.walls {
        prop_assert!(wall.a.is_finite() && wall.b.is_finite(), "{wall:?}");
        prop_assert!(wall.a.distance(wall.b) >= 1e-4, "{wall:?}");
        prop_assert!((0.0..=1.0).contains(&wall.material.reflectance), "{wall:?}");
    }
    for pose in scene.poses.values() {
        prop_assert_eq!(scene.check_pose(pose), Ok(()));
        let with_robot = scene.with_robot_at(pose);
        let with_robot_count = with_robot.walls.len() + with_robot.cylinders.len();
        prop_assert_eq!(with_robot_count > count, scene.robot.is_some());
    }
    Ok(())
}

fn scene_text() -> impl Strategy<Value = &'static str> {
    any::<Index>().prop_map(|index| shipped::SCENES[index.index(shipped::SCENES.len())].1)
}

/// Pieces that mean something in JSON or in a scene, or nearly.
const PIECES: &[&str] = &[
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "\"",
    "\\",
    "\\u0000",
    "\\ud800",
    "null",
    "true",
    "-",
    "1e999",
    "1e308",
    "-0",
    "NaN",
    "//",
    "/*",
    "\u{feff}",
    "\r\n",
    "\u{e9}",
    "'",
    "0x1",
    "\"walls\":",
    "\"polyline\":",
    "\"robot\":",
    "\"closed\":true,",
    "\"circle\":",
];

fn piece() -> impl Strategy<Value = String> {
    prop_oneof![
        prop::sample::select(PIECES).prop_map(str::to_owned),
        any::<f64>().prop_map(|number| number.to_string()),
        any::<String>(),
    ]
}

/// A value to put in the place of another.
fn value() -> impl Strategy<Value = Value> {
    prop_oneof![
        any::<f64>().prop_map(|number| json!(number)),
        (-5.0..5.0).prop_map(|number: f64| json!(number)),
        any::<i64>().prop_map(|number| json!(number)),
        "[a-z.,]{0,3}".prop_map(|text| json!(text)),
        prop::collection::vec(point(2.0), 0..6).prop_map(|points| json!(points)),
        (point(0.5), 0.0..0.3)
            .prop_map(|(center, radius_m)| json!({"center": center, "radius_m": radius_m})),
        prop::sample::select(vec![Value::Null, json!(true), json!([]), json!({})]),
    ]
}

fn point(reach: f64) -> impl Strategy<Value = [f64; 2]> {
    [-reach..reach, -reach..reach]
}

/// Puts `new` in the place that comes `target`th when counted depth first.
fn replace(document: &mut Value, target: &mut usize, new: &Value) {
    if *target == 0 {
        *document = new.clone();
    }
    *target = target.wrapping_sub(1);
    match document {
        Value::Array(elements) => elements.iter_mut().for_each(|e| replace(e, target, new)),
        Value::Object(members) => members.values_mut().for_each(|m| replace(m, target, new)),
        _ => {}
    }
}

fn places(document: &Value) -> usize {
    1 + match document {
        Value::Array(elements) => elements.iter().map(places).sum(),
        Value::Object(members) => members.values().map(places).sum(),
        _ => 0,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        check(&String::from_utf8_lossy(&bytes))?;
    }

    #[test]
    fn pieces_in_any_order(pieces in prop::collection::vec(piece(), 0..60)) {
        check(&pieces.concat())?;
    }

    #[test]
    fn scenes_with_bytes_cut_out_and_put_in(
        text in scene_text(), from in any::<Index>(), cut in 0_usize..40, new in piece(),
    ) {
        let bytes = text.as_bytes();
        let from = from.index(bytes.len());
        let to = (from + cut).min(bytes.len());
        let changed = [&bytes[..from], new.as_bytes(), &bytes[to..]].concat();
        check(&String::from_utf8_lossy(&changed))?;
    }

    #[test]
    fn scenes_cut_off(text in scene_text(), end in any::<Index>()) {
        let end = end.index(text.len());
        let cut = String::from_utf8_lossy(&text.as_bytes()[..end]).into_owned();
        check(&cut)?;
        prop_assert!(Scene::from_json(&cut).is_err() || text[end..].trim().is_empty());
    }

    #[test]
    fn scenes_with_values_exchanged(
        text in scene_text(), changes in prop::collection::vec((any::<Index>(), value()), 1..4),
    ) {
        let mut document: Value = serde_json::from_str(text).expect("a shipped scene");
        for (place, new) in changes {
            let mut target = place.index(places(&document));
            replace(&mut document, &mut target, &new);
        }
        check(&document.to_string())?;
    }

    #[test]
    fn a_robot_of_any_shape(corners in prop::collection::vec(point(0.3), 3..8)) {
        let room = shipped::text("two-surface-room").expect("a shipped scene");
        let mut document: Value = serde_json::from_str(room).expect("JSON");
        document["robot"] = json!({"id": "body", "outline": corners, "material": "plaster"});
        check(&document.to_string())?;
    }

    #[test]
    fn pose_specs(spec in prop_oneof![any::<String>(), "[-+.0-9eE, naif]{0,20}"]) {
        let scene = Scene::from_json(shipped::SCENES[0].1).expect("a shipped scene");
        match scene.pose(&spec) {
            Ok(pose) => prop_assert!(pose.x_m.is_finite() && pose.heading_deg.abs() <= 360.0),
            Err(error) => prop_assert!(!error.help().is_empty()),
        }
    }

    #[test]
    fn poses_of_any_numbers(text in scene_text(), x_m: f64, y_m: f64, heading_deg: f64) {
        let scene = Scene::from_json(text).expect("a shipped scene");
        if let Err(error) = scene.check_pose(&Pose { x_m, y_m, heading_deg }) {
            prop_assert!(!error.help().is_empty());
        } else {
            prop_assert!(x_m.is_finite() && y_m.is_finite() && heading_deg.abs() <= 360.0);
        }
    }
}

//! Scene files from any bytes: no panic, and what is accepted keeps the rules.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sonard::scene::Scene;

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match Scene::from_json(text) {
        Ok(scene) => {
            assert!(scene.walls.iter().all(|wall| wall.a.distance(wall.b) >= 1e-4));
            for pose in scene.poses.values() {
                assert_eq!(scene.check_pose(pose), Ok(()));
                let _ = scene.with_robot_at(pose);
            }
        }
        Err(error) => {
            assert!(text.get(error.span.clone()).is_some(), "{error}");
            assert!(!error.help().is_empty(), "{error}");
        }
    }
    if let Ok(scene) = Scene::from_json(r#"{"name":"e","materials":{}}"#) {
        let _ = scene.pose(text).and_then(|pose| scene.check_pose(&pose));
    }
});

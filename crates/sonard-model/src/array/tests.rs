//! Arrays and courses: data, and positions of their rangers.

use super::*;
use crate::scene::shipped;

fn preset(name: &str) -> RangerArray {
    RangerArray::preset(name).expect(name)
}

fn scene(name: &str) -> Scene {
    Scene::from_json(shipped::text(name).expect("shipped")).expect("a scene")
}

#[test]
fn presets_name_their_sources() {
    for name in RangerArray::preset_names() {
        let array = preset(name);
        assert_eq!(array.name, name);
        for figure in ["sensor", "interval_ms", "rangers"] {
            assert!(array.sources.get(figure).is_some_and(|s| s.len() > 20), "{name}: {figure}");
        }
        assert!(crate::acoustics::Sensor::preset(&array.sensor).is_ok(), "{name}");
        let text = serde_json::to_string(&array).expect("JSON");
        assert_eq!(RangerArray::from_json(&text), Ok(array));
    }
}

#[test]
fn bearings_match_the_papers() {
    let bearings = |name| -> Vec<f64> {
        preset(name).rangers.iter().map(|ranger| ranger.bearing_deg).collect()
    };
    assert_eq!(bearings("pioneer-8"), [90.0, 50.0, 30.0, 10.0, -10.0, -30.0, -50.0, -90.0]);
    assert_eq!(bearings("pioneer-7"), [90.0, 30.0, 15.0, 0.0, -15.0, -30.0, -90.0]);
    // Every ranger of the ring of twelve points radially outwards.
    for (at, ranger) in preset("ring-12").rangers.iter().enumerate() {
        assert_eq!(ranger.azimuth_deg(), 30.0 * at as f64);
        let out = DVec2::new(ranger.x_m, ranger.y_m);
        let off = out - 0.16 * DVec2::from_angle(ranger.bearing_deg.to_radians());
        assert!(off.length() < 1e-4, "{ranger:?}");
    }
}

#[test]
fn rangers_move_with_the_robot() {
    let array = preset("pioneer-8");
    let robot = Pose { x_m: 2.0, y_m: 1.0, heading_deg: 90.0 };
    // s3 is 166 mm ahead and 27 mm to the left; the robot points along +y.
    let s3 = array.ranger("s3").expect("there").world_pose(&robot);
    assert!((s3.position() - DVec2::new(2.0 - 0.027, 1.166)).length() < 1e-12, "{s3:?}");
    assert_eq!(s3.heading_deg, 100.0);
}

#[test]
fn firing_order_defaults_to_all() {
    let mut array = preset("pioneer-7");
    assert_eq!(array.round().collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 6]);
    assert_eq!((array.plan(1).beams(), array.plan(3).beams()), (7, 21));
    array.firing_order = ["s3", "s2", "s3"].map(FiringSlot::from).into();
    assert_eq!(array.check(), Ok(()));
    assert_eq!(array.round().collect::<Vec<_>>(), [3, 2, 3]);
    for rounds in 1..=200 {
        for name in RangerArray::preset_names() {
            let plan = preset(name).plan(rounds);
            assert_eq!(plan.check(), Ok(()));
            assert_eq!(plan.beams() as usize, preset(name).rangers.len() * rounds as usize);
        }
    }
}

#[test]
fn rejects_invalid_data() {
    let text = PRESETS[0].1;
    for (wrong, part) in [
        (text.replace("\"s5\"", "\"s2\""), "rangers[5].id is \"s2\", the id of rangers[2]"),
        (text.replace("\"s5\"", "\"\""), "rangers[5].id is empty"),
        (text.replace("0.148", "148"), "rangers[2].x_m is 148: it must be from -10 to 10"),
        (text.replace("-50.0", "1e999"), "line 13"),
        (text.replace("-50.0", "-500.0"), "rangers[6].bearing_deg is -500"),
        (text.replace("bearing_deg", "bearing"), "line 7, column"),
        (text.replace("40.0", "0"), "interval_ms is 0"),
        (text.replace("\"rangers\": [", "\"firing_order\": [\"s9\"], \"rangers\": ["), "s9"),
        (format!("{text} x"), "end of file"),
    ] {
        let error = RangerArray::from_json(&wrong).expect_err(part);
        assert!(error.to_string().contains(part), "{error} lacks {part}");
        assert!(!error.help().is_empty());
    }
    let mut array = preset("ring-12");
    array.rangers[3].y_m = f64::NAN;
    assert!(matches!(array.check(), Err(ArrayError::OutOfRange { .. })), "NaN");
    array.rangers.clear();
    assert!(matches!(array.check(), Err(ArrayError::Count { field: "rangers", .. })));
    let unknown = RangerArray::preset("pioner-8").expect_err("no such preset");
    assert!(unknown.help().starts_with("did you mean `pioneer-8`?"), "{}", unknown.help());
}

#[test]
fn pose_error_names_the_ranger() {
    let (array, room) = (preset("pioneer-8"), scene("simple-room"));
    let at = |x_m, y_m, heading_deg| Pose { x_m, y_m, heading_deg };
    assert_eq!(array.check_pose(&room, &at(0.4, 0.37, 0.0)), Ok(()));
    // The robot's position is in the room, 0.928 m wide, but its foremost sonars are not.
    let error = array.check_pose(&room, &at(0.8, 0.37, 0.0)).expect_err("beyond the wall");
    assert_eq!(error.ranger.as_deref(), Some("s2"));
    assert!(matches!(error.error, crate::scene::PoseError::OutsideRoom { .. }), "{error}");
    let error = array.check_pose(&room, &at(0.762, 0.37, 0.0)).expect_err("on the wall");
    assert_eq!(error.ranger.as_deref(), Some("s3"));
    assert!(error.to_string().starts_with("ranger s3 of the array: "), "{error}");
    // Screen between the robot's middle and its foremost sonars.
    let text = r#"{"name":"screen","materials":{"m":{"reflectance":1.0}},
        "walls":[{"id":"screen","from":[0.12,-1],"to":[0.12,1],"material":"m"}]}"#;
    let screen = Scene::from_json(text).expect("a scene");
    let error = array.check_pose(&screen, &at(0.0, 0.0, 0.0)).expect_err("through the screen");
    assert_eq!(error.ranger.as_deref(), Some("s2"));
    assert!(error.to_string().contains("separated from the robot by `screen`"), "{error}");
    assert_eq!(array.check_pose(&screen, &at(-0.1, 0.0, 0.0)), Ok(()));
    assert_eq!(array.check_pose(&room, &at(2.0, 0.3, 0.0)).expect_err("outside").ranger, None);
    let nan = array.check_pose(&room, &at(f64::NAN, 0.3, 0.0));
    assert!(nan.is_err());
    // The body must not cover its rangers, and must fit itself.
    let mut ring = preset("ring-12");
    assert_eq!(ring.check_pose(&room, &at(0.4, 0.37, 0.0)), Ok(()));
    ring.rangers[5].x_m = -0.05;
    let error = ring.check_pose(&room, &at(0.4, 0.37, 0.0)).expect_err("inside the body");
    assert!(error.to_string().contains("inside `b12`"), "{error}");
    assert_eq!(error.ranger.as_deref(), Some("s5"));
    let error = preset("ring-12").check_pose(&room, &at(0.4, 0.14, 0.0)).expect_err("no room");
    assert!(error.to_string().contains("`b12` collides with `south`"), "{error}");
}

#[test]
fn course_interpolates_poses() {
    let text = "{\"x_m\":0,\"y_m\":0}\n\n{\"x_m\":1,\"y_m\":0,\"heading_deg\":350}\n";
    let course = RobotCourse::from_json_lines(text).expect("two poses").with_times(0.5);
    assert_eq!((course.poses().len(), course.duration_s()), (2, 2.0));
    let half = course.pose_at(1.0);
    assert_eq!((half.x_m, half.y_m), (0.5, 0.0));
    assert!((half.heading_deg - 355.0).abs() < 1e-9, "smaller angle: {half:?}");
    assert_eq!(course.pose_at(-1.0), course.poses()[0]);
    assert_eq!(course.pose_at(0.0), course.poses()[0]);
    assert_eq!(course.pose_at(2.0), course.poses()[1]);
    assert_eq!(course.pose_at(99.0), course.poses()[1]);
    let timed = "{\"time_s\":5,\"x_m\":0,\"y_m\":0}\n{\"time_s\":9,\"x_m\":1,\"y_m\":0}";
    let timed = RobotCourse::from_json_lines(timed).expect("times").with_times(123.0);
    assert_eq!((timed.duration_s(), timed.pose_at(1.0).x_m), (4.0, 0.25));
    let turning = "{\"x_m\":0,\"y_m\":0}\n{\"x_m\":0,\"y_m\":0,\"heading_deg\":90}";
    let turning = RobotCourse::from_json_lines(turning).expect("a turn").with_times(0.5);
    assert!((turning.duration_s() - 1.5).abs() < 1e-12, "60 degrees per second");
}

#[test]
fn rejects_invalid_courses() {
    for (text, line, part) in [
        ("", 1, "no pose"),
        ("{\"x_m\":0,\"y_m\":0}\n{\"x_m\":0}", 2, "y_m"),
        ("{\"x_m\":0,\"y_m\":0}\n0,0,0", 2, "\"x_m\": 1.0"),
        ("{\"x_m\":0,\"y_m\":0}\n{\"time_s\":1,\"x_m\":0,\"y_m\":0}", 2, "every line"),
        ("{\"time_s\":1,\"x_m\":0,\"y_m\":0}\n{\"x_m\":0,\"y_m\":0}", 2, "every line"),
        (
            "{\"time_s\":1,\"x_m\":0,\"y_m\":0}\n{\"time_s\":1,\"x_m\":0,\"y_m\":0}",
            2,
            "not after the previous one, 1",
        ),
        ("{\"x_m\":1e999,\"y_m\":0}", 1, "number"),
    ] {
        let error = RobotCourse::from_json_lines(text).expect_err(part);
        assert_eq!(error.line, line, "{error}");
        assert!(error.message.contains(part), "{error} lacks {part}");
    }
}

#[test]
fn course_from_poses_and_lines() {
    let at = |x_m, heading_deg| Pose { x_m, y_m: 0.0, heading_deg };
    let poses = [at(0.0, 0.0), at(1.0, 350.0)];
    let text = "{\"time_s\":5,\"x_m\":0,\"y_m\":0}\n{\"time_s\":9,\"x_m\":1,\"y_m\":0,\"heading_deg\":350}";
    let course = RobotCourse::new(&poses, Some(&[5.0, 9.0])).expect("two poses");
    assert_eq!(course, RobotCourse::from_json_lines(text).expect("two lines"));
    assert_eq!(course.with_times(1.0).times_s(), [0.0, 4.0]);
    assert_eq!(
        RobotCourse::new(&poses, None).expect("two poses").with_times(0.5).times_s(),
        [0.0, 2.0]
    );
    for (poses, times_s, line, part) in [
        (&poses[..0], None, 1, "no pose"),
        (&poses[..], Some(&[1.0][..]), 2, "2 poses, but 1 times"),
        (&poses[..], Some(&[1.0, 1.0][..]), 2, "not after the previous one, 1"),
        (&poses[..], Some(&[1.0, f64::NAN][..]), 2, "finite"),
        (&[at(f64::INFINITY, 0.0)][..], None, 1, "finite"),
    ] {
        let error = RobotCourse::new(poses, times_s).expect_err(part);
        assert!(error.line == line && error.message.contains(part), "{error} lacks {part}");
    }
}

#[test]
fn rounds_follow_and_rotate() {
    let mut array = preset("ring-12");
    array.interval_ms = 50.0;
    array.firing_order = vec![
        FiringSlot::Simultaneous(vec!["s0".into(), "s6".into()]),
        FiringSlot::from("s3"),
        FiringSlot::from("s0"),
    ];
    assert_eq!(array.firing_times_s(0), [0.0; 0]);
    let expected = [0.0, 0.0, 0.05, 0.1, 0.15, 0.15, 0.2, 0.25];
    let times_s = array.firing_times_s(2);
    assert_eq!(times_s.len(), expected.len());
    for (found_s, expected_s) in times_s.iter().zip(expected) {
        assert!((found_s - expected_s).abs() < 1e-12, "{times_s:?}");
    }
    let ring = preset("ring-12");
    let from = Pose { x_m: 1.0, y_m: 2.0, heading_deg: -350.0 };
    let turned = ring.rotated_poses(&from, 3);
    assert_eq!(turned[0], from);
    let headings: Vec<f64> = turned.iter().map(|pose| pose.heading_deg.round()).collect();
    assert_eq!(headings, [-350.0, 20.0, 30.0]);
}

#[test]
fn first_failing_pose_is_named() {
    let room = scene("simple-room");
    let at = |x_m, y_m| Pose { x_m, y_m, heading_deg: 0.0 };
    let (array, good) = (preset("pioneer-8"), at(0.4, 0.37));
    assert_eq!(array.check_poses(&room, &[good; 3]), Ok(()));
    let bad = at(0.8, 0.37);
    let (index, error) = array.check_poses(&room, &[good, bad]).expect_err("beyond the wall");
    assert_eq!((index, Err(error)), (1, array.check_pose(&room, &bad)));
}

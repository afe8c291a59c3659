//! Readings of an array's rangers, compared with closed forms and with single rangers.

use std::sync::Arc;

use crate::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    geometry::Pose,
    model::{ArrayModel, Options, PathOptions, Simulator},
    reading::PingStatus,
    scene::Scene,
};

/// A square room with sides of this length, metres.
fn room(side_m: f64) -> Scene {
    let text = format!(
        r#"{{"name":"square","materials":{{"hard":{{"reflectance":1.0}}}},
           "walls":[{{"id":"wall","polyline":[[0,0],[{side_m},0],[{side_m},{side_m}],[0,{side_m}]],
                      "closed":true,"material":"hard"}}]}}"#
    );
    Scene::from_json(&text).expect("a scene")
}

fn model(array: &str, scene: &Scene, options: Options) -> ArrayModel {
    let array = RangerArray::preset(array).expect("a preset");
    let sensor = Sensor::preset(&array.sensor).expect("a preset");
    ArrayModel::new(Arc::new(array), scene, &sensor, Air::default(), options)
        .expect("right options")
}

/// Of a ring in the middle of a square room, the four rangers that face a wall read half the room
/// less the ring's radius.
#[test]
fn ring_reads_from_its_radius() {
    let options = PathOptions { ideal_receiver: true, ..PathOptions::default() }.into();
    let model = model("ring-12", &room(4.0), options);
    for heading_deg in [0.0, 90.0, 180.0] {
        let placed = model.at(Pose { x_m: 2.0, y_m: 2.0, heading_deg }).expect("a pose");
        for ranger in [0, 3, 6, 9] {
            let range_m = placed.ping(ranger).expect("few paths").range_m.expect("a wall ahead");
            assert!((range_m - (2.0 - 0.16)).abs() < 1e-3, "{ranger}: {range_m}");
        }
        // At 30 degrees a mirror reflects the sound away: not the wall's own distance.
        let oblique = placed.ping(1).expect("few paths");
        assert_ne!(oblique.arrival.map(|arrival| arrival.path.order()), Some(1));
    }
}

#[test]
fn rangers_equal_single_rangers() {
    let (scene, options) = (room(3.0), Options::default());
    let model = model("pioneer-8", &scene, options);
    let sensor = Sensor::preset("pioneer").expect("a preset");
    let options = *model.simulator().options();
    let single = Simulator::new(Arc::new(scene), sensor, Air::default(), options).expect("right");
    let robot = Pose { x_m: 1.1, y_m: 1.7, heading_deg: 37.0 };
    let placed = model.at(robot).expect("a pose");
    for (at, ranger) in model.array().rangers.iter().enumerate() {
        let pose = ranger.world_pose(&robot);
        let alone = single.at(pose.position()).ping(pose.direction_rad(0.0)).expect("few paths");
        assert_eq!(placed.ping(at).expect("few paths"), alone, "{}", ranger.id);
    }
}

#[test]
fn range_is_limited_by_interval() {
    let model =
        model("pioneer-8", &room(30.0), Options { max_range_m: Some(50.0), ..Options::default() });
    // 40 ms there and back.
    let max_range_m = model.simulator().receiver().max_range_m;
    assert!(
        (max_range_m - 0.5 * 0.04 * Air::default().sound_speed_m_s()).abs() < 1e-9,
        "{max_range_m}"
    );
    let placed = model.at(Pose { x_m: 15.0, y_m: 15.0, heading_deg: 0.0 }).expect("a pose");
    assert!(
        (0..8).all(|ranger| placed.ping(ranger).expect("few paths").status == PingStatus::NoEcho)
    );
}

/// The body of the ring of twelve blocks sound that returns by way of a wall behind the robot, and
/// turns and moves with the robot.
#[test]
fn body_moves_and_blocks() {
    let with = model("ring-12", &room(3.0), Options::default());
    for (x_m, heading_deg) in [(1.0, 0.0), (1.5, 90.0), (1.7, 200.0)] {
        let robot = Pose { x_m, y_m: 1.5, heading_deg };
        assert_eq!(with.array().check_pose(with.scene(), &robot), Ok(()));
        let placed = with.at(robot).expect("a pose");
        let body = &placed.simulator(0).scene().cylinders[0];
        assert!(body.center.distance(robot.position()) < 1e-12, "{body:?}");
        // A head-on wall reads as without the body.
        let mut bare = with.array().as_ref().clone();
        bare.body = None;
        let (scene, sensor) = (room(3.0), with.simulator().sensor().clone());
        let options = *with.simulator().options();
        let bare = ArrayModel::new(Arc::new(bare), &scene, &sensor, Air::default(), options)
            .expect("right options");
        let bare = bare.at(robot).expect("a pose");
        for ranger in [0, 3, 6, 9].into_iter().filter(|_| heading_deg != 200.0) {
            let [own, alone] =
                [&placed, &bare].map(|placed| placed.ping(ranger).expect("few paths").range_m);
            let off_m = own.zip(alone).map(|(own, alone)| (own - alone).abs());
            assert!(off_m.is_some_and(|m| m < 0.01), "{ranger}: {own:?} {alone:?}");
        }
        // No arrival has passed through the body.
        let mounted = with.array().rangers[0].world_pose(&robot);
        let point = placed.simulator(0).at(mounted.position());
        for arrival in point.arrivals(mounted.direction_rad(0.0)).expect("few paths") {
            let through = std::f64::consts::PI + mounted.direction_rad(0.0);
            let off = crate::geometry::wrap_pi(arrival.arrival_rad - through).abs();
            assert!(off > 0.5, "from behind, through the body: {arrival:?}");
        }
    }
}

#[test]
fn heights_change_floor_echoes() {
    let mut array = RangerArray::preset("pioneer-7").expect("a preset");
    array.rangers[3].z_m = Some(0.05);
    let mut scene = room(6.0);
    scene.floor_z_m = Some(0.0);
    let sensor = Sensor::preset("pioneer").expect("a preset");
    let build = |array: RangerArray| {
        ArrayModel::new(Arc::new(array), &scene, &sensor, Air::default(), Options::default())
            .expect("right options")
    };
    let robot = Pose { x_m: 3.0, y_m: 3.0, heading_deg: 0.0 };
    let mixed = build(array.clone());
    let level = build(RangerArray::preset("pioneer-7").expect("a preset"));
    let [mixed, level] = [&mixed, &level].map(|model| model.at(robot).expect("a pose"));
    assert_eq!(mixed.simulator(3).sensor().mounting.z_m, Some(0.05));
    assert_eq!(mixed.simulator(2).sensor().mounting.z_m, sensor.mounting.z_m);
    assert_eq!(mixed.ping(2).expect("few paths"), level.ping(2).expect("few paths"));
    assert_ne!(
        mixed.ping(3).expect("few paths").amplitude,
        level.ping(3).expect("few paths").amplitude
    );
}

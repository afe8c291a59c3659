//! Sweeps of minimal length, closed sweeps, and sweeps of arrays.

use std::sync::Arc;

use jiff::Timestamp;
use uuid::Uuid;

use super::{scan, simulator};
use crate::interpret::Sweep;
use sonard_model::{
    acoustics::{Air, Sensor},
    array::RangerArray,
    geometry::{DVec2, Pose},
    model::{ArrayModel, ConeOptions},
    scene::{Scene, shipped},
};
use sonard_records::{Ping, Record, ScanStart, ScanView, Session};

fn scene() -> Arc<Scene> {
    let text = shipped::text("two-surface-room").expect("shipped");
    Arc::new(Scene::from_json(text).expect("a scene"))
}

#[test]
fn two_stops_are_enough() {
    let whole = scan(&simulator(scene()), 1, &Pose { x_m: 1.2, y_m: 1.0, heading_deg: 30.0 });
    let two = ScanView { pings: whole.pings[..2].to_vec(), ..whole };
    let sweep = Sweep::from_scan(&two).expect("two");
    assert_eq!((sweep.beams.len(), sweep.closed), (2, false));
    assert_eq!((sweep.gap_before_deg(0), sweep.gap_before_deg(1)), (None, Some(0.9)));
}

#[test]
fn closed_sweep_has_a_closing_gap() {
    let whole = scan(&simulator(scene()), 1, &Pose { x_m: 1.2, y_m: 1.0, heading_deg: 30.0 });
    // Two readings in a row may be lost, and not three.
    for (lost, gap_deg) in [(0, Some(0.9)), (2, Some(2.7)), (3, None)] {
        let last = whole.pings.len() - lost;
        let sweep =
            Sweep::from_scan(&ScanView { pings: whole.pings[..last].to_vec(), ..whole.clone() });
        let sweep = sweep.expect("a sweep");
        let found_deg = sweep.gap_before_deg(0);
        assert_eq!(sweep.closed, gap_deg.is_some(), "{lost}");
        assert_eq!(found_deg.is_some(), gap_deg.is_some(), "{lost}");
        let off_deg = found_deg.zip(gap_deg).map_or(0.0, |(found, expected)| found - expected);
        assert!(off_deg.abs() < 1e-9, "{lost}: {found_deg:?}");
    }
}

/// Beams of an array have the position of their ranger for any pose of the robot.
#[test]
fn array_beams_are_at_their_rangers() {
    let array = Arc::new(RangerArray::preset("pioneer-8").expect("an array"));
    let sensor = Sensor::preset(&array.sensor).expect("a preset");
    let (air, options) = (Air::default(), ConeOptions::default().into());
    let model = ArrayModel::new(array.clone(), &scene(), &sensor, air, options).expect("a model");
    let pose = Pose { x_m: 1.3, y_m: 0.8, heading_deg: 70.0 };
    let (scan, time) = (Uuid::nil(), Timestamp::UNIX_EPOCH);
    let station = model.at(pose).expect("a free position");
    let pings = (0..array.rangers.len()).map(|ranger| {
        let prediction = station.ping(ranger).expect("few paths");
        let index = ranger as u32;
        Record::Ping(Box::new(Ping::for_array(&station, scan, &pose, index, ranger, &prediction)))
    });
    let records = [
        Record::Session(Box::new(Session::for_array(&model, time))),
        Record::ScanStart(ScanStart::for_array(&model, scan, pose, 1, time)),
    ];
    let view = ScanView::from_records(records.into_iter().chain(pings)).remove(0);
    let sweep = Sweep::from_scan(&view).expect("a sweep");
    assert_eq!(sweep.beams.len(), array.rangers.len());
    assert!(!sweep.closed);
    for beam in &sweep.beams {
        let ranger = &array.rangers[beam.index as usize];
        let mount = DVec2::new(ranger.x_m, ranger.y_m);
        assert!(beam.mount.distance(mount) < 1e-5, "{beam:?} {ranger:?}");
        let at = ranger.world_pose(&pose);
        assert!(sweep.place(beam).distance(at.position()) < 1e-5, "{beam:?}");
        let along = DVec2::from_angle(at.direction_rad(0.0));
        let point = sweep.point(beam, 2.0) - sweep.place(beam);
        assert!(point.distance(2.0 * along) < 1e-5, "{beam:?} {ranger:?}");
    }
}

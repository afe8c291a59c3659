//! Rangers that report whole centimetres, from waypoints.

use super::*;
use crate::{progress::NoObserver, survey::survey};

/// Distance of the face ahead of the axis, metres.
const AHEAD_M: f64 = 0.03;

/// A rectangle is found from sweeps of 120 beams in whole centimetres, with headings by odometry
/// that are degrees off, and ranges are from the axis although the face is ahead of it.
#[test]
fn coarse_sweeps_give_a_room_to_their_step() {
    let turn = DVec2::from_angle(TURN_RAD);
    let corners = [[0.0, 0.0], [1.7, 0.0], [1.7, 1.3], [0.0, 1.3]];
    let corners = corners.map(|at| turn.rotate(at.into()));
    let mut world = world(&corners);
    let mut sensor = Sensor::preset("lego-nxt").expect("a preset");
    let step_m = sensor.range_step_m;
    (sensor.range_step_m, sensor.mounting) = (0.0, Default::default());
    world.sensor = sensor;
    world.options = Options::default();
    let poses = [[0.5, 0.4, 0.0], [1.1, 0.5, 10.0], [1.2, 0.9, -20.0], [0.6, 0.8, 30.0]];
    let poses = poses.map(|[x, y, heading_deg]: [f64; 3]| {
        let at = turn.rotate(DVec2::new(x, y));
        Pose { x_m: at.x, y_m: at.y, heading_deg }
    });
    let mut odometry = poses;
    for (pose, by) in odometry.iter_mut().skip(1).zip([3.0, -4.0, 2.0]) {
        pose.heading_deg += by;
        pose.x_m += 0.003 * by;
    }
    let mut sweeps = sweeps(&world, &poses, &odometry);
    let m_per_us = 0.5e-6 * world.air.sound_speed_m_s();
    for beam in sweeps.iter_mut().flat_map(|sweep| &mut sweep.beams) {
        if let FiringOutcome::Echo { tof_us } = &mut beam.outcome {
            let range_m = ((*tof_us * m_per_us - AHEAD_M) / step_m).round() * step_m;
            *tof_us = range_m / m_per_us;
        }
    }
    (world.sensor.range_step_m, world.sensor.mounting.ahead_m) = (step_m, AHEAD_M);
    let odometry = OdometrySigma {
        m_per_m: 0.01,
        deg_per_m: 0.1,
        m_per_stop: 0.012,
        deg_per_stop: 5.0,
        are_waypoints: true,
    };
    let options = SurveyOptions { odometry: Some(odometry), ..SurveyOptions::default() };
    let found = survey(&world, &sweeps, &options, &NoObserver).expect("a survey");
    for [a, b] in sides(&corners) {
        let is_found = found.walls.iter().any(|wall| {
            let ends = [wall.from.at_m, wall.to.at_m].map(DVec2::from);
            let is_near = |of: DVec2| ends.iter().any(|end| end.distance(of) < 2.0 * step_m);
            is_near(a) && is_near(b)
        });
        assert!(is_found, "{a} to {b} among {:?}", found.walls);
    }
    assert_eq!(found.walls.len(), 4);
}

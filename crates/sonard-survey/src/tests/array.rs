//! Rounds of an array on a moving robot.

use sonard_inverse::{ArrayFiring, ArrayRound, ParameterGroup};
use sonard_model::{
    acoustics::Mounting,
    array::{MountedRanger, RangerArray},
    geometry::wrap_180,
};

use super::*;
use crate::{
    arc::Arc as RangeArc,
    arrangement::LineArrangement,
    bundle::{Bundle, SupportedFeature},
    error::SurveyError,
    feature::VirtualFeature,
    input::SurveyInput,
    judge::{Judge, outcome_of},
    polish::polish,
    posed::PosedPlan,
    progress::NoObserver,
    range_errors::RangeErrors,
    readings::Outcome,
    survey::survey,
    trial::poses_along,
};

fn ring() -> RangerArray {
    RangerArray::preset("ring-12").expect("a preset")
}

/// Rounds of the ring, predicted from the true positions of its rangers, with other poses as
/// odometry.
fn rounds(world: &World, poses: &[Pose], odometry: &[Pose]) -> Vec<ArrayRound> {
    let firings = |pose: &Pose| {
        let of_ranger = |ranger: &MountedRanger| {
            let own = ranger.world_pose(pose);
            let swept = sweeps(world, &[own], &[own]);
            // The first of its beams is along the bearing of the ranger.
            ArrayFiring {
                position: DVec2::new(ranger.x_m, ranger.y_m),
                azimuth_deg: ranger.bearing_deg,
                outcome: swept[0].beams[0].outcome,
            }
        };
        ring().rangers.iter().map(of_ranger).collect()
    };
    let round = |(number, (pose, odometry)): (u128, (&Pose, &Pose))| ArrayRound {
        scan: Uuid::from_u128(number),
        pose: *odometry,
        firings: firings(pose),
    };
    (1..).zip(poses.iter().zip(odometry)).map(round).collect()
}

/// Echoes of walls are predicted for the positions of the rangers: from the pose of the robot, 16 cm
/// from them, ranges differ by up to as much.
#[test]
fn ranges_of_walls_are_those_from_the_rangers() {
    let (corners, _, world, _) = true_rectangle();
    let poses = poses_along(&stops(), 12);
    let rounds = rounds(&world, &poses, &poses);
    let (input, scores) = (SurveyInput::from(&rounds), PlanScores::default());
    let sweeps = input.sweeps();
    let workspace =
        workspace(&world, (input, &sweeps), &options(), (&NoObserver, &scores)).expect("rounds");
    let judge = Judge::new(&workspace, &poses, 0.004);
    let segments: Vec<_> = sides(&corners)
        .into_iter()
        .enumerate()
        .map(|(line, [a, b])| crate::arrangement::Segment { line, a, b })
        .collect();
    let (_, predictions) = judge.predictions(&segments).expect("few paths");
    let mut compared = 0;
    for (readings, predictions) in workspace.readings.iter().zip(&predictions) {
        for (beam, prediction) in readings.beams.iter().zip(predictions) {
            let is_single =
                prediction.arrival.as_ref().is_some_and(|of| of.path.interactions.len() == 1);
            // A weak echo is late by up to centimetres, and strength depends on the position.
            let is_strong = prediction.margin_db.is_some_and(|margin_db| margin_db > 20.0);
            if let (Outcome::Echo(measured_m), Outcome::Echo(expected_m), true) =
                (beam.outcome, outcome_of(prediction), is_single && is_strong)
            {
                assert!((measured_m - expected_m).abs() < 1e-3, "{measured_m} {expected_m}");
                assert!(beam.face.length() > 0.15);
                compared += 1;
            }
        }
    }
    assert!(compared > 8, "{compared}");
}

/// Estimate by the likelihood of rounds at the true poses, from others in the true rectangle.
fn estimate(truth: &[Pose], poses: Vec<Pose>) -> PosedPlan {
    let (corners, _, world, _) = true_rectangle();
    let rounds = rounds(&world, truth, truth);
    let (input, scores) = (SurveyInput::from(&rounds), PlanScores::default());
    let sweeps = input.sweeps();
    let workspace =
        workspace(&world, (input, &sweeps), &options(), (&NoObserver, &scores)).expect("rounds");
    let (plan, walls) = LineArrangement::of_walls(&sides(&corners), &poses, workspace.reach_m());
    let mut posed = PosedPlan { plan, walls, posts: Vec::new(), poses };
    let judge = Judge::of(&workspace, &posed, 0.004);
    polish(&mut posed, &judge).expect("an estimate");
    posed
}

fn assert_near(found: &[Pose], truth: &[Pose], max_m: f64) {
    for (found, truth) in found.iter().zip(truth) {
        let off_m = found.position().distance(truth.position());
        let off_deg = wrap_180(found.heading_deg - truth.heading_deg).abs();
        // Few rangers are near their threshold, by which headings are determined.
        assert!(off_m < max_m && off_deg < 0.25, "{found:?} {truth:?}");
    }
}

/// The final estimate predicts each ranger where it is.
#[test]
fn final_estimate_recovers_poses_of_rounds() {
    let truth = poses_along(&stops(), 12);
    let off = |(at, pose): (usize, &Pose)| {
        let by = if at == 0 { 0.0 } else { f64::from(at as u32 % 3) - 1.0 };
        Pose {
            x_m: pose.x_m + 0.003 * by,
            y_m: pose.y_m - 0.002 * by,
            heading_deg: pose.heading_deg + 0.4 * by,
        }
    };
    let found = estimate(&truth, truth.iter().enumerate().map(off).collect());
    assert_near(&found.poses, &truth, 2e-4);
}

/// A wrong first pose is corrected, although the frame of the survey is that pose: in its own frame,
/// all other poses and walls are wrong.
#[test]
fn final_estimate_corrects_the_first_pose() {
    let truth = poses_along(&stops(), 12);
    let mut poses = truth.clone();
    poses[0].x_m += 0.006;
    poses[0].heading_deg += 1.0;
    let frame = poses[0];
    let found = estimate(&truth, poses);
    assert_eq!(found.poses[0], frame);
    assert_near(&found.in_frame(&truth[0]).poses, &truth, 2e-3);
}

/// Arcs of transducers off the axis, from true ranges and bearings, give poses and lines.
#[test]
fn bundle_recovers_poses_from_transducers_off_the_axis() {
    let truth = stops();
    let lines = [(0.1, 2.5), (1.4, 3.0), (3.3, 1.5)].map(|(n, d)| VirtualFeature::line(n, d));
    let faces = [[0.16, 0.0], [0.05, 0.15], [-0.1, 0.12]].map(DVec2::from);
    let arc = |sweep: usize, feature: &VirtualFeature, face: DVec2| {
        let pose = &truth[sweep];
        let place = pose.position() + pose.rotate_to_world(face);
        let (range_m, bearing_rad) = feature.predict(place);
        RangeArc {
            sweep,
            face,
            azimuth_deg: bearing_rad.to_degrees() - pose.heading_deg,
            range_m,
            is_cut: false,
            beams: vec![0],
            step_deg: 30.0,
            errors: RangeErrors::default(),
        }
    };
    let arcs: Vec<Vec<RangeArc>> = lines
        .iter()
        .map(|line| {
            (0..truth.len()).flat_map(|sweep| faces.map(|face| arc(sweep, line, face))).collect()
        })
        .collect();
    let supported = lines.iter().zip(&arcs).map(|(line, arcs)| SupportedFeature {
        feature: line.moved([0.01, 0.02]),
        arcs: arcs.iter().collect(),
    });
    let (mut poses, mut features) = (drifted(&truth), supported.collect());
    Bundle { poses: &mut poses, features: &mut features, moves: &[] }.solve().expect("determined");
    for (found, expected) in poses.iter().zip(&truth) {
        assert!(found.position().distance(expected.position()) < 1e-4, "{found:?} {expected:?}");
        let off_deg = wrap_180(found.heading_deg - expected.heading_deg);
        assert!(off_deg.abs() < 0.01, "{found:?} {expected:?}");
    }
}

#[test]
fn rounds_of_a_ring_give_the_room() {
    let (corners, _, world, _) = true_rectangle();
    let poses = poses_along(&stops(), 20);
    let mut odometry = poses.clone();
    for (at, pose) in odometry.iter_mut().enumerate() {
        (pose.x_m, pose.y_m) = (pose.x_m + 0.003 * at as f64, pose.y_m - 0.002 * at as f64);
        pose.heading_deg += 0.3 * at as f64;
    }
    let rounds = rounds(&world, &poses, &odometry);
    let found = survey(&world, &rounds, &options(), &NoObserver).expect("a survey");
    let scene = found.scene("found", false).build().expect("a valid scene");
    let compared = crate::trial::Comparison::new(&found, &world.scene, &poses);
    assert!(compared.recall > 0.9 && compared.precision > 0.95, "{scene:#?}");
    assert!(found.next_view.is_none() && found.poses.len() == 20);
    // All four sides, each with a piece.
    for [a, b] in sides(&corners) {
        let middle = compared.motion.inverse_of(&Pose {
            x_m: a.midpoint(b).x,
            y_m: a.midpoint(b).y,
            heading_deg: 0.0,
        });
        let is_near = scene.clearance_m(middle.position()) < 0.03;
        assert!(is_near, "{a} to {b}: {scene:#?}");
    }
}

/// The mounting of the sensor is part of the positions of the rangers, and a round far from all
/// walls has no echo.
#[test]
fn mounting_counts_once_and_rounds_may_be_silent() {
    let (_, poses, world, _) = true_rectangle();
    let mut rounds = rounds(&world, &poses, &poses);
    rounds[2].firings.iter_mut().for_each(|of| of.outcome = FiringOutcome::NoEcho);
    let readings_of = |world: &World| {
        let (input, scores) = (SurveyInput::from(&rounds), PlanScores::default());
        let sweeps = input.sweeps();
        let workspace = workspace(world, (input, &sweeps), &options(), (&NoObserver, &scores));
        let workspace = workspace.expect("rounds");
        assert!(workspace.arcs[2].is_empty() && !workspace.arcs[1].is_empty());
        workspace.readings
    };
    let mut ahead = world.clone();
    ahead.sensor.mounting = Mounting { ahead_m: 0.05, left_m: 0.01, ..Mounting::default() };
    assert_eq!(readings_of(&world), readings_of(&ahead));
}

#[test]
fn mounting_is_not_fitted_to_rounds() {
    let (_, poses, world, _) = true_rectangle();
    let rounds = rounds(&world, &poses, &poses);
    let options = SurveyOptions { fit: vec![ParameterGroup::Mounting], ..options() };
    let error = survey(&world, &rounds, &options, &NoObserver).expect_err("no survey");
    let expected =
        |error| matches!(error, SurveyError::NotFittable { fittable, .. } if !fittable.is_empty());
    assert!(expected(error));
}

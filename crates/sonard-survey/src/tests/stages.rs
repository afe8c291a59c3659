//! Single stages.

use sonard_model::geometry::{DVec2, distance_to_segment, wrap_180};

use super::*;
use crate::{
    arc::find_arcs,
    course::map_course,
    faces::cells,
    judge::{Judge, ScoreContext},
    moves::MoveFinder,
    odometry::Move,
    polish::polish,
    posed::PosedPlan,
    post::PostShape,
    progress::NoObserver,
    search::{PlanSearch, ScoredPlan, initial_walls},
    slam::virtual_map_in_order,
};

/// Every wall has an arc at the distance of its perpendicular, and the farthest corner has one at
/// its own distance.
#[test]
fn arcs_are_at_distances_of_walls_and_corners() {
    let (corners, poses, world, sweeps) = true_rectangle();
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    for (at, (readings, pose)) in workspace.readings.iter().zip(&poses).enumerate() {
        let arcs = find_arcs(at, readings, Default::default());
        let walls = sides(&corners);
        let of_walls = walls.iter().map(|[a, b]| {
            let normal = (*b - *a).perp().normalize();
            let off_m = (*a - pose.position()).dot(normal);
            (off_m.abs(), (off_m * normal).to_angle())
        });
        for (range_m, direction_rad) in of_walls {
            // Time walk delays echoes by a millimetre or two.
            let is_found = arcs.iter().any(|arc| {
                let off_rad = pose.direction_rad(arc.azimuth_deg) - direction_rad;
                (-0.001..0.004).contains(&(arc.range_m - range_m))
                    && off_rad.sin().abs() < 0.07
                    && off_rad.cos() > 0.0
            });
            assert!(is_found, "sweep {at}: wall at {range_m} m among {arcs:?}");
        }
        let farthest_m = corners.iter().map(|corner| corner.distance(pose.position()));
        let farthest_m = farthest_m.fold(0.0, f64::max);
        assert!(
            arcs.iter().any(|arc| (arc.range_m - farthest_m).abs() < 0.005),
            "sweep {at}: corner at {farthest_m} m among {arcs:?}"
        );
    }
}

#[test]
fn course_is_found_without_a_scene() {
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let odometry = drifted(&poses);
    let sweeps = sweeps(&world, &poses, &odometry);
    let map = map_course(&world, &sweeps, &options()).expect("a course");
    for (found, truth) in map.poses.iter().zip(&poses) {
        let off_m = found.pose.position().distance(truth.position());
        let off_deg = wrap_180(found.pose.heading_deg - truth.heading_deg).abs();
        assert!(off_m < 0.003 && off_deg < 0.4, "{found:?} {truth:?}");
        assert!(found.sigma_m.is_some_and(|[x, y]| x < 0.01 && y < 0.01), "{found:?}");
    }
    // All four walls and all four corners are among the features.
    for [a, b] in sides(&corners) {
        let normal = (b - a).perp().normalize();
        let is_found = map.features.iter().any(|(feature, _)| match *feature {
            crate::VirtualFeature::Line { normal_rad, distance_m, .. } => {
                let own = DVec2::from_angle(normal_rad);
                own.perp_dot(normal).abs() < 0.02 && (own.dot(a) - distance_m).abs() < 0.01
            }
            crate::VirtualFeature::Point { .. } => false,
        });
        assert!(is_found, "wall {a} {b}: {:?}", map.features);
    }
}

/// Located from the last sweep to the first, a course is the same in the frame of the first.
#[test]
fn course_is_found_backwards() {
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let sweeps = sweeps(&world, &poses, &drifted(&poses));
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let order = [3, 2, 1, 0];
    let odometry = order.map(|sweep| sweeps[sweep].pose);
    let moves = Move::between(&odometry, OdometrySigma::default());
    let map = virtual_map_in_order(&workspace.arcs, poses[0], &order, (&moves, &workspace.moves));
    assert_eq!(map.poses[0], poses[0]);
    for (found, truth) in map.poses.iter().zip(&poses) {
        let off_m = found.position().distance(truth.position());
        let off_deg = wrap_180(found.heading_deg - truth.heading_deg).abs();
        assert!(off_m < 0.003 && off_deg < 0.4, "{found:?} {truth:?}");
    }
}

/// The estimate by all readings corrects poses and lines.
#[test]
fn polish_returns_to_the_true_room() {
    let (corners, truth, world, sweeps) = true_rectangle();
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let mut poses = truth.clone();
    for (at, pose) in poses.iter_mut().enumerate().skip(1) {
        let sign = if at % 2 == 0 { 1.0 } else { -1.0 };
        pose.x_m += 0.001 * sign;
        pose.heading_deg += 0.1 * sign;
    }
    let turn = DVec2::from_angle(0.001);
    let turned: Vec<DVec2> = corners.iter().map(|corner| turn.rotate(*corner)).collect();
    let (plan, walls) = plan_of(&sides(&turned), &poses);
    let mut posed = PosedPlan { plan, walls, posts: Vec::new(), poses: poses.clone() };
    let judge = Judge::new(&workspace, &poses, 0.004);
    polish(&mut posed, &judge).expect("determined");
    for (pose, truth) in posed.poses.iter().zip(&truth).skip(1) {
        let off_m = pose.position().distance(truth.position());
        let off_deg = wrap_180(pose.heading_deg - truth.heading_deg);
        assert!(off_m < 5e-4 && off_deg.abs() < 0.03, "{pose:?} {truth:?}");
    }
    let (expected, _) = plan_of(&sides(&corners), &truth);
    for (line, truth) in posed.plan.lines.iter().zip(&expected.lines) {
        let turn_deg = line.angle_to(truth).to_degrees();
        assert!(turn_deg < 0.03, "{turn_deg}");
    }
}

/// Plan, posts and poses keep their distances in another frame, and return exactly.
#[test]
fn plan_moves_with_its_first_pose() {
    let corners = rectangle();
    let (plan, walls) = plan_of(&sides(&corners), &stops());
    let post = PostShape { center: DVec2::new(1.0, 1.2), radius_m: 0.05 };
    let posed = PosedPlan { plan, walls, posts: vec![post], poses: stops() };
    let frame = Pose { x_m: -3.0, y_m: 7.5, heading_deg: 171.0 };
    let moved = posed.clone().in_frame(&frame);
    assert_eq!(moved.poses[0], frame);
    let places = |of: &PosedPlan| {
        let ends = of.plan.segments(&of.walls).into_iter().flat_map(|wall| [wall.a, wall.b]);
        let poses = of.poses.iter().map(Pose::position);
        ends.chain(poses).chain(of.posts.iter().map(|post| post.center)).collect::<Vec<_>>()
    };
    let back = moved.clone().in_frame(&posed.poses[0]);
    let [before, after, back] = [&posed, &moved, &back].map(places);
    assert!(before.len() > 12 && after.len() == before.len());
    for (at, (own, moved)) in before.iter().zip(&after).enumerate() {
        assert!(back[at].distance(*own) < 1e-12);
        for (other, other_moved) in before.iter().zip(&after) {
            let change_m = own.distance(*other) - moved.distance(*other_moved);
            assert!(change_m.abs() < 1e-12, "{change_m}");
        }
    }
    let turned_deg = wrap_180(frame.heading_deg - posed.poses[0].heading_deg);
    for (own, moved) in posed.poses.iter().zip(&moved.poses) {
        let change_deg = wrap_180(moved.heading_deg - own.heading_deg - turned_deg);
        assert!(change_deg.abs() < 1e-9);
    }
}

#[test]
fn lines_of_a_rectangle_have_one_cell() {
    let corners = rectangle();
    let (plan, walls) = plan_of(&sides(&corners), &stops());
    let cells = cells(&plan);
    assert_eq!(cells.len(), 1, "{cells:?}");
    assert_eq!(cells[0].len(), 4);
    assert!(cells[0].iter().all(|piece| walls.contains(*piece)));
    let segments = plan.segments(&walls);
    assert_eq!(segments.len(), 4);
    for corner in corners {
        let near = segments
            .iter()
            .filter(|wall| wall.a.distance(corner) < 1e-9 || wall.b.distance(corner) < 1e-9);
        assert_eq!(near.count(), 2);
    }
}

/// The true room scores higher than each room that one move away from it.
#[test]
fn truth_is_not_beaten_by_its_neighbours() {
    let (corners, poses, world, sweeps) = true_rectangle();
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let judge = Judge::new(&workspace, &poses, 0.004);
    // Two more lines across the room, without walls.
    let mut lines = sides(&corners);
    lines.push([corners[0].lerp(corners[1], 0.6), corners[3].lerp(corners[2], 0.6)]);
    lines.push([corners[0].lerp(corners[3], 0.7), corners[1].lerp(corners[2], 0.7)]);
    let (plan, mut walls) = plan_of(&lines, &poses);
    for line in [4, 5] {
        (0..plan.pieces_of(line)).for_each(|at| walls.set(plan.piece(line, at), false));
    }
    let truth = judge.score(&plan, &walls);
    let moves = MoveFinder::new(&plan, &poses).moves(&walls);
    assert!(moves.len() > 10, "{moves:?}");
    for change in moves {
        let score = judge.score(&plan, &walls.changed(&change));
        assert!(score < truth, "{change:?}: {score} against {truth}");
    }
    // Wider by 3 cm on one side.
    let mut wider = corners.clone();
    let along = (corners[1] - corners[0]).normalize();
    wider[1] += 0.03 * along;
    wider[2] += 0.03 * along;
    let (plan, walls) = plan_of(&sides(&wider), &poses);
    assert!(judge.score(&plan, &walls) < truth - 50.0);
}

/// A floor excludes exactly the plans that do not score above it, whichever floor comes first.
#[test]
fn floors_exclude_only_lower_scores() {
    let (corners, poses, world, sweeps) = true_rectangle();
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let (plan, walls) = plan_of(&sides(&corners), &poses);
    let exact = Judge::new(&workspace, &poses, 0.004);
    let truth = exact.score(&plan, &walls);
    let moves = MoveFinder::new(&plan, &poses).moves(&walls);
    let fresh = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &fresh));
    let judge = Judge::new(&workspace, &poses, 0.004);
    let mut excluded = 0;
    for change in moves {
        let changed = walls.changed(&change);
        let score = exact.score(&plan, &changed);
        let above = judge.score_above(&plan, &changed, ScoreContext::above(truth));
        assert!(above.is_none_or(|above| above == score), "{above:?} against {score}");
        excluded += usize::from(above.is_none());
        let below = ScoreContext::above(score - 1.0);
        assert_eq!(judge.score_above(&plan, &changed, below), Some(score), "{change:?}");
    }
    assert!(excluded > 0);
}

/// From the walls at perpendiculars alone the search closes the room.
#[test]
fn climbing_closes_the_room() {
    let (corners, poses, world, sweeps) = true_rectangle();
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let judge = Judge::new(&workspace, &poses, 0.004);
    let (mut plan, truth) = plan_of(&sides(&corners), &poses);
    for line in &mut plan.lines {
        for (sweep, pose) in poses.iter().enumerate() {
            let along_m = line.along_m(pose.position());
            let range_m = line.off_m(pose.position()).abs();
            line.feet.push(crate::line::Foot { sweep, along_m, range_m });
        }
    }
    let begun = initial_walls(&plan, &poses);
    let search = PlanSearch { plan: &plan, judge: &judge, excluded: None };
    let found = search.trim(search.climb(ScoredPlan::new(&plan, &judge, begun)));
    let segments = plan.segments(&found.walls);
    for [a, b] in sides(&corners) {
        let middle = a.midpoint(b);
        assert!(segments.iter().any(|wall| distance_to_segment(middle, wall.a, wall.b) < 1e-6));
    }
    assert!((found.score - judge.score(&plan, &truth)).abs() < 1e-6, "{found:?}");
}

/// A plan is scored from the headings at which its predictions agree with the readings, within the
/// step of directions, and the score is that of those headings.
#[test]
fn free_headings_are_those_of_the_readings() {
    const OFF_DEG: [f64; 4] = [0.0, 6.0, -5.0, 7.0];
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let turned = |(pose, off_deg): (&Pose, f64)| Pose {
        heading_deg: wrap_180(pose.heading_deg + off_deg),
        ..*pose
    };
    let odometry: Vec<Pose> = poses.iter().zip(OFF_DEG).map(turned).collect();
    let sweeps = sweeps(&world, &poses, &odometry);
    let sigma = OdometrySigma { deg_per_stop: 5.0, ..OdometrySigma::default() };
    let options = SurveyOptions { odometry: Some(sigma), ..options() };
    let scores = PlanScores::default();
    let workspace =
        workspace(&world, ((&sweeps).into(), &sweeps), &options, (&NoObserver, &scores))
            .expect("arcs");
    let (plan, walls) = plan_of(&sides(&corners), &poses);
    let segments = plan.segments(&walls);
    let fixed = Judge::new(&workspace, &odometry, 0.01);
    assert_eq!(fixed.poses_of(&segments), Some(odometry.clone()));
    let judge = Judge::new(&workspace, &odometry, 0.01).with_free_headings();
    let found = judge.poses_of(&segments).expect("few paths");
    for (found, pose) in found.iter().zip(&poses) {
        assert!(wrap_180(found.heading_deg - pose.heading_deg).abs() < 1.6, "{found:?} {pose:?}");
    }
    // Scores with free and with fixed headings are kept apart.
    let [free, off] = [&judge, &fixed].map(|judge| judge.score(&plan, &walls));
    let truth = Judge::new(&workspace, &poses, 0.01).score(&plan, &walls);
    assert!(free > off + 100.0 && free < truth, "{off} {free} {truth}");
    assert_eq!(judge.score(&plan, &walls), free);
    let again = Judge::new(&workspace, &odometry, 0.01).with_free_headings();
    assert_eq!(again.score(&plan, &walls), free);
}

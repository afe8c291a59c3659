//! Next best view.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use sonard_inverse::{ArrayFiring, ArrayRound};
use sonard_model::geometry::distance_to_segment;

use super::*;
use crate::{
    OpenPart,
    alternatives::Assessment,
    arrangement::Segment,
    input::SurveyInput,
    judge::{Judge, outcome_of},
    moves::crosses,
    next_view::find_next_view,
    posed::PosedPlan,
    progress::NoObserver,
    survey::survey,
};

/// Point in the frame of the rectangle.
fn at(x: f64, y: f64) -> DVec2 {
    DVec2::from_angle(TURN_RAD).rotate(DVec2::new(x, y))
}

fn pose(x: f64, y: f64) -> Pose {
    let DVec2 { x: x_m, y: y_m } = at(x, y);
    Pose { x_m, y_m, heading_deg: 20.0 }
}

/// World of walls by pairs of ends.
fn world_of(walls: &[[DVec2; 2]]) -> World {
    let mut world = world(&rectangle());
    let mut scene = Scene::builder("room").material("wall", 0.97);
    for (number, ends) in walls.iter().enumerate() {
        scene = scene.walls(&format!("wall-{number}"), &ends.map(|end| end.to_array()), "wall");
    }
    world.scene = Arc::new(scene.build().expect("a room"));
    world
}

#[test]
fn closed_room_has_no_next_view() {
    let (_, _, world, sweeps) = true_rectangle();
    let found = survey(&world, &sweeps, &options(), &NoObserver).expect("a survey");
    assert!(found.open_nats < 0.1, "{}", found.open_nats);
    assert_eq!(found.next_view, None);
}

/// A corner that may be behind a partition is decided from where it is not hidden.
#[test]
fn view_is_on_the_side_that_decides() {
    let mut walls = sides(&rectangle());
    let partition = [at(1.3, 0.0), at(1.3, 1.6)];
    walls.push(partition);
    let corner = at(2.0, 0.4);
    let hidden = [[at(2.0, 0.0), corner], [corner, at(SIZE_M[0], 0.4)]];
    let with_hidden = [&walls[..], &hidden].concat();
    let poses = [pose(0.6, 0.5), pose(0.7, 1.2), pose(0.5, 1.95)];
    // Echoes by way of other walls are out of range.
    let mut world = world_of(&walls);
    world.options.max_range_m = Some(1.6);
    let sweeps = sweeps(&world, &poses, &poses);
    let scores = PlanScores::default();
    let workspace = true_workspace(&world, &sweeps, (&NoObserver, &scores));
    let judge = Judge::new(&workspace, &poses, 0.004);
    let (plan, set) = plan_of(&with_hidden, &poses);
    let segments = |walls: &[[DVec2; 2]]| -> Vec<Segment> {
        walls.iter().enumerate().map(|(line, &[a, b])| Segment { line, a, b }).collect()
    };
    let posed = PosedPlan { plan, walls: set, posts: Vec::new(), poses: poses.to_vec() };
    let find = |alternatives: Vec<(Vec<Segment>, f64)>, unexplained: usize, reach_m: f64| {
        let assessment = Assessment { walls: Vec::new(), alternatives, better: None };
        let options = SurveyOptions { view_reach_m: reach_m, ..options() };
        find_next_view(&posed, &judge, &assessment, (&[], unexplained), &options)
    };
    let view = |alternatives, reach_m| find(alternatives, 0, reach_m);
    let (open_nats, found) = view(vec![(segments(&walls), 0.0)], 1.5);
    assert!((open_nats - 2.0_f64.ln()).abs() < 0.05, "{open_nats}");
    let found = found.expect("a view");
    let is_hidden = |of: &Pose| {
        let points = hidden.iter().flatten();
        points.copied().all(|point| crosses([of.position(), point], partition))
    };
    assert!(!is_hidden(&found.pose) && poses.iter().all(is_hidden), "{found:?}");
    assert!(found.gain_nats > 0.5 * open_nats && found.gain_nats <= open_nats, "{found:?}");
    assert_eq!(found.resolves[0].part, OpenPart::Alternative { number: 1 });
    assert!(found.resolves[0].share > 0.9 && (found.resolves[0].probability - 0.5).abs() < 0.02);
    // Near the stops, before the partition, no place decides as much.
    let (_, near) = view(vec![(segments(&walls), 0.0)], 0.21);
    assert!(near.is_none_or(|near| near.gain_nats < 0.5 * found.gain_nats));
    // With a single plan there is no view.
    let (open_nats, none) = view(Vec::new(), 1.5);
    assert!(open_nats < 0.1 && none.is_none(), "{open_nats} {none:?}");
    // Unless arcs contradict it: then anywhere new.
    let (_, found) = find(Vec::new(), 2, 1.5);
    let found = found.expect("a view");
    assert_eq!(found.resolves[0].part, OpenPart::UnexplainedArcs { count: 2 });
    let distances_m = poses.map(|pose| pose.position().distance(found.pose.position()));
    assert!(distances_m.into_iter().all(|distance_m| distance_m > 1.0), "{found:?}");
    assert_eq!((found.gain_nats, find(Vec::new(), 2, 0.0).1), (0.0, None));
}

/// A single ranger, which points away from a corner that may be cut off, decides when turned to it.
#[test]
fn view_of_an_array_has_the_heading_that_decides() {
    let walls = sides(&rectangle());
    let corner = at(2.0, 0.4);
    let hidden = [[at(2.0, 0.0), corner], [corner, at(SIZE_M[0], 0.4)]];
    let mut world = world_of(&walls);
    world.options.max_range_m = Some(1.6);
    let away = |step: u32| Pose {
        heading_deg: TURN_RAD.to_degrees() + 180.0,
        ..pose(0.6, 0.5 + 0.2 * f64::from(step))
    };
    let poses: Vec<Pose> = (0..6).map(away).collect();
    let ahead = |(number, pose): (u128, &Pose)| {
        let position = DVec2::new(0.1, 0.0);
        let place = pose.position() + pose.rotate_to_world(position);
        let own = Pose { x_m: place.x, y_m: place.y, ..*pose };
        let outcome = sweeps(&world, &[own], &[own])[0].beams[0].outcome;
        let firings = vec![ArrayFiring { position, azimuth_deg: 0.0, outcome }];
        ArrayRound { scan: Uuid::from_u128(number), pose: *pose, firings }
    };
    let rounds: Vec<ArrayRound> = (1..).zip(&poses).map(ahead).collect();
    let (input, scores) = (SurveyInput::from(&rounds), PlanScores::default());
    let swept = input.sweeps();
    let workspace =
        workspace(&world, (input, &swept), &options(), (&NoObserver, &scores)).expect("rounds");
    let judge = Judge::new(&workspace, &poses, 0.004);
    let (plan, set) = plan_of(&[&walls[..], &hidden].concat(), &poses);
    let without: Vec<Segment> =
        walls.iter().enumerate().map(|(line, &[a, b])| Segment { line, a, b }).collect();
    let posed = PosedPlan { plan, walls: set, posts: Vec::new(), poses };
    let alternatives = vec![(without.clone(), 0.0)];
    let assessment = Assessment { walls: Vec::new(), alternatives, better: None };
    let options = SurveyOptions { view_reach_m: 1.8, ..options() };
    let (open_nats, found) = find_next_view(&posed, &judge, &assessment, (&[], 0), &options);
    let found = found.expect("a view");
    assert!(found.gain_nats > 0.5 * open_nats, "{found:?} {open_nats}");
    let outcome_in = |segments: &[Segment], pose: &Pose| {
        let simulator = judge.simulator_of(segments).expect("a scene");
        outcome_of(&judge.predict(&simulator, 0, pose).expect("few paths")[0])
    };
    let with = posed.plan.segments(&posed.walls);
    assert_ne!(outcome_in(&with, &found.pose), outcome_in(&without, &found.pose));
    let back = Pose { heading_deg: found.pose.heading_deg + 180.0, ..found.pose };
    assert_eq!(outcome_in(&with, &back), outcome_in(&without, &back));
}

/// Corners of an L in the frame of the rectangle.
const L: [[f64; 2]; 6] = [[0.0, 0.0], [3.4, 0.0], [3.4, 1.5], [1.6, 1.5], [1.6, 2.9], [0.0, 2.9]];

/// A sweep at the next view decreases the entropy by more than one at a random place.
#[test]
fn readings_at_the_next_view_decrease_the_entropy() {
    let corners = L.map(|[x, y]| at(x, y));
    let walls = sides(&corners);
    let world = world(&corners);
    let mut random = Pcg64::seed_from_u64(7);
    let (mut before, mut after, mut elsewhere) = (0.0, 0.0, 0.0);
    for first in STARTS.map(|places| places.map(|[x, y]| pose(x, y))) {
        let surveyed = |more: Option<Pose>| {
            let poses: Vec<Pose> = first.into_iter().chain(more).collect();
            let sweeps = sweeps(&world, &poses, &drifted(&poses));
            survey(&world, &sweeps, &options(), &NoObserver).expect("a survey")
        };
        let found = surveyed(None);
        let view = found.next_view.expect("a view").pose;
        let is_clear = |of: DVec2| {
            walls.iter().all(|[a, b]| {
                let way = [first[1].position(), of];
                distance_to_segment(of, *a, *b) > 0.25 && !crosses(way, [*a, *b])
            })
        };
        assert!(is_clear(view.position()), "{view:?}");
        let place = loop {
            let (angle, length_m) = (random.random_range(0.0..6.3), random.random_range(0.3..1.5));
            let of = first[1].position() + length_m * DVec2::from_angle(angle);
            if is_clear(of) {
                break Pose { x_m: of.x, y_m: of.y, heading_deg: 0.0 };
            }
        };
        before += found.open_nats;
        after += surveyed(Some(view)).open_nats;
        elsewhere += surveyed(Some(place)).open_nats;
    }
    assert!(after < 0.2 * before && after < elsewhere, "{before} {after} {elsewhere}");
}

/// First two stops of courses in the L, beside each other.
const STARTS: [[[f64; 2]; 2]; 2] = [[[0.5, 2.4], [0.8, 1.9]], [[2.6, 0.4], [3.0, 0.8]]];

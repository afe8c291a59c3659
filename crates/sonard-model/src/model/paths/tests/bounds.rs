//! Searches end: with all paths, or with an error that names the excessive part.

use super::*;
use crate::model::{
    SearchPart, TooCostly,
    paths::effort::{BOUND, Bound},
};

/// Settings as for `senscomp-6500` at its full range.
fn settings() -> PathSettings {
    PathSettings {
        max_path_m: 21.4,
        floor: 0.00175,
        absorption_np_per_m: 0.189,
        edge_law: Some(EdgeLaw::Utd),
        ..LOSSLESS
    }
}

fn with_heights(mut room: Scene, low: std::ops::Range<usize>) -> Scene {
    (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(2.5));
    room.walls[low].iter_mut().for_each(|wall| wall.z_m = Some([0.0, 0.7]));
    room.walls.iter_mut().for_each(|wall| wall.material.reflectance = 0.9);
    room
}

fn closed(corners: &[DVec2]) -> Vec<[f64; 4]> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| [a.x, a.y, b.x, b.y]).collect()
}

/// A room of 4 by 3 m with turned boxes, 0.7 m high.
fn with_boxes(boxes: &[(DVec2, f64)]) -> Scene {
    let square = |(at, turn): &(DVec2, f64)| {
        let corner =
            |side: usize| *at + 0.35 * DVec2::from_angle(turn + TAU * (0.125 + 0.25 * side as f64));
        closed(&[0, 1, 2, 3].map(corner))
    };
    let mut walls: Vec<_> = boxes.iter().flat_map(square).collect();
    let low = 0..walls.len();
    walls.extend(closed(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]].map(DVec2::from)));
    with_heights(scene(&walls), low)
}

/// A number of low walls around a place, in no order.
fn ring(count: usize) -> Scene {
    let wall = |at: usize| {
        let angle = TAU * at as f64 / count as f64;
        let middle = (1.2 + 0.6 * (at as f64 * 2.4).sin()) * DVec2::from_angle(angle);
        let along = 0.08 * DVec2::from_angle(angle + 1.2 + 0.4 * (at as f64).cos());
        [middle.x - along.x, middle.y - along.y, middle.x + along.x, middle.y + along.y]
    };
    with_heights(scene(&(0..count).map(wall).collect::<Vec<_>>()), 0..count)
}

/// A star of this many corners around a place.
fn star(corners: usize) -> Scene {
    let corner = |at: usize| {
        let out_m = if at.is_multiple_of(2) { 2.0 } else { 1.2 };
        out_m * DVec2::from_angle(TAU * at as f64 / corners as f64)
    };
    scene(&closed(&(0..corners).map(corner).collect::<Vec<_>>()))
}

/// Number of paths, unless there are too many, and the steps of the search.
fn searched(room: &Scene, at: DVec2, settings: PathSettings) -> (Result<usize, TooCostly>, u64) {
    let paths = Paths::new(room, settings);
    let search = Paths { plan: paths.plan.for_search(paths.bound), ..paths.clone() };
    let (_, echoes) = search.trace_all(at, at, None);
    let steps = search.plan.effort.steps() + search.edge_to_edge.effort.steps();
    let settings = &paths.plan.settings;
    let check = search.plan.effort.check(settings).and(paths.edge_to_edge.effort.check(settings));
    (check.map(|()| echoes.len()), steps)
}

/// Largest count of one mechanism at once.
const AT_ONCE: u64 = 1_000_000;

#[test]
fn low_boxes_are_searched_fully() {
    let boxes = [(DVec2::new(1.1, 1.0), 0.3), (DVec2::new(2.7, 1.9), 0.8)];
    for (boxes, bound) in [(&boxes[..1], 6_000_000), (&boxes, 15_000_000)] {
        let (found, steps) = searched(&with_boxes(boxes), DVec2::new(2.0, 0.7), settings());
        assert!(found.is_ok_and(|count| count > 1000) && steps < bound, "{steps}");
    }
}

#[test]
fn effort_limit_holds() {
    let double = PathSettings { double_diffraction: true, ..settings() };
    for (room, settings) in [(ring(60), settings()), (star(200), double)] {
        let (found, steps) = searched(&room, DVec2::new(0.1, 0.05), settings);
        assert!(steps <= 2 * BOUND.steps + AT_ONCE, "{steps} {found:?}");
    }
}

#[test]
fn error_names_the_excess() {
    let refused = |room: &Scene, settings: PathSettings, bound: Bound| {
        let paths = Paths { bound, ..Paths::new(room, settings) };
        paths.enumerate(DVec2::new(0.1, 0.05)).expect_err("too many paths")
    };
    let steps = Bound { steps: 20_000, ..BOUND };
    let mirrors = PathSettings { edge_law: None, ..settings() };
    let of_beams = refused(&ring(60), mirrors, steps);
    assert_eq!(of_beams.part, SearchPart::Beams);
    let message = of_beams.to_string();
    assert!(
        message.contains("wall to wall") && message.contains("max-range (currently 10.7 m)"),
        "{message}"
    );
    assert!(!message.contains("double-diffraction"), "{message}");
    let double = PathSettings { double_diffraction: true, max_path_m: 6.0, ..settings() };
    assert!(refused(&star(200), double.clone(), steps).to_string().contains("double-diffraction"));
    // Memory is limited as work is.
    let bytes = Bound { bytes: 10_000, ..BOUND };
    assert!(Paths::new(&ring(60), settings()).bound == BOUND);
    refused(&ring(60), settings(), bytes);
}

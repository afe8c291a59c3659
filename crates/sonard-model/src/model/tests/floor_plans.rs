//! Hand-drawn floor plans read as intended.

mod drawn;

use drawn::{Hand, Sketch};
use proptest::prelude::*;
use rand::{Rng, RngExt, SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64;

use super::*;
use crate::{
    model::{Mechanism, Prediction},
    scan_plan::ScanPlan,
    scene::DEFAULT_SNAP_M,
};

/// Every 4.5 degrees around the circle.
const PLAN: ScanPlan = ScanPlan { from_deg: 0.0, to_deg: 360.0, step_deg: 4.5, pings_per_stop: 1 };

/// Environment variable with the number of plans in the property test; 50 by default.
const MORE: &str = "SONARD_HAND_DRAWN_PLANS";

fn readings(scene: &Scene, at: DVec2, engine: EngineKind) -> Vec<Prediction> {
    let fan = FanOptions { ray_spacing_deg: 1.0, ..FanOptions::default() };
    let options = match engine {
        EngineKind::Fan => EngineOptions::from(fan),
        other => other.options(),
    };
    simulator(scene.clone(), options)
        .predict(&Pose { x_m: at.x, y_m: at.y, heading_deg: 0.0 }, &PLAN)
        .expect("a plan that can be searched")
}

/// A room of 3 by 2 metres with a partition from one wall and a slanted screen; the ranger's place
/// in it.
fn room() -> (Vec<Wall>, DVec2) {
    let walls = vec![
        wall("south", (0.0, 0.0), (3.0, 0.0), 0.9),
        wall("east", (3.0, 0.0), (3.0, 2.0), 0.9),
        wall("north", (3.0, 2.0), (0.0, 2.2), 0.9),
        wall("west", (0.0, 2.2), (0.0, 0.0), 0.9),
        wall("partition", (1.8, 0.0), (1.7, 0.8), 0.9),
        wall("screen", (0.3, 1.2), (0.7, 1.6), 0.9),
    ];
    (walls, DVec2::new(1.21, 0.67))
}

/// Beams at which `changed` differs from `meant` by more than `bound_m`.
fn differing(changed: &[Prediction], meant: &[Prediction], bound_m: f64) -> Vec<usize> {
    let differs = |(first, second): (&Prediction, &Prediction)| {
        let apart_m = first.range_m.zip(second.range_m).map(|(a, b)| (a - b).abs());
        first.status != second.status || apart_m.is_some_and(|apart_m| apart_m > bound_m)
    };
    (0..meant.len()).filter(|&beam| differs((&changed[beam], &meant[beam]))).collect()
}

#[test]
fn overshoots_and_gaps() {
    let (walls, at) = room();
    for engine in [EngineKind::Paths, EngineKind::Fan, EngineKind::Cone] {
        let meant = readings(&scene(walls.clone()), at, engine);
        for longer_m in [-1e-3, -2e-6, -1e-7, 1e-9, 1e-3] {
            let mut drawn = walls.clone();
            for wall in drawn.iter_mut().filter(|wall| &*wall.id != "screen") {
                let along = (wall.b - wall.a).normalize();
                wall.a -= longer_m * along;
                if &*wall.id != "partition" {
                    wall.b += longer_m * along;
                }
            }
            let found = readings(&scene(drawn), at, engine);
            assert_eq!(differing(&found, &meant, 1e-6), [0; 0], "{engine:?} {longer_m}");
        }
    }
}

#[test]
fn duplicate_and_split_walls() {
    let (walls, at) = room();
    let mut random = Pcg64::seed_from_u64(5);
    for engine in [EngineKind::Paths, EngineKind::Fan, EngineKind::Cone] {
        let meant = readings(&scene(walls.clone()), at, engine);
        for case in 0..8 {
            let mut drawn: Vec<Wall> = walls
                .iter()
                .flat_map(|wall| {
                    let parts = random.random_range(1..6);
                    let at = |part: i32| wall.a.lerp(wall.b, f64::from(part) / f64::from(parts));
                    let part = |part: i32| Wall {
                        id: format!("{}-{part}", wall.id).into(),
                        a: at(part),
                        b: at(part + 1),
                        ..wall.clone()
                    };
                    let twice = Wall { id: format!("{}-again", wall.id).into(), ..wall.clone() };
                    let again = random.random_bool(0.5).then_some(twice);
                    (0..parts).map(part).chain(again).collect::<Vec<_>>()
                })
                .collect();
            drawn.shuffle(&mut random);
            for wall in drawn.iter_mut().filter(|_| random.random()) {
                std::mem::swap(&mut wall.a, &mut wall.b);
            }
            let found = readings(&scene(drawn), at, engine);
            assert_eq!(differing(&found, &meant, 1e-6), [0; 0], "{engine:?} {case}");
        }
    }
}

#[test]
fn material_ignores_order() {
    let (mut walls, at) = room();
    let soft = Material::smooth(0.2);
    walls.push(Wall { id: "curtain".into(), material: soft, ..walls[0].clone() });
    let one = readings(&scene(walls.clone()), at, EngineKind::Paths);
    walls.reverse();
    assert_eq!(readings(&scene(walls), at, EngineKind::Paths).len(), one.len());
    let (mut walls, _) = room();
    walls.insert(0, Wall { id: "curtain".into(), material: soft, ..walls[0].clone() });
    let other = readings(&scene(walls), at, EngineKind::Paths);
    assert_eq!(differing(&other, &one, 1e-9), [0; 0]);
}

/// Sum of all arrivals at a place for a steady tone.
fn field(walls: &[Wall], at: DVec2, direction_deg: f64) -> num_complex::Complex64 {
    let wave_number_per_m = std::f64::consts::TAU * 49_400.0 / 343.2;
    arrivals(scene(walls.to_vec()), EngineKind::Paths.options(), at, direction_deg)
        .iter()
        // The face reflects strong sound only, which begins and ends.
        .filter(|arrival| {
            arrival.path.mechanisms().all(|mechanism| mechanism != Mechanism::Transducer)
        })
        .map(|arrival| {
            let phase_rad = arrival.phase_rad - wave_number_per_m * arrival.length_m;
            num_complex::Complex64::from_polar(arrival.amplitude, phase_rad)
        })
        .sum()
}

#[test]
fn joint_in_a_wall_is_no_edge() {
    for reflectance in [1.0, 0.6, 0.3] {
        let whole = [
            wall("w", (-1.0, 0.0), (1.0, 0.0), reflectance),
            wall("side", (1.0, 0.0), (1.0, 2.0), reflectance),
        ];
        for off_m in [0.0, 1e-9, 1e-7, 1e-5] {
            let parts = [
                wall("a", (-1.0, 0.0), (0.1, 0.0), reflectance),
                wall("b", (0.1, off_m), (1.0, 0.0), reflectance),
                whole[1].clone(),
            ];
            for direction_deg in [-120.0, -90.0, -60.0, -30.0] {
                let at = DVec2::new(0.13, 0.5);
                let [meant, found] =
                    [&whole[..], &parts].map(|walls| field(walls, at, direction_deg));
                let bound = 1e-6 + 4e3 * off_m;
                assert!((found - meant).norm() < bound, "{reflectance} {off_m}: {meant} {found}");
            }
        }
    }
}

#[test]
fn materials_change_continuously() {
    let walls = |bend_m: f64| {
        [wall("a", (-1.0, 0.0), (0.0, 0.0), 1.0), wall("b", (0.0, 0.0), (1.0, bend_m), 0.3)]
    };
    let mut before = None;
    for step in -50..=50 {
        let at = DVec2::new((f64::from(step) + 0.37) * 1e-3, 0.5);
        let flat = field(&walls(0.0), at, -90.0);
        for bend_m in [1e-9, -1e-9] {
            let bent = field(&walls(bend_m), at, -90.0);
            assert!((bent - flat).norm() < 1e-5, "{step} {bend_m}: {flat} {bent}");
        }
        let jump = before.map_or(0.0, |before: num_complex::Complex64| (flat - before).norm());
        assert!(jump < 0.03, "{step}: {jump}");
        before = Some(flat);
    }
}

#[test]
fn squaring_ignores_splits() {
    let frame = DVec2::from_angle(0.317);
    let written = |x: f64, y: f64| {
        let at = (DVec2::new(x, y).rotate(frame) * 1e4).round() / 1e4;
        (at.x, at.y)
    };
    let corners = [written(0.0, 0.0), written(3.0, 0.0), written(3.0, 2.0), written(0.0, 2.0)];
    let whole: Vec<Wall> =
        (0..4).map(|i| wall(&format!("w{i}"), corners[i], corners[(i + 1) % 4], 0.9)).collect();
    let split: Vec<Wall> = whole
        .iter()
        .flat_map(|wall| {
            let at = |part: u32| wall.a.lerp(wall.b, f64::from(part) / 10.0);
            (0..10).map(move |part| Wall {
                id: format!("{}-{part}", wall.id).into(),
                a: at(part),
                b: at(part + 1),
                ..wall.clone()
            })
        })
        .collect();
    let [whole, split] = [whole, split].map(|walls| scene(walls).floor_plan().walls);
    for corner in 0..4 {
        let (one, other) = (whole[corner].0, split[10 * corner].0);
        assert!(one.distance(other) < 1e-8, "{corner}: {one} {other}");
        let (before, after) = (whole[(corner + 3) % 4], whole[corner]);
        let angle = (before.1 - before.0).angle_to(after.1 - after.0).to_degrees();
        assert!((angle - 90.0).abs() < 1e-8, "{corner}: {angle}");
    }
}

#[test]
fn intended_details_stay() {
    for walls in [
        // A gap that is an opening, a plate of 3 mm, and a wall shorter than the tolerance.
        vec![wall("a", (0.0, 0.0), (1.0, 0.0), 0.9), wall("b", (1.003, 0.0), (2.0, 0.0), 0.9)],
        vec![wall("a", (0.0, 0.0), (1.0, 0.0), 0.9), wall("b", (0.0, 0.003), (1.0, 0.003), 0.9)],
        vec![wall("a", (0.0, 0.0), (0.00014, 0.0), 0.9)],
        // A leg of 2 cm in sides of half a millimetre.
        (0..128)
            .map(|side| {
                let at = |side: i32| {
                    0.01 * DVec2::from_angle(f64::from(side) * std::f64::consts::TAU / 128.0)
                };
                Wall {
                    id: format!("s{side}").into(),
                    a: at(side),
                    b: at(side + 1),
                    ..wall("s", (0.0, 0.0), (1.0, 0.0), 0.9)
                }
            })
            .collect(),
    ] {
        let drawn = scene(walls);
        let plan = drawn.floor_plan();
        for (made, wall) in plan.walls.iter().zip(&drawn.walls) {
            assert!(
                made.0.distance(wall.a) < 1e-12 && made.1.distance(wall.b) < 1e-12,
                "{wall:?} {made:?}"
            );
        }
    }
}

#[test]
fn zero_tolerance_changes_nothing() {
    let mut random = Pcg64::seed_from_u64(8);
    let (sketch, _) = Sketch::random(&mut random);
    let mut drawn = sketch.drawn(&Hand::shaky(&mut random));
    drawn.snap_m = 0.0;
    let plan = drawn.floor_plan();
    assert!(plan.walls.iter().zip(&drawn.walls).all(|(made, wall)| *made == (wall.a, wall.b)));
}

/// Returns `true` if the readings of a beam are among those of the intended plan, moved by as much
/// as the hand moves it.
fn is_explained(beam: usize, found: &[Prediction], versions: &[Vec<Prediction>]) -> bool {
    const ROOM_M: f64 = 2e-3;
    let same = versions.iter().filter(|version| version[beam].status == found[beam].status);
    let ranges: Vec<Option<f64>> = same.map(|version| version[beam].range_m).collect();
    let Some(range_m) = found[beam].range_m else { return !ranges.is_empty() };
    let known = || ranges.iter().flatten().copied();
    let (low, high) = (known().fold(f64::INFINITY, f64::min), known().fold(0.0, f64::max));
    (low - ROOM_M..=high + ROOM_M).contains(&range_m)
}

/// Hand-drawn plans read as the intended ones, except for effects of the moved walls themselves:
/// those are in the readings of the intended plan with its corners moved by as much and all joints
/// kept.
#[test]
fn hand_drawn_plans() {
    let plans = std::env::var(MORE).map_or(50, |count| count.parse().expect("a number of plans"));
    let mut random = Pcg64::seed_from_u64(2026);
    let (mut beams, mut first, mut wrong) = (0, 0, 0);
    for plan in 0..plans {
        let (sketch, at) = Sketch::random(&mut random);
        let found = readings(&sketch.drawn(&Hand::shaky(&mut random)), at, EngineKind::Paths);
        let mut versions = vec![readings(&sketch.drawn(&Hand::steady()), at, EngineKind::Paths)];
        let open = |versions: &[Vec<Prediction>]| -> Vec<usize> {
            (0..found.len()).filter(|&beam| !is_explained(beam, &found, versions)).collect()
        };
        beams += found.len();
        let mut left = open(&versions);
        first += left.len();
        while !left.is_empty() && versions.len() < 40 {
            let moved = sketch.drawn(&Hand::careful(&mut random));
            versions.push(readings(&moved, at, EngineKind::Paths));
            left = open(&versions);
        }
        if !left.is_empty() {
            println!("plan {plan}: beams {left:?}");
        }
        wrong += left.len();
    }
    println!(
        "{wrong} of {beams} beams in {plans} plans are not explained by moved walls ({first} differ)"
    );
    assert!(wrong as f64 <= 1e-3 * beams as f64, "{wrong} of {beams}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// The repair ends, keeps walls near their places, and its result can be meshed and is stable.
    #[test]
    fn any_segments_make_a_plan(
        ends in prop::collection::vec([0_i32..40, 0_i32..40, 0_i32..40, 0_i32..40], 1..40),
        unit_m in prop::sample::select(vec![1e-4, 7e-4, 1e-3, 5e-3, 0.1]),
    ) {
        let walls: Vec<Wall> = ends
            .iter()
            .enumerate()
            .filter(|(_, [a, b, c, d])| (a, b) != (c, d))
            .map(|(index, ends)| {
                let [a, b, c, d] = ends.map(|at| f64::from(at) * unit_m);
                wall(&format!("w{index}"), (a, b), (c, d), 0.9)
            })
            .collect();
        let drawn = scene(walls);
        let plan = drawn.floor_plan();
        for (made, wall) in plan.walls.iter().zip(&drawn.walls) {
            prop_assert!(made.0.distance(wall.a) < 3.0 * DEFAULT_SNAP_M, "{wall:?} {made:?}");
            prop_assert!(made.1.distance(wall.b) < 3.0 * DEFAULT_SNAP_M, "{wall:?} {made:?}");
        }
        let mut turned = drawn.clone();
        turned.walls.reverse();
        turned.walls.iter_mut().for_each(|wall| std::mem::swap(&mut wall.a, &mut wall.b));
        let again = turned.floor_plan();
        for (one, other) in plan.walls.iter().zip(again.walls.iter().rev()) {
            prop_assert!(one.0 == other.1 && one.1 == other.0, "{one:?} {other:?}");
        }
        readings(&drawn, DVec2::splat(-0.05), EngineKind::Cone);
        let settings = crate::model::paths::PathSettings { max_path_m: 0.3, ..crate::model::paths::tests::LOSSLESS };
        let found = crate::model::paths::Paths::new(&drawn, settings).enumerate(DVec2::splat(-0.05));
        prop_assert!(found.iter().flatten().all(|echo| echo.length_m.is_finite()));
    }
}

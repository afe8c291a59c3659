//! Every listed path is physically possible.

use rand::RngExt;
use sonard_model::{
    acoustics::edge::MAX_KA,
    geometry::{DVec2, wrap_pi},
    model::{
        Mechanism, Reflector,
        paths::{EchoPath, PathSettings},
    },
};

use crate::worlds::*;

/// Tolerance for touching, metres.
const TOUCH_M: f64 = 1e-7;

fn polyline(world: &World, echo: &EchoPath) -> Vec<DVec2> {
    echo.path.polyline(world.ends)
}

#[test]
fn lengths_and_directions_of_legs() {
    for (kind, name) in [(FURNISHED, "length"), (WITH_LEGS_PAIR, "length legs")] {
        on_random_worlds(name, kind, |world, _| {
            for echo in world.echoes(&settings()) {
                let line = polyline(world, &echo);
                let legs_m = line.windows(2).map(|leg| leg[0].distance(leg[1])).sum::<f64>();
                assert!((legs_m - echo.length_m).abs() < 1e-8, "{echo:?} is {legs_m} m long");
                let leaves = (line[1] - line[0]).to_angle();
                let comes = (line[line.len() - 2] - line[line.len() - 1]).to_angle();
                assert!(wrap_pi(leaves - echo.departure_rad).abs() < 1e-6, "{echo:?}");
                assert!(wrap_pi(comes - echo.arrival_rad).abs() < 1e-6, "{echo:?}");
            }
        });
    }
}

#[test]
fn law_of_reflection() {
    for (kind, name) in [(FURNISHED_PAIR, "mirror law"), (WITH_LEGS, "mirror law legs")] {
        on_random_worlds(name, kind, |world, _| {
            for echo in world.echoes(&settings()) {
                let line = polyline(world, &echo);
                for (turn, interaction) in line.windows(3).zip(echo.path.interactions.iter()) {
                    let Mechanism::Reflection(surface) = interaction.mechanism else { continue };
                    let normal = normal_at(world, surface, interaction.point);
                    let [to, from] = [turn[1] - turn[0], turn[2] - turn[1]].map(DVec2::normalize);
                    let mirrored = to - 2.0 * to.dot(normal) * normal;
                    assert!(mirrored.distance(from) < 1e-5, "{echo:?} at {surface:?}");
                }
            }
        });
    }
}

/// Normal of a surface at a point, which must be on it.
fn normal_at(world: &World, surface: Reflector, at: DVec2) -> DVec2 {
    match surface {
        Reflector::Wall(wall) => {
            let [a, b] = world.walls[wall as usize].ends;
            let along = (b - a).normalize();
            let share = (at - a).dot(along) / a.distance(b);
            assert!(along.perp_dot(at - a).abs() < TOUCH_M, "{at} is off wall {wall}");
            assert!((-TOUCH_M..1.0 + TOUCH_M).contains(&share), "{at} is past wall {wall}");
            along.perp()
        }
        Reflector::Cylinder(round) => {
            let Round { center, radius_m, .. } = world.rounds[round as usize];
            assert!((at.distance(center) - radius_m).abs() < TOUCH_M, "{at} is off {round}");
            (at - center).normalize()
        }
        Reflector::Floor | Reflector::Ceiling => panic!("there is none"),
    }
}

#[test]
fn paths_are_clear_of_obstacles() {
    let crowded = Kind { partitions: 0, rounds: 3, ..FURNISHED };
    let deep = PathSettings { floor: 0.004, max_path_m: 3.0, ..settings() };
    for (kind, name, settings) in [
        (FURNISHED_PAIR, "clear", settings()),
        (WITH_LEGS_PAIR, "clear legs", settings()),
        (crowded, "clear crowd", deep),
    ] {
        on_random_worlds(name, kind, |world, _| {
            for echo in world.echoes(&settings) {
                let line = polyline(world, &echo);
                line.windows(2).for_each(|leg| assert_clear(world, [leg[0], leg[1]], &echo));
            }
        });
    }
}

/// Three cylinders in the open, each of which hides some of the others.
#[test]
fn paths_by_three_cylinders() {
    let listed =
        PathSettings { floor: 1e-3, absorption_np_per_m: 0.0, max_path_m: 8.0, ..settings() };
    for case in 0..cases() {
        let mut random = generator("three", case);
        let mut world =
            World { walls: Vec::new(), rounds: Vec::new(), ends: [DVec2::ZERO; 2], heights: None };
        while world.rounds.len() < 3 {
            let center = DVec2::new(random.random_range(-0.9..0.9), random.random_range(-0.9..0.9));
            let radius_m = random.random_range(0.03..0.2);
            let gap_m = |other: &Round| other.center.distance(center) - other.radius_m - radius_m;
            let is_free = center.length() > radius_m + 0.03;
            if is_free && world.rounds.iter().all(|other| gap_m(other) > 0.02) {
                world.rounds.push(Round { center, radius_m, reflectance: 1.0, z_m: None });
            }
        }
        for echo in world.echoes(&listed) {
            let line = polyline(&world, &echo);
            line.windows(2).for_each(|leg| assert_clear(&world, [leg[0], leg[1]], &echo));
        }
    }
}

/// Between the ends of a leg no wall is crossed except a narrow one, and no cylinder entered.
#[track_caller]
fn assert_clear(world: &World, [from, to]: [DVec2; 2], echo: &EchoPath) {
    let (run, length_m) = (to - from, from.distance(to));
    for (number, wall) in world.walls.iter().enumerate() {
        let [a, b] = wall.ends;
        let across = run.perp_dot(b - a);
        let share = (a - from).perp_dot(b - a) / across;
        let along = (a - from).perp_dot(run) / across;
        // A tie or more off both ends of the leg, and of the wall. Sound passes a narrow strip.
        let is_strip = a.distance(b) < STRIP_M;
        let inside = |share: f64, of_m: f64| (TOUCH_M..of_m - TOUCH_M).contains(&(share * of_m));
        let crosses = !is_strip && inside(share, length_m) && inside(along, a.distance(b));
        assert!(!crosses, "{echo:?} crosses wall {number} of {}", world.text());
    }
    // Sound passes a post, too.
    let most_m = MAX_KA / settings().wave_number_per_m;
    let thick = |round: &&Round| round.radius_m > most_m;
    for (number, round) in world.rounds.iter().filter(thick).enumerate() {
        let share = ((round.center - from).dot(run) / run.length_squared()).clamp(0.0, 1.0);
        let off_m = (from + share * run).distance(round.center);
        let deep_m = round.radius_m - off_m;
        assert!(deep_m < TOUCH_M, "{echo:?} is {deep_m} m in cylinder {number}: {}", world.text());
    }
}

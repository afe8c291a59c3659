//! Level edges.

use std::f64::consts::{FRAC_PI_2, PI};

use num_complex::Complex64;

use super::{
    half_plane::{K, Spot, keller, macdonald},
    *,
};
use crate::model::{Mechanism, Reflector};

pub(super) fn at_height(z_m: f64) -> PathSettings {
    PathSettings {
        sensor_z_m: Some(z_m),
        max_path_m: 8.0,
        edge_law: Some(EdgeLaw::Utd),
        ..LOSSLESS
    }
}

pub(super) fn is_by_level_edge(echo: &EchoPath) -> bool {
    matches!(diffractors(&echo.path)[..], [Diffractor::Level { .. }])
}

/// Pressure of an echo relative to a source's at 1 m.
pub(super) fn pressure(echo: &EchoPath) -> Complex64 {
    Complex64::from_polar(echo.amplitude / echo.length_m, echo.phase_rad - K * echo.length_m)
}

/// A wall from the floor to 0.3 m, 1 m away.
fn low_wall() -> Scene {
    let mut plan = scene(&[[-2.0, 1.0, 2.0, 1.0]]);
    plan.floor_z_m = Some(0.0);
    plan.walls[0].z_m = Some([0.0, 0.3]);
    plan
}

/// Diffraction at the upper edge of a wall.
fn top_of(wall: u32) -> Mechanism {
    Mechanism::Diffraction(Diffractor::Level { wall, is_upper: true })
}

fn by_level_edges(plan: &Scene, at: DVec2, z_m: f64) -> Vec<EchoPath> {
    let mut echoes = Paths::new(plan, at_height(z_m)).enumerate(at).expect("few paths");
    echoes.retain(is_by_level_edge);
    echoes
}

#[test]
fn upper_edge_of_a_low_wall() {
    for (z_m, exact) in [(0.9, 3e-3), (1.3, 3e-3), (0.5, 3e-2)] {
        let mut found = by_level_edges(&low_wall(), DVec2::new(0.4, 0.0), z_m);
        found.retain(|echo| !reflectors(&echo.path).contains(&Reflector::Floor));
        assert_eq!(found.len(), 1, "{found:?}");
        let distance_m = 1_f64.hypot(z_m - 0.3);
        assert!((found[0].length_m - 2.0 * distance_m).abs() < 1e-12);
        assert!((found[0].rise_rad[0] + (z_m - 0.3).atan()).abs() < 1e-12);
        assert!((found[0].departure_rad - FRAC_PI_2).abs() < 1e-9);
        assert_eq!(found[0].path.mechanisms().collect::<Vec<_>>(), [top_of(0)]);
        let keller = keller([1_f64.atan2(0.3 - z_m); 2], 0.5 * distance_m);
        assert!((found[0].amplitude / keller - 1.0).abs() < exact, "{z_m}: {found:?} {keller}");
    }
    // No echo beyond the wall's end, and none over a wall as high as the ranger.
    assert!(by_level_edges(&low_wall(), DVec2::new(2.1, 0.0), 0.9).is_empty());
    let mut hidden = low_wall();
    hidden.walls.push(Wall {
        a: DVec2::new(-2.0, 0.5),
        b: DVec2::new(2.0, 0.5),
        z_m: Some([0.0, 0.89]),
        ..hidden.walls[0].clone()
    });
    let mut found = by_level_edges(&hidden, DVec2::new(0.4, 0.0), 0.9);
    found.retain(|echo| !reflectors(&echo.path).contains(&Reflector::Floor));
    assert_eq!(
        found.iter().flat_map(|echo| echo.path.mechanisms()).collect::<Vec<_>>(),
        [top_of(1)]
    );
}

/// The ranger rises past the edge: the wall's echo ends, and with the edge's nothing jumps.
#[test]
fn upper_edge_is_continuous() {
    let field = |z_m: f64| {
        let settings = PathSettings { max_path_m: 2.3, ..at_height(z_m) };
        let echoes = Paths::new(&low_wall(), settings).enumerate(DVec2::ZERO).expect("few paths");
        // Without arrivals by the floor.
        let level =
            echoes.iter().filter(|echo| !reflectors(&echo.path).contains(&Reflector::Floor));
        level
            .map(|e| Complex64::from_polar(e.amplitude, e.phase_rad - K * (e.length_m - 2.0)))
            .sum::<Complex64>()
    };
    let fields: Vec<_> = (0..=400).map(|i| field(0.2 + 0.0005 * f64::from(i))).collect();
    for (i, pair) in fields.windows(2).enumerate() {
        let step = (pair[1] - pair[0]).norm();
        assert!(step < 0.03, "a jump of {step} at {}", 0.2 + 0.0005 * i as f64);
    }
    assert!((fields[200].norm() - 0.5).abs() < 0.01, "{}", fields[200]);
    assert!(fields[400].norm() < 0.1 && (fields[0].norm() - 1.0).abs() < 0.15);
}

/// Out or back by the floor: the edge's own field between the two images' heights.
#[test]
fn images_by_the_floor() {
    let (d, top) = (0.9, 0.35);
    let mut room = scene(&[[-40.0, 0.0, 40.0, 0.0]]);
    room.floor_z_m = Some(0.0);
    room.floor_material = Material::smooth(0.8);
    room.walls[0].z_m = Some([0.0, top]);
    let at = DVec2::new(0.3, -d);
    for z_m in [0.1, 0.34, 0.6, 1.1] {
        let mut echoes = Paths::new(&room, at_height(z_m)).enumerate(at).expect("few paths");
        echoes.retain(is_by_level_edge);
        assert_eq!(echoes.len(), 4, "{echoes:?}");
        for echo in &echoes {
            let (floor_rad, edge_rad) = (-((z_m + top) / d).atan(), ((top - z_m) / d).atan());
            let [out_below, back_below] = echo.rise_rad.map(|rise_rad| {
                let is_near = |rad: f64| (rise_rad - rad).abs() < 1e-12;
                assert!(is_near(floor_rad) || is_near(edge_rad), "{echo:?}");
                is_near(floor_rad)
            });
            let spot = |below: bool| Spot::above(at, if below { -z_m } else { z_m } - top);
            let exact: Complex64 =
                macdonald(spot(out_below), spot(back_below)).iter().map(|part| part[1]).sum();
            let gain = 0.8_f64.powi(i32::from(out_below) + i32::from(back_below));
            let off = (pressure(echo) - gain * exact).norm() * echo.length_m;
            assert!(off < 0.003, "{z_m}: {echo:?} {exact} {off}");
            let floors = usize::from(out_below) + usize::from(back_below);
            assert_eq!(reflectors(&echo.path), vec![Reflector::Floor; floors]);
            let mechanisms: Vec<_> = echo.path.mechanisms().collect();
            assert_eq!(mechanisms[usize::from(out_below)], top_of(0), "{echo:?}");
        }
    }
    // On the floor itself the ranger is its own image: four times the edge's field.
    room.floor_material = Material::RIGID;
    let mut echoes = Paths::new(&room, at_height(0.0)).enumerate(at).expect("few paths");
    echoes.retain(is_by_level_edge);
    let all: Complex64 = echoes.iter().map(pressure).sum();
    let distance_m = d.hypot(top);
    let around_rad = d.atan2(top);
    let expected = 4.0 * keller([around_rad; 2], 0.5 * distance_m) / (2.0 * distance_m);
    assert!((all.norm() / expected - 1.0).abs() < 0.02, "{} {expected}", all.norm());
}

/// Where a low wall joins a high one, its level edge continues in the mirror. The path out straight
/// and back by the high wall is diffracted in the corner, slantwise, and with the floor on one leg
/// next to it.
#[test]
fn slantwise_at_a_high_wall() {
    let (x, d, z_m, top) = (0.5, 1.0, 0.6, 0.3);
    let mut room = scene(&[[0.0, -3.0, 0.0, 3.0], [0.0, 0.0, 4.0, 0.0]]);
    room.floor_z_m = Some(0.0);
    room.walls[1].z_m = Some([0.0, top]);
    let (high, floor) = (Reflector::Wall(0), Reflector::Floor);
    let echoes = Paths::new(&room, at_height(z_m)).enumerate(DVec2::new(x, -d)).expect("few paths");
    let slant: Vec<_> = echoes
        .iter()
        .filter(|e| is_by_level_edge(e) && reflectors(&e.path).contains(&high))
        .collect();
    let [above_m, below_m] = [z_m - top, z_m + top];
    let [above, below] = [d.hypot(above_m), d.hypot(below_m)];
    for (offs, angles, floors, count) in [
        ([above, above], [above_m, above_m], 0, 1),
        ([above, below], [above_m, -below_m], 1, 2),
        ([below, below], [-below_m, -below_m], 2, 1),
    ] {
        let length_m = (offs[0] + offs[1]).hypot(2.0 * x);
        let found: Vec<_> = slant.iter().filter(|e| (e.length_m - length_m).abs() < 1e-9).collect();
        assert_eq!(found.len(), count, "{slant:#?}");
        let around_rad = angles.map(|above_m: f64| d.atan2(-above_m));
        let amplitude = keller(around_rad, offs[0] * offs[1] / length_m);
        for echo in found {
            assert!((echo.amplitude / amplitude - 1.0).abs() < 0.03, "{echo:?} {amplitude}");
            let (floor, high) = (Mechanism::Reflection(floor), Mechanism::Reflection(high));
            let mechanisms: Vec<_> =
                echo.path.mechanisms().filter(|mechanism| *mechanism != floor).collect();
            assert!(mechanisms == [top_of(1), high] || mechanisms == [high, top_of(1)], "{echo:?}");
            assert_eq!(echo.path.order(), 1 + floors);
        }
    }
    assert_eq!(slant.len(), 4, "{slant:#?}");
    // By the floor it bends next to the corner, nearer to the foot of the shorter leg.
    let position_m = x * (below - above) / (below + above);
    let side = slant.iter().find(|e| e.path.order() == 2).expect("one by the floor");
    let direct_rad = d.atan2(position_m - x);
    let ends = [side.departure_rad, side.arrival_rad];
    assert!(ends.iter().any(|end_rad| (end_rad - direct_rad).abs() < 1e-9), "{side:?}");
}

/// Walls of many heights between floor and ceiling.
fn furnished() -> Scene {
    let mut room = scene(&[
        [-2.0, -1.5, 2.2, -1.5],
        [2.2, -1.5, 2.2, 1.7],
        [2.2, 1.7, -2.0, 1.7],
        [-2.0, 1.7, -2.0, -1.5],
        [-0.4, 0.8, 0.9, 1.0],
        [0.9, 0.2, 1.4, -0.9],
        [-1.2, -0.8, -1.1, 0.6],
    ]);
    (room.floor_z_m, room.ceiling_z_m) = (Some(0.0), Some(2.3));
    room.floor_material = Material::smooth(0.9);
    for (wall, limits) in [(4, [0.0, 0.41]), (5, [0.37, 1.2]), (6, [1.1, 2.3])] {
        room.walls[wall].z_m = Some(limits);
    }
    room
}

/// Length, amplitude and phase of echoes by level edges, and both directions in a frame.
fn summaries(echoes: &[EchoPath], turn: impl Fn(f64) -> f64) -> Vec<[f64; 7]> {
    let mut found: Vec<[f64; 7]> = echoes
        .iter()
        .filter(|echo| is_by_level_edge(echo) && echo.amplitude > 2e-3)
        .map(|e| {
            let [out, back] = [e.departure_rad, e.arrival_rad].map(&turn);
            let [up, down] = e.rise_rad;
            let angle = |rad: f64| crate::geometry::wrap_pi(rad);
            [e.length_m, e.amplitude, e.phase_rad, angle(out), angle(back), up, down]
        })
        .collect();
    let key = |a: &[f64; 7]| [a[0], a[3], a[5]].map(|x| (x * 1e6).round() as i64);
    found.sort_by_key(key);
    found
}

fn assert_same(first: &[[f64; 7]], second: &[[f64; 7]]) {
    assert_eq!(first.len(), second.len());
    for (a, b) in first.iter().zip(second) {
        let off = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6, "{a:?} {b:?}");
    }
}

const T: DVec2 = DVec2::new(0.13, -0.21);
const R: DVec2 = DVec2::new(-0.35, 0.17);

/// Weaker echoes are not compared, so that none is lost at the floor of the settings.
fn in_the_room(z_m: f64) -> PathSettings {
    PathSettings { max_path_m: 5.0, floor: 1e-3, ..at_height(z_m) }
}

#[test]
fn ends_are_interchangeable() {
    let paths = Paths::new(&furnished(), in_the_room(0.77));
    let there = summaries(&paths.enumerate_between(T, R).expect("few paths"), |angle| angle);
    let mut back = paths.enumerate_between(R, T).expect("few paths");
    for echo in &mut back {
        std::mem::swap(&mut echo.departure_rad, &mut echo.arrival_rad);
        echo.rise_rad.reverse();
    }
    assert!(there.len() > 30, "{}", there.len());
    assert_same(&there, &summaries(&back, |angle| angle));
    // From one place each path arrives in both directions.
    let here = paths.enumerate(T).expect("few paths");
    let mut reverse = here.clone();
    for echo in &mut reverse {
        std::mem::swap(&mut echo.departure_rad, &mut echo.arrival_rad);
        echo.rise_rad.reverse();
    }
    assert_same(&summaries(&here, |angle| angle), &summaries(&reverse, |angle| angle));
}

#[test]
fn rigid_motions_change_nothing() {
    let plain =
        Paths::new(&furnished(), in_the_room(0.77)).enumerate_between(T, R).expect("few paths");
    let plain = summaries(&plain, |angle| angle);
    let frame = DVec2::from_angle(0.83);
    let moved = |p: DVec2| DVec2::new(7.0, -3.0) + frame.rotate(p);
    let mirrored = |p: DVec2| DVec2::new(-p.x, p.y);
    let at = |place: &dyn Fn(DVec2) -> DVec2| {
        let mut room = furnished();
        for wall in &mut room.walls {
            (wall.a, wall.b) = (place(wall.a), place(wall.b));
        }
        Paths::new(&room, in_the_room(0.77))
            .enumerate_between(place(T), place(R))
            .expect("few paths")
    };
    assert_same(&plain, &summaries(&at(&moved), |angle| angle - 0.83));
    assert_same(&plain, &summaries(&at(&mirrored), |angle| PI - angle));
    // Upside down, too.
    let mut room = furnished();
    for limits in room.walls.iter_mut().filter_map(|wall| wall.z_m.as_mut()) {
        *limits = [2.3 - limits[1], 2.3 - limits[0]];
    }
    std::mem::swap(&mut room.floor_material, &mut room.ceiling_material);
    let mut turned =
        Paths::new(&room, in_the_room(2.3 - 0.77)).enumerate_between(T, R).expect("few paths");
    for echo in &mut turned {
        echo.rise_rad = echo.rise_rad.map(|rise| -rise);
    }
    assert_same(&plain, &summaries(&turned, |angle| angle));
}

/// Each edge of a plate that floats at the ranger's height returns an echo, at the same time.
#[test]
fn both_edges_of_a_plate() {
    let mut plan = low_wall();
    plan.walls[0].z_m = Some([0.6, 1.2]);
    let found = by_level_edges(&plan, DVec2::ZERO, 0.9);
    let near = found.iter().filter(|echo| echo.path.interactions.len() == 1);
    assert_eq!(near.count(), 2, "{found:?}");
}

/// A wall that another one touches is cut there. Where its level edge diffracts at the cut it does
/// so once.
#[test]
fn pieces_are_one_edge() {
    let whole = by_level_edges(&low_wall(), DVec2::new(0.25, 0.0), 0.9);
    let mut cut = low_wall();
    // Ends behind the wall at the foot of the perpendicular, so low that it hides nothing.
    cut.walls.push(Wall {
        a: DVec2::new(0.25, 1.0),
        b: DVec2::new(0.3, 1.4),
        z_m: Some([0.0, 0.01]),
        ..cut.walls[0].clone()
    });
    let mut pieces = by_level_edges(&cut, DVec2::new(0.25, 0.0), 0.9);
    pieces.retain(|e| matches!(diffractors(&e.path)[..], [Diffractor::Level { wall: 0, .. }]));
    assert_eq!(pieces.len(), whole.len(), "{pieces:#?}");
}

/// Heights at which mirrored paths begin or end, and the jump of the sum of all sound there.
fn jumps(plan: &Scene, heights_m: [f64; 2], [from, to]: [DVec2; 2]) -> Vec<(f64, f64, f64)> {
    let echoes = |z_m: f64| {
        let settings = PathSettings { max_order: Some(2), floor: 1e-6, ..at_height(z_m) };
        Paths::new(plan, settings).enumerate_between(from, to).expect("few paths")
    };
    // Long paths fade, so that none enters the reach at once.
    let fade = |length_m: f64| 0.5 + 0.5 * (PI * (length_m / 6.0).min(1.0)).cos();
    let sum = |echoes: &[EchoPath]| -> Complex64 {
        echoes
            .iter()
            .map(|e| {
                fade(e.length_m) * Complex64::from_polar(e.amplitude, e.phase_rad - K * e.length_m)
            })
            .sum()
    };
    let mirrored = |echoes: &[EchoPath]| {
        let mut paths: Vec<_> = echoes
            .iter()
            .filter(|e| diffractors(&e.path).is_empty() && e.length_m < 6.0)
            .map(|e| reflectors(&e.path).to_vec())
            .collect();
        paths.sort();
        paths
    };
    let steps = 100;
    let height = |step: i32| {
        heights_m[0] + (heights_m[1] - heights_m[0]) * f64::from(step) / f64::from(steps)
    };
    let mut found = Vec::new();
    for step in 0..steps {
        let [mut low, mut high] = [height(step), height(step + 1)];
        let [below, above] = [low, high].map(|z_m| mirrored(&echoes(z_m)));
        if below == above {
            continue;
        }
        while high - low > 1e-8 {
            let middle = 0.5 * (low + high);
            if mirrored(&echoes(middle)) == below { low = middle } else { high = middle }
        }
        let [before, after] = [low, high].map(echoes);
        let mirrors = |echoes: &[EchoPath]| {
            let mut echoes = echoes.to_vec();
            echoes.retain(|echo| diffractors(&echo.path).is_empty());
            sum(&echoes)
        };
        let alone = (mirrors(&before) - mirrors(&after)).norm();
        found.push((low, alone, (sum(&before) - sum(&after)).norm()));
    }
    found
}

/// Where sound begins to pass over a low wall, on its way out or back, by the floor or not, level
/// edges take over by halves. Sound that grazes the wall both ways at once would be diffracted
/// twice there, and the remaining jump is of that size (0.04 of 0.5).
#[test]
fn passing_over_is_continuous() {
    let mut room = scene(&[[-9.0, 0.6, 9.0, 0.6], [-9.0, 1.5, 9.0, 1.5]]);
    room.floor_z_m = Some(0.0);
    room.walls[0].z_m = Some([0.0, 0.3]);
    let [here, there] = [DVec2::ZERO, DVec2::new(0.5, -0.35)];
    let apart = jumps(&room, [0.3137, 1.4], [here, there]);
    assert!(apart.len() >= 2, "{apart:?}");
    for (z_m, alone, jump) in apart {
        assert!(alone > 0.3 && jump < 1e-3, "a jump of {jump} for {alone} at {z_m}");
    }
    let twice = jumps(&room, [0.2137, 1.4], [here, here]);
    assert!(twice.len() >= 2, "{twice:?}");
    for (z_m, alone, jump) in twice {
        assert!(alone > 0.4 && jump < 0.1 * alone, "a jump of {jump} for {alone} at {z_m}");
    }
}

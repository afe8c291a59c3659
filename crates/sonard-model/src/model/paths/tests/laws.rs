//! Laws that hold in any scene.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::*;

/// A cluttered room: slanted walls, a free-standing plate and a box.
fn clutter() -> Vec<[f64; 4]> {
    vec![
        [0.0, 0.0, 3.1, 0.2],
        [3.1, 0.2, 2.8, 2.4],
        [2.8, 2.4, 0.3, 2.6],
        [0.3, 2.6, 0.0, 0.0],
        [1.9, 0.9, 2.2, 1.4],
        [0.7, 1.6, 1.1, 1.7],
        [1.1, 1.7, 1.05, 2.0],
        [1.05, 2.0, 0.65, 1.9],
        [0.65, 1.9, 0.7, 1.6],
    ]
}

fn settings() -> PathSettings {
    PathSettings {
        max_path_m: 9.0,
        floor: 1e-3,
        edge_law: Some(EdgeLaw::Utd),
        absorption_np_per_m: 0.19,
        ..LOSSLESS
    }
}

const AT: DVec2 = DVec2::new(1.3, 0.6);

#[test]
fn paths_are_reciprocal() {
    let echoes = Paths::new(&scene(&clutter()), settings()).enumerate(AT).expect("few paths");
    assert!(echoes.len() > 100, "{}", echoes.len());
    for echo in &echoes {
        let backwards: Vec<_> = echo.path.mechanisms().rev().collect();
        let found = echoes.iter().any(|other| {
            other.path.mechanisms().eq(backwards.iter().copied())
                && (other.length_m - echo.length_m).abs() < 1e-10
                && (other.amplitude - echo.amplitude).abs() < 1e-9
                && wrap(other.phase_rad - echo.phase_rad).abs() < 1e-6
                && wrap(other.departure_rad - echo.arrival_rad).abs() < 1e-9
                && wrap(other.arrival_rad - echo.departure_rad).abs() < 1e-9
        });
        assert!(found, "no reverse of {echo:?}");
    }
}

fn wrap(angle: f64) -> f64 {
    crate::geometry::wrap_pi(angle)
}

#[test]
fn rigid_motions_change_nothing() {
    let here = Paths::new(&scene(&clutter()), settings()).enumerate(AT).expect("few paths");
    for (turn, shift, mirrored) in
        [(0.7, DVec2::new(31.0, -8.0), false), (PI, DVec2::ZERO, true), (4.4, DVec2::X, true)]
    {
        let to = |x: f64, y: f64| {
            let y = if mirrored { -y } else { y };
            shift + DVec2::new(x, y).rotate(DVec2::from_angle(turn))
        };
        let walls: Vec<_> = clutter()
            .iter()
            .map(|&[ax, ay, bx, by]| {
                let (a, b) = (to(ax, ay), to(bx, by));
                [a.x, a.y, b.x, b.y]
            })
            .collect();
        let there =
            Paths::new(&scene(&walls), settings()).enumerate(to(AT.x, AT.y)).expect("few paths");
        assert_eq!(here.len(), there.len());
        for (first, second) in here.iter().zip(&there) {
            assert!((first.length_m - second.length_m).abs() < 1e-9);
        }
        let sum = |echoes: &[EchoPath]| echoes.iter().map(|e| e.amplitude).sum::<f64>();
        assert!((sum(&here) - sum(&there)).abs() < 1e-6);
    }
}

#[test]
fn echoes_turn_with_the_world() {
    let turn = 0.7;
    let rotor = DVec2::from_angle(turn);
    let walls: Vec<_> = clutter()
        .iter()
        .map(|&[ax, ay, bx, by]| {
            let (a, b) = (DVec2::new(ax, ay).rotate(rotor), DVec2::new(bx, by).rotate(rotor));
            [a.x, a.y, b.x, b.y]
        })
        .collect();
    let here = Paths::new(&scene(&clutter()), settings()).enumerate(AT).expect("few paths");
    let there =
        Paths::new(&scene(&walls), settings()).enumerate(AT.rotate(rotor)).expect("few paths");
    for one in &here {
        let found = there.iter().any(|other| {
            other.path.mechanisms().eq(one.path.mechanisms())
                && wrap(other.departure_rad - one.departure_rad - turn).abs() < 1e-9
        });
        assert!(found, "{one:?}");
    }
}

#[test]
fn no_energy_gain() {
    let lossless = PathSettings { absorption_np_per_m: 0.0, ..settings() };
    let loud = Paths::new(&scene(&clutter()), lossless).enumerate(AT).expect("few paths");
    assert!(loud.iter().all(|echo| echo.amplitude <= 1.0 + 1e-12));

    let with = |reflectance: f64, absorption_np_per_m: f64| {
        let mut plan = scene(&clutter());
        for wall in &mut plan.walls {
            wall.material.reflectance = reflectance;
        }
        Paths::new(&plan, PathSettings { absorption_np_per_m, ..settings() })
            .enumerate(AT)
            .expect("few paths")
    };
    let steps = [(1.0, 0.0), (0.9, 0.0), (0.9, 0.1), (0.5, 0.1), (0.5, 0.5)];
    for pair in steps.windows(2) {
        let (more, less) = (with(pair[0].0, pair[0].1), with(pair[1].0, pair[1].1));
        for echo in less.iter().filter(|echo| echo.path.kind() == PathKind::Specular) {
            let before = more.iter().find(|other| other.path == echo.path);
            let before = before.unwrap_or_else(|| panic!("{echo:?} comes out of nothing"));
            assert!(echo.amplitude < before.amplitude);
        }
    }
}

#[test]
fn wider_limits_only_add() {
    let plan = scene(&clutter());
    let few = Paths::new(&plan, settings()).enumerate(AT).expect("few paths");
    let more = PathSettings { floor: 2e-4, max_path_m: 11.0, ..settings() };
    let many = Paths::new(&plan, more).enumerate(AT).expect("few paths");
    let kept: Vec<_> =
        many.iter().filter(|e| e.amplitude >= 1e-3 && e.length_m <= 9.0).cloned().collect();
    assert_eq!(few.len(), kept.len());
    assert!(many.len() > few.len());
}

/// Opens a corner from 80 to 100 degrees: two echoes through both walls become none. With the
/// edge's share, nothing jumps.
#[test]
fn opening_corner_is_continuous() {
    let (range, k) = (0.8, LOSSLESS.wave_number_per_m);
    let field = |opening_deg: f64| {
        let opening = opening_deg.to_radians();
        let b = 9.0 * DVec2::from_angle(opening);
        let corner = scene(&[[0.0, 0.0, 9.0, 0.0], [b.x, b.y, 0.0, 0.0]]);
        let at = range * DVec2::from_angle(0.6);
        let settings = PathSettings { max_path_m: 1.7, edge_law: Some(EdgeLaw::Utd), ..LOSSLESS };
        let echoes = Paths::new(&corner, settings).enumerate(at).expect("few paths");
        // The echoes of the single walls are shorter.
        let of_corner = echoes.iter().filter(|echo| echo.length_m > 1.5);
        of_corner
            .map(|echo| {
                Complex64::from_polar(
                    echo.amplitude,
                    echo.phase_rad + k * (2.0 * range - echo.length_m),
                )
            })
            .sum::<Complex64>()
    };
    let steps = 4000;
    let at = |i: i32| field(80.0 + 20.0 * f64::from(i) / f64::from(steps));
    let fields: Vec<Complex64> = (0..=steps).map(at).collect();
    for (i, pair) in fields.windows(2).enumerate() {
        let step = (pair[1] - pair[0]).norm();
        assert!(step < 0.06, "a jump of {step} at {}", 80.0 + 20.0 * i as f64 / f64::from(steps));
    }
    assert!((fields[0].norm() - 2.0).abs() < 0.1, "{}", fields[0]);
    assert!((fields[steps as usize / 2] - 1.0).norm() < 1e-9);
    assert!(fields[steps as usize].norm() < 0.12, "{}", fields[steps as usize]);
}

#[test]
fn degenerate_places() {
    let plan = scene(&clutter());
    let paths = Paths::new(&plan, settings());
    for at in [DVec2::ZERO, DVec2::new(1.55, 0.1), DVec2::new(1e4, 0.0), DVec2::new(1.9, 0.9)] {
        let echoes = paths.enumerate(at).expect("few paths");
        assert!(echoes.iter().all(|echo| echo.length_m.is_finite() && echo.amplitude.is_finite()));
    }
    assert!(Paths::new(&scene(&[]), settings()).enumerate(AT).expect("few paths").is_empty());
}

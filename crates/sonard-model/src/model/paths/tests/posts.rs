//! Thin cylinders, which sound passes.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::*;
use crate::{acoustics::edge::post::series, scene::Cylinder};

fn post(center: DVec2, radius_m: f64) -> Cylinder {
    let material = Material::RIGID;
    Cylinder { id: Arc::from("leg"), center, radius_m, material, z_m: None }
}

fn settings() -> PathSettings {
    PathSettings { floor: 1e-9, edge_law: Some(EdgeLaw::Utd), max_path_m: 5.0, ..LOSSLESS }
}

/// Sum of all arrivals, relative to the field of a head-on wall over `length_m`.
fn field(paths: &Paths, ends: [DVec2; 2], length_m: f64) -> Complex64 {
    let k = paths.plan.settings.wave_number_per_m;
    let echoes = paths.enumerate_between(ends[0], ends[1]).expect("few paths");
    let echo = |echo: &EchoPath| {
        let relative = length_m / echo.length_m;
        Complex64::from_polar(
            relative * echo.amplitude,
            echo.phase_rad + k * (length_m - echo.length_m),
        )
    };
    echoes.iter().map(echo).sum()
}

/// Direct sound and post together, across the shadow and all around, compared with the exact
/// series.
#[test]
fn field_matches_exact_series() {
    let k = LOSSLESS.wave_number_per_m;
    let transmitter = DVec2::new(-0.6, 0.0);
    let mut worst: f64 = 0.0;
    for radius_m in [0.003, 0.008, 0.015] {
        let mut scene = scene(&[]);
        scene.cylinders = vec![post(DVec2::ZERO, radius_m)];
        let paths = Paths::new(&scene, PathSettings { direct: true, ..settings() });
        for step in 0..72 {
            let receiver = 0.9 * DVec2::from_angle(f64::from(step).to_radians() * 5.0 + 0.01);
            let straight_m = transmitter.distance(receiver);
            let found = field(&paths, [transmitter, receiver], straight_m);
            let between_rad = transmitter.angle_to(receiver);
            let by_m = 0.6 + 0.9;
            let round = series(radius_m, k, [0.6, 0.9], between_rad);
            let relative = straight_m / by_m * Complex64::cis(k * (straight_m - by_m));
            worst = worst.max((found - 1.0 - relative * round).norm());
        }
    }
    assert!(worst < 0.01, "{worst}");
}

/// A leg of 2 cm half way to a wall removes a part of its echo, at any position: no jump where it
/// enters the line.
#[test]
fn leg_shadows_part_of_an_echo() {
    let wall = [2.0, -3.0, 2.0, 3.0];
    let at = DVec2::ZERO;
    let level = |leg_y_m: f64| {
        let mut scene = scene(&[wall]);
        scene.cylinders = vec![post(DVec2::new(1.0, leg_y_m), 0.01)];
        let paths = Paths::new(&scene, settings());
        let echoes = paths.enumerate(at).expect("few paths");
        // The pulses of the others have ended, or have not begun.
        let near = echoes.into_iter().filter(|echo| (3.9..4.1).contains(&echo.length_m));
        let k = LOSSLESS.wave_number_per_m;
        let sum = near.map(|e| Complex64::from_polar(e.amplitude, e.phase_rad - k * e.length_m));
        sum.sum::<Complex64>().norm()
    };
    let across: Vec<f64> = (-200..=200).map(|mm| level(1e-3 * f64::from(mm))).collect();
    let steepest = across.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(steepest < 0.12, "{steepest}");
    // Out past it and back past it.
    let once = series(0.01, LOSSLESS.wave_number_per_m, [1.0, 3.0], PI);
    let expected = (1.0 + 2.0 * once).norm();
    assert!((0.8..0.9).contains(&expected));
    assert!((level(0.0) - expected).abs() < 1e-3, "{} {expected}", level(0.0));
}

/// Near a wall, or thick, a cylinder remains a mirror with a shadow.
#[test]
fn thick_or_near_is_no_post() {
    for (center, radius_m, is_post) in [
        ((1.0, 0.0), 0.01, true),
        ((1.95, 0.0), 0.01, true),
        ((1.98, 0.0), 0.01, false),
        ((1.0, 0.0), 0.02, false),
    ] {
        let mut scene = scene(&[[2.0, -3.0, 2.0, 3.0]]);
        scene.cylinders = vec![post(center.into(), radius_m)];
        let echoes = Paths::new(&scene, settings()).enumerate(DVec2::ZERO).expect("few paths");
        let diffractors = |echo: &EchoPath| {
            echo.path.diffractors().any(|diffractor| matches!(diffractor, Diffractor::Post { .. }))
        };
        assert_eq!(echoes.iter().any(diffractors), is_post, "{center:?} {radius_m}");
    }
}

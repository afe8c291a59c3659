use std::f64::consts::TAU;

use num_complex::Complex64;

use super::*;
use crate::{
    acoustics::{BeamPattern, Disc, Face, Sensor},
    geometry::DVec2,
    model::paths::{
        echo::{PathEcho, Via},
        pattern::PatternEnvelope,
        settings::PathSettings,
    },
};

const DISC: Disc = Disc {
    face: Face { radius_m: 0.0215, reflectance: 1.0 },
    wave_number_per_m: TAU * 49_400.0 / 343.99,
};

fn settings(max_path_m: f64) -> PathSettings {
    PathSettings {
        max_path_m,
        max_order: None,
        floor: 1e-3,
        repeated_contact_ratio: 1.0,
        unrestricted_m: 0.0,
        edge_law: None,
        double_diffraction: false,
        absorption_np_per_m: 0.0,
        wave_number_per_m: DISC.wave_number_per_m,
        sensor_z_m: None,
        tilt_rad: 0.0,
        scatter_height_rad: 0.0,
        direct: false,
    }
}

/// Multiple echoes between a face and one head-on wall, by number of paths from 2.
fn before_a_wall(disc: Disc, path_m: f64, direction_rad: f64) -> Vec<MultipleEcho> {
    let echo = PathEcho {
        length_m: path_m,
        amplitude: 1.0,
        phase_rad: 0.0,
        departure: DVec2::X,
        arrival: DVec2::X,
        rise_rad: [0.0; 2],
        image: 0,
        slopes: [0; 2],
        is_repeated: false,
        via: Via::Walls { node: 0 },
    };
    let beam = BeamPattern::new(&Sensor::preset("senscomp-6500").expect("a preset"), 343.99);
    let mut multiple_echoes =
        FaceEchoes::new(disc, &[echo], &PatternEnvelope::new(&beam), &settings(4.5 * path_m))
            .multiple_echoes(direction_rad, &beam, settings(0.0).floor, 4.5 * path_m);
    multiple_echoes.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
    multiple_echoes
}

/// Middle of the field that has run `paths` times between a point on a disc's axis, an infinite
/// wall and the disc: Kirchhoff's integral, reflection by reflection.
fn kirchhoff(path_m: f64, paths: usize) -> f64 {
    const RINGS: usize = 120;
    let k = DISC.wave_number_per_m;
    let a = DISC.face.radius_m;
    let radius = |ring: usize| a * ((ring as f64 + 0.5) / RINGS as f64).sqrt();
    let area = a * a / 2.0 / RINGS as f64;
    let step = |from: f64, to: f64| {
        Complex64::new(0.0, k / path_m * area)
            * libm::j0(k * from * to / path_m)
            * Complex64::cis(-k * (from * from + to * to) / (2.0 * path_m))
    };
    let point = |r: f64| Complex64::cis(-k * r * r / (2.0 * path_m)) / path_m;
    let mut field: Vec<Complex64> = (0..RINGS).map(|ring| point(radius(ring))).collect();
    for _ in 2..paths {
        let next = |to: f64| (0..RINGS).map(|ring| step(radius(ring), to) * field[ring]).sum();
        field = (0..RINGS).map(|ring| next(radius(ring))).collect();
    }
    let middle: Complex64 = (0..RINGS).map(|ring| step(radius(ring), 0.0) * field[ring]).sum();
    middle.norm() * paths as f64 * path_m
}

#[test]
fn wall_matches_kirchhoff() {
    for (path_m, most_db) in [(0.188, [0.1, 2.1, 3.9]), (0.4, [0.1, 0.6, 1.15])] {
        let multiple_echoes = before_a_wall(DISC, path_m, 0.0);
        assert_eq!(multiple_echoes.len(), 3);
        for ((echo, paths), most_db) in multiple_echoes.iter().zip(2..).zip(most_db) {
            assert!((echo.length_m - path_m * paths as f64).abs() < 1e-12);
            let off_db = 20.0 * (echo.amplitude / kirchhoff(path_m, paths)).log10();
            assert!(off_db.abs() < most_db, "{paths} of {path_m} m: {off_db} dB");
        }
    }
}

#[test]
fn reflectance_and_turning() {
    let dull = Disc { face: Face { reflectance: 0.5, ..DISC.face }, ..DISC };
    let (bright, dull) = (before_a_wall(DISC, 0.3, 0.0), before_a_wall(dull, 0.3, 0.0));
    for ((a, b), reflections) in bright.iter().zip(&dull).zip(1..) {
        assert!((b.amplitude / a.amplitude - 0.5_f64.powi(reflections)).abs() < 1e-12);
    }
    let turned = before_a_wall(DISC, 0.3, 6_f64.to_radians());
    assert!(turned[0].amplitude < 0.3 * bright[0].amplitude);
    assert!(before_a_wall(DISC, 0.3, 3.0).is_empty());
    // A wall that touches the face is left to the ringing of the transducer.
    assert!(before_a_wall(DISC, 0.04, 0.0).is_empty());
}

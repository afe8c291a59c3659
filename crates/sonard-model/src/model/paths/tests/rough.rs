//! Rough walls.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;
use crate::{
    acoustics::{BeamPattern, Sensor},
    model::Engine,
};

const HEIGHT_RAD: f64 = 0.16;

/// Power that a long wall at 1 m scatters towards a ranger that points `aside_rad` past its normal.
fn power(reflectance: f64, roughness: f64, aside_rad: f64, sensor: &Sensor) -> (f64, f64) {
    let mut plan = scene(&[[-40.0, 1.0, 40.0, 1.0]]);
    plan.walls[0].material = Material { reflectance, roughness };
    let settings = PathSettings { scatter_height_rad: HEIGHT_RAD, floor: 1e-7, ..LOSSLESS };
    let beam = BeamPattern::new(sensor, 343.99);
    let engine = PathEngine::new(&plan, beam, None, settings);
    let arrivals =
        engine.arrivals_at(DVec2::ZERO).expect("few paths").arrivals(FRAC_PI_2 - aside_rad);
    let of = |kind: PathKind| {
        arrivals.iter().filter(|a| a.path.kind() == kind).map(|a| a.amplitude.powi(2)).sum()
    };
    (of(PathKind::Specular), of(PathKind::Scattered))
}

/// The patches together follow Lambert's law over the beam.
#[test]
fn patches_add_up_to_lambert() {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let beam = BeamPattern::new(&sensor, 343.99);
    for aside_deg in [0.0_f64, 30.0, 60.0] {
        let aside_rad = aside_deg.to_radians();
        let (_, found) = power(0.9, 0.5, aside_rad, &sensor);
        let steps = 20_000;
        let expected: f64 = (0..steps)
            .map(|i| (f64::from(i) + 0.5) / f64::from(steps) * PI - FRAC_PI_2)
            .map(|b| {
                let share = 4.0 / PI * 0.5 * 0.81 * b.cos() * HEIGHT_RAD;
                share * beam.one_way(b - aside_rad).powi(4) * PI / f64::from(steps)
            })
            .sum();
        assert!((found / expected - 1.0).abs() < 0.01, "{aside_deg}: {found} {expected}");
    }
}

#[test]
fn only_rough_walls_echo_aslant() {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let loud = |roughness: f64| power(0.9, roughness, 1.0, &sensor).1.sqrt() > sensor.threshold;
    assert!(loud(0.6));
    assert!(!loud(0.0));
    // Towards a mirror it fades away, as the roughness does.
    let (mirrored, scattered) = power(0.9, 1e-6, 0.0, &sensor);
    assert!((mirrored - 0.81).abs() < 1e-5);
    let more = power(0.9, 2e-6, 0.0, &sensor).1;
    assert!((more / scattered - 2.0).abs() < 0.1, "{more} {scattered}");
    assert!(scattered < 1e-6);
}

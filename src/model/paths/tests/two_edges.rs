//! Sound that bends at two edges.

use num_complex::Complex64;
use serde::Deserialize;

use super::*;

#[derive(Deserialize)]
struct Vectors {
    wave_number_per_m: f64,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    /// Corners counter-clockwise.
    bodies: Vec<Vec<[f64; 2]>>,
    source: [f64; 2],
    /// Place and field, real and imaginary part.
    field: Vec<[f64; 4]>,
}

impl Vectors {
    fn load() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/peers/two_edges.json");
        let text = std::fs::read_to_string(path).expect("vectors");
        serde_json::from_str(&text).expect("vectors")
    }

    fn settings(&self, double_diffraction: bool) -> Settings {
        Settings {
            max_path_m: 3.0,
            floor: 1e-7,
            edge_law: Some(EdgeLaw::Utd),
            double_diffraction,
            wave_number_per_m: self.wave_number_per_m,
            ..LOSSLESS
        }
    }
}

impl Case {
    fn plan(&self) -> Scene {
        let walls: Vec<[f64; 4]> = self
            .bodies
            .iter()
            .flat_map(|body| body.iter().zip(body.iter().cycle().skip(1)))
            .map(|(&[ax, ay], &[bx, by])| [ax, ay, bx, by])
            .collect();
        scene(&walls)
    }

    /// Relative errors of the field, each with the share that single diffraction and mirrors make.
    fn errors(&self, settings: &Settings) -> Vec<(DVec2, f64, f64)> {
        let plan = self.plan();
        let paths = Paths::new(&plan, settings.clone());
        let source = DVec2::from_array(self.source);
        let errors = self.field.iter().map(|&[x, y, re, im]| {
            let at = DVec2::new(x, y);
            let here = field(&plan, &paths, source, at);
            let known = Complex64::new(re, im);
            (at, known.norm(), (here - known).norm())
        });
        errors.collect()
    }
}

/// Field at a receiver over that of a cylindrical wave at 1 m, the straight way included.
fn field(plan: &Scene, paths: &Paths, source: DVec2, at: DVec2) -> Complex64 {
    let k = paths.settings.wave_number_per_m;
    let wave = |length_m: f64, amplitude: f64, phase_rad: f64| {
        Complex64::from_polar(amplitude / length_m.sqrt(), phase_rad - k * length_m)
    };
    let bent: Complex64 = paths
        .enumerate_between(source, at)
        .iter()
        .map(|echo| wave(echo.length_m, echo.amplitude, echo.phase_rad))
        .sum();
    let is_hidden = plan.walls.iter().any(|wall| {
        let side = |a: DVec2, b: DVec2, p: DVec2| (b - a).perp_dot(p - a) > 0.0;
        side(source, at, wall.a) != side(source, at, wall.b)
            && side(wall.a, wall.b, source) != side(wall.a, wall.b, at)
    });
    if is_hidden { bent } else { bent + wave(source.distance(at), 1.0, 0.0) }
}

/// Against boundary integrals (tests/peers/two_edges.py).
#[test]
fn the_field_behind_two_edges_is_that_of_boundary_integrals() {
    let vectors = Vectors::load();
    for case in &vectors.cases {
        for double in [false, true] {
            let mut errors = case.errors(&vectors.settings(double));
            if std::env::var_os("SONARD_VERBOSE").is_some() {
                for (at, known, error) in &errors {
                    println!("{} {double} {at} {known:.5} {error:.5}", case.name);
                }
            }
            errors.sort_by(|a, b| a.2.total_cmp(&b.2));
            let n = errors.len();
            println!(
                "{}, {double}: error {:.4} (median), {:.4} (90 %), {:.4} (most)",
                case.name,
                errors[n / 2].2,
                errors[n * 9 / 10].2,
                errors[n - 1].2
            );
        }
    }
}

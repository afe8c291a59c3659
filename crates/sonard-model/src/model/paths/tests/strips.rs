//! Narrow free-standing walls.

use num_complex::Complex64;

use super::*;

/// Sum of the echoes of an isolated wall, from 0.5 m off its middle.
fn field(walls: &[[f64; 4]], at: DVec2, settings: &PathSettings) -> f64 {
    let echoes = Paths::new(&scene(walls), settings.clone()).enumerate(at).expect("few paths");
    let k = settings.wave_number_per_m;
    let echo = |e: &EchoPath| Complex64::from_polar(e.amplitude, e.phase_rad - k * e.length_m);
    echoes.iter().map(echo).sum::<Complex64>().norm()
}

fn settings() -> PathSettings {
    PathSettings { floor: 1e-9, edge_law: Some(EdgeLaw::Utd), max_path_m: 3.0, ..LOSSLESS }
}

/// Levels of a boundary integral in the plane, as in `acoustics::edge::strip`: a hair of 0.14 mm, a
/// quarter, a half and a whole wavelength.
#[test]
fn strip_matches_boundary_integral() {
    let wavelength_m = TAU / LOSSLESS.wave_number_per_m;
    for (wavelengths, levels) in [
        (0.0202, [0.000168, 0.000126]),
        (0.25, [0.033469, 0.023801]),
        (0.5, [0.110769, 0.068753]),
        (1.0, [0.159482, 0.044537]),
    ] {
        for (angle_deg, expected) in [90.0_f64, 60.0].into_iter().zip(levels) {
            let half_m = 0.5 * wavelengths * wavelength_m;
            let at = 0.5 * DVec2::from_angle(angle_deg.to_radians());
            let whole = field(&[[-half_m, 0.0, half_m, 0.0]], at, &settings());
            let off_db = 20.0 * (whole / expected).log10();
            assert!(off_db.abs() < 0.15, "{wavelengths} {angle_deg}: {whole} {expected}");
            // In pieces and from the other end it is the same.
            let cut_m = 0.3 * half_m;
            let pieces = [[cut_m, 0.0, -half_m, 0.0], [cut_m, 0.0, half_m, 0.0]];
            let pieces = field(&pieces, at, &settings());
            assert!((pieces / whole - 1.0).abs() < 1e-6, "{pieces} {whole}");
        }
    }
}

/// In front of a wall a hair is negligible, wherever the mirror's point is.
#[test]
fn hair_is_negligible() {
    let wall = [-2.0, 1.0, 2.0, 1.0];
    let settings = PathSettings { max_path_m: 2.2, ..settings() };
    let empty = field(&[wall], DVec2::ZERO, &settings);
    for x_m in [0.0, 0.000_03, 0.1, 0.4] {
        let hair = [x_m - 0.000_05, 0.5, x_m + 0.000_05, 0.5];
        let with = field(&[wall, hair], DVec2::ZERO, &settings);
        assert!((with / empty - 1.0).abs() < 2e-3, "{x_m}: {with} {empty}");
    }
}

/// Equal with one and two diffractions: a strip's own field includes the sound along it.
#[test]
fn no_double_diffraction() {
    let double = PathSettings { double_diffraction: true, ..settings() };
    let strip = [[-0.002, 0.0, 0.002, 0.0]];
    let at = DVec2::new(0.2, 0.4);
    let [single, twice] = [settings(), double].map(|settings| field(&strip, at, &settings));
    assert!((single - twice).abs() < 1e-12, "{single} {twice}");
}

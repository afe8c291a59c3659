//! Scenes whose echoes are known in closed form.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;

/// Two walls from the origin, `opening_rad` apart, effectively infinite.
fn dihedral(opening_rad: f64, turn_rad: f64) -> Scene {
    let end = |angle: f64| 60.0 * DVec2::from_angle(turn_rad + angle);
    let (a, b) = (end(0.0), end(opening_rad));
    scene(&[[0.0, 0.0, a.x, a.y], [b.x, b.y, 0.0, 0.0]])
}

#[test]
fn wall_head_on() {
    let mut wall = scene(&[[-1.0, 0.5, 4.0, 0.5]]);
    wall.walls[0].material = Material { reflectance: 0.9, roughness: 0.19 };
    let settings = PathSettings { absorption_np_per_m: 0.2, ..LOSSLESS };
    for side in [-1.0, 1.0] {
        let at = DVec2::new(0.3, 0.5 + side * 0.7);
        let echoes = Paths::new(&wall, settings.clone()).enumerate(at).expect("few paths");
        assert_eq!(echoes.len(), 1);
        assert!((echoes[0].length_m - 1.4).abs() < 1e-12);
        assert!((echoes[0].departure_rad + side * FRAC_PI_2).abs() < 1e-12);
        // Roughness takes a share of the energy, so 0.9 times 0.9 of the amplitude remains.
        assert!((echoes[0].amplitude - 0.81 * f64::exp(-0.28)).abs() < 1e-12);
    }
    // Past the end of the wall, only that end returns an echo.
    assert!(
        Paths::new(&wall, settings).enumerate(DVec2::new(-1.2, 0.0)).expect("few paths").is_empty()
    );
}

#[test]
fn right_angled_corner_has_one_echo() {
    for turn in [0.0, 0.3, 1.234, 4.0] {
        let at = 0.8 * DVec2::from_angle(turn + 0.61);
        let settings = PathSettings { max_path_m: 10.0, edge_law: Some(EdgeLaw::Utd), ..LOSSLESS };
        let echoes =
            Paths::new(&dihedral(FRAC_PI_2, turn), settings).enumerate(at).expect("few paths");
        let double: Vec<_> = echoes.iter().filter(|e| reflectors(&e.path).len() == 2).collect();
        assert_eq!((echoes.len(), double.len()), (3, 1));
        assert!((double[0].length_m - 1.6).abs() < 1e-12);
        assert!((double[0].departure_rad - double[0].arrival_rad).abs() < 1e-12);
        assert!((double[0].amplitude - 1.0).abs() < 1e-12);
    }
}

/// In a dihedral of `opening` the images of a source at `angle` are at `2 N opening +- angle`.
/// Those less than half a turn away are visible, and one exactly half a turn away through the
/// vertex.
#[test]
fn dihedral_images() {
    for opening_deg in [22.5, 30.0, 36.0, 45.0, 50.0, 60.0, 72.0, 80.0, 90.0, 100.0, 135.0, 170.0] {
        let opening = f64::to_radians(opening_deg);
        for share in [0.21, 0.37, 0.83] {
            let (angle, turn) = (share * opening, 0.7);
            let at = 1.3 * DVec2::from_angle(turn + angle);
            let settings = PathSettings { max_path_m: 4.0, ..LOSSLESS };
            let echoes =
                Paths::new(&dihedral(opening, turn), settings).enumerate(at).expect("few paths");
            let mut expected: Vec<f64> = (-20..=20)
                .flat_map(|n| {
                    let shift = 2.0 * f64::from(n) * opening;
                    [shift, shift - 2.0 * angle]
                })
                .filter(|apart| apart.abs() > 1e-12 && apart.abs() < PI + 1e-9)
                .map(|apart| 2.6 * (apart.abs() / 2.0).sin())
                .collect();
            if (PI / opening) % 2.0 == 0.0 {
                // Plus and minus half a turn are the same image.
                expected.sort_by(f64::total_cmp);
                expected.pop();
            }
            expected.sort_by(f64::total_cmp);
            assert_eq!(echoes.len(), expected.len(), "{opening_deg} degrees at {share}");
            for (echo, length_m) in echoes.iter().zip(expected) {
                assert!((echo.length_m - length_m).abs() < 1e-11, "{opening_deg} at {share}");
            }
        }
    }
}

#[test]
fn straight_joints_are_invisible() {
    // The foot of the normal is exactly on a joint.
    let wall = scene(&[[-3.0, 0.0, 0.25, 0.0], [0.25, 0.0, 0.3, 0.0], [0.3, 0.0, 4.0, 0.0]]);
    let settings = PathSettings { edge_law: Some(EdgeLaw::Utd), max_path_m: 4.0, ..LOSSLESS };
    for x in [0.25, 0.26, 0.3] {
        let echoes =
            Paths::new(&wall, settings.clone()).enumerate(DVec2::new(x, 0.9)).expect("few paths");
        assert_eq!(echoes.len(), 1, "{x}: {echoes:?}");
        assert!((echoes[0].length_m - 1.8).abs() < 1e-12);
    }
}

#[test]
fn wall_end_is_half_a_wall() {
    let wall = scene(&[[0.0, 0.0, 9.0, 0.0]]);
    let settings = PathSettings { edge_law: Some(EdgeLaw::Utd), max_path_m: 4.0, ..LOSSLESS };
    let echoes = Paths::new(&wall, settings).enumerate(DVec2::new(0.0, 0.5)).expect("few paths");
    assert_eq!(echoes.len(), 2);
    let total: f64 = echoes.iter().map(|echo| echo.amplitude * echo.phase_rad.cos()).sum();
    assert!((total - 0.5).abs() < 0.02, "{total}");
}

#[test]
fn edge_along_its_wall() {
    // Facing the end of a plate: only the near end is visible.
    let wall = scene(&[[0.0, 0.0, 1.0, 0.0]]);
    let settings = PathSettings { edge_law: Some(EdgeLaw::KucSiegel), ..LOSSLESS };
    let echoes = Paths::new(&wall, settings).enumerate(DVec2::new(-0.5, 0.0)).expect("few paths");
    assert_eq!(echoes.len(), 1);
    let end = Diffractor::Upright(Edge { wall: 0, at_b: false });
    assert_eq!(diffractors(&echoes[0].path)[..], [end]);
    assert!((echoes[0].length_m - 1.0).abs() < 1e-12);
}

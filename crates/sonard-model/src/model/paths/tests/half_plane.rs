//! Level edges compared with the exact field of a rigid half plane.

use std::f64::consts::{FRAC_PI_4, PI};

use num_complex::Complex64;

use super::{
    level_edges::{at_height, is_by_level_edge, pressure},
    *,
};

pub(super) const K: f64 = LOSSLESS.wave_number_per_m;

/// Far below everything: a floor enables heights, and its echoes are out of reach.
const DEEP_M: f64 = -50.0;

/// A place around an edge: distance, angle from the face, and position along it.
#[derive(Clone, Copy)]
pub(super) struct Spot {
    pub(super) off_m: f64,
    pub(super) around_rad: f64,
    pub(super) along_m: f64,
}

impl Spot {
    /// Next to the upper edge of a wall along x through the origin; the wall's face points to -y.
    pub(super) fn above(place: DVec2, above_m: f64) -> Self {
        let around_rad = (-place.y).atan2(-above_m).rem_euclid(TAU);
        Self { off_m: place.y.hypot(above_m), around_rad, along_m: place.x }
    }
}

/// Field of a point source at a rigid half plane: Macdonald's solution (Proc. London Math. Soc. 14,
/// 1915), for the source and for its image in the plane each
///
/// ```text
/// -(i k / 2) int_{-m}^inf H1(k sqrt(R^2 + u^2)) / sqrt(R^2 + u^2) du
/// m = 2 sqrt(r r') cos((p -+ p') / 2)
/// ```
///
/// for `exp(+i omega t)`, with Hankel's function of the second kind and the distance `R` from it.
/// The whole line would be `exp(-i k R) / R`. That term counts where a straight path exists
/// (`m > 0`), and the rest is the edge's. In pairs: straight part, edge's part.
pub(super) fn macdonald(source: Spot, place: Spot) -> [[Complex64; 2]; 2] {
    [-1.0, 1.0].map(|sign| {
        let turned_rad = place.around_rad + sign * source.around_rad;
        let product = place.off_m * source.off_m;
        let m = 2.0 * product.sqrt() * (0.5 * turned_rad).cos();
        let along_m = place.along_m - source.along_m;
        let edge_m = (place.off_m + source.off_m).hypot(along_m);
        let straight_m = (edge_m * edge_m - m * m).sqrt();
        let straight = Complex64::cis(-K * straight_m) / straight_m;
        let rest = tail(m.abs(), edge_m);
        if m >= 0.0 { [straight, -rest] } else { [Complex64::ZERO, rest] }
    })
}

/// The integral from `m` on, down the slope from the edge's path: at
/// `sqrt(R^2 + u^2) = edge - i t^2 / k` it decreases as `exp(-t^2)`.
fn tail(m: f64, edge_m: f64) -> Complex64 {
    const STEPS: i32 = 20_000;
    const TO: f64 = 6.0;
    let step = TO / f64::from(STEPS);
    let middles = (0..STEPS).map(|i| (f64::from(i) + 0.5) * step);
    let sum: Complex64 = middles
        .map(|t| {
            let past = Complex64::new(0.0, -t * t / K);
            let u = (m * m + (2.0 * edge_m + past) * past).sqrt();
            2.0 * t * hankel(K * (edge_m + past)) / u
        })
        .sum();
    -0.5 * step * sum
}

/// Hankel's function of order 1 and the second kind, far out (Abramowitz and Stegun, 9.2.8).
fn hankel(z: Complex64) -> Complex64 {
    let i = Complex64::I;
    let series = 1.0 - i * (3.0 / 8.0) / z + (15.0 / 128.0) / (z * z);
    (2.0 / (PI * z)).sqrt() * (-i * (z - 3.0 * FRAC_PI_4)).exp() * series
}

/// On the edge a half plane changes nothing, far in its shadow there is no field, and the edge's
/// part approaches Keller's.
#[test]
fn exact_field_limits() {
    let source = Spot { off_m: 0.9, around_rad: 1.1, along_m: 0.0 };
    let near = Spot { off_m: 1e-12, around_rad: 2.0, along_m: 0.6 };
    let all: Complex64 = macdonald(source, near).iter().flatten().sum();
    let distance_m = 0.9_f64.hypot(0.6);
    let free = Complex64::cis(-K * distance_m) / distance_m;
    assert!((all / free - 1.0).norm() < 2e-4, "{}", all / free);

    let dark = Spot { off_m: 0.7, around_rad: 6.0, along_m: 0.6 };
    let bent: Complex64 = macdonald(source, dark).iter().map(|part| part[1]).sum();
    let length_m = 1.6_f64.hypot(0.6);
    let keller = keller([1.1, 6.0], 0.9 * 0.7 / length_m) / length_m;
    assert!((bent.norm() / keller - 1.0).abs() < 5e-3, "{bent} {keller}");
    assert!(macdonald(source, dark).iter().all(|part| part[0] == Complex64::ZERO));
}

/// Keller's coefficient of a rigid half plane over the root of the distance parameter (1962,
/// equation (14), there for the plane's other sign).
pub(super) fn keller([in_rad, out_rad]: [f64; 2], distance_m: f64) -> f64 {
    let share = |angle_rad: f64| 1.0 / (0.5 * angle_rad).cos();
    let shares = share(out_rad - in_rad) + share(out_rad + in_rad);
    shares.abs() / (2.0 * (TAU * K * distance_m).sqrt())
}

/// A wall along x, effectively infinite, up to 0 above a deep floor.
fn half_plane() -> Scene {
    let mut plan = scene(&[[-40.0, 0.0, 40.0, 0.0]]);
    plan.floor_z_m = Some(DEEP_M);
    plan.walls[0].z_m = Some([DEEP_M, 0.0]);
    plan
}

/// Direct path, mirrored path and level edge together, for oblique pairs on one side of the wall
/// and on both, through all boundaries: off by 3e-5 of the direct sound at most.
#[test]
fn field_matches_macdonald() {
    let source = DVec2::new(0.2, -0.8);
    for target in [
        DVec2::new(0.2, -0.5),
        DVec2::new(1.3, -0.6),
        DVec2::new(-1.9, -1.4),
        DVec2::new(0.2, 0.9),
        DVec2::new(1.1, 0.7),
        DVec2::new(-1.6, 0.5),
    ] {
        for step in -60..=60 {
            let above_m = 0.01 * f64::from(step) + 1e-4;
            let settings = PathSettings { floor: 1e-9, ..at_height(above_m) };
            let echoes = Paths::new(&half_plane(), settings)
                .enumerate_between(source, target)
                .expect("few paths");
            assert_eq!(
                echoes.iter().filter(|echo| is_by_level_edge(echo)).count(),
                1,
                "{echoes:?}"
            );
            let [from, to] = [source, target].map(|place| Spot::above(place, above_m));
            let parts = macdonald(from, to);
            let exact: Complex64 = parts.iter().flatten().sum();
            let found = parts[0][0] + echoes.iter().map(pressure).sum::<Complex64>();
            let off = (found - exact).norm() * source.distance(target);
            assert!(off < 5e-5, "{target} {above_m}: {found} {exact}");
        }
    }
}

use super::{images::ON_BOUNDARY_RAD, *};

const C: f64 = 343.2;
const K: f64 = TAU * 49_400.0 / C;

fn half_plane() -> Wedge {
    Wedge { opening_rad: TAU, reflectance: [1.0; 2] }
}

fn right_edge() -> Wedge {
    Wedge { opening_rad: 1.5 * PI, reflectance: [1.0; 2] }
}

fn back(range_m: f64, aspect_deg: f64) -> Aspect {
    let angle = aspect_deg.to_radians();
    Aspect { in_rad: angle, out_rad: angle, distance_m: range_m / 2.0 }
}

/// Single-edge table of the full-wave reference computed for this project
/// (tests/data/fullwave/README.md): wedge, range, aspect, exact, UTD, Kuc-Siegel. The table has
/// three or fewer digits and a band around the carrier, hence the tolerance.
#[test]
fn utd_matches_full_wave() {
    let table = [
        (half_plane(), 0.5, 125.0, 0.00987, 0.00979, Some(0.01876)),
        (half_plane(), 0.3, 125.0, 0.01274, 0.01264, None),
        (half_plane(), 1.0, 125.0, 0.00692, 0.00692, None),
        (half_plane(), 0.5, 160.0, 0.00085, 0.00085, None),
        (right_edge(), 0.47, 125.0, 0.02284, 0.02271, Some(0.01935)),
        (right_edge(), 0.3, 135.0, 0.02636, 0.02618, None),
        (right_edge(), 1.0, 135.0, 0.01434, 0.01434, None),
    ];
    for (wedge, range, aspect, exact, utd, kuc) in table {
        let found = EdgeLaw::Utd.echo(&wedge, &back(range, aspect), K).norm();
        for reference in [exact, utd] {
            let error_db = 20.0 * (found / reference).log10();
            assert!(
                error_db.abs() < 0.075,
                "{range} m, {aspect} deg: {found} is {error_db} dB off"
            );
        }
        if let Some(kuc) = kuc {
            let found = EdgeLaw::KucSiegel.echo(&wedge, &back(range, aspect), K).norm();
            assert!((found - kuc).abs() < 1e-5, "{range} m: {found}, not {kuc}");
        }
    }
}

#[test]
fn half_field_at_the_boundary() {
    // The mirror echo counts as visible there. The reference has 0.483: the difference is of higher
    // order.
    let edge = EdgeLaw::Utd.echo(&half_plane(), &back(0.5, 90.0), K);
    let total = (1.0 + edge).norm();
    assert!((total - 0.483).abs() < 0.015, "{total}");
}

#[test]
fn field_is_continuous() {
    for opening_deg in [70.0, 80.0, 100.0, 137.0, 200.0, 270.0, 330.0, 360.0] {
        for reflectance in [[1.0, 1.0], [0.9, 0.4]] {
            let wedge = Wedge { opening_rad: f64::to_radians(opening_deg), reflectance };
            let jump = largest_step(&wedge);
            assert!(jump < 0.02, "{opening_deg} degrees, {reflectance:?}: jump of {jump}");
        }
    }
}

/// Maximum step of mirror images plus edge for a receiver on a circle around the edge.
fn largest_step(wedge: &Wedge) -> f64 {
    // A fifth of the wave number: slow image phases compared with the steps.
    let (k, in_rad) = (K / 5.0, 0.3 * wedge.opening_rad);
    let steps = 100_000;
    let at = |i: u32| {
        let out_rad = wedge.opening_rad * f64::from(i) / f64::from(steps);
        let (s, t) = (0.8, 0.5);
        let aspect = Aspect { in_rad, out_rad, distance_m: s * t / (s + t) };
        // The edge's echo travels s + t; each image's path is shorter by the law of cosines.
        let mut field = EdgeLaw::Utd.echo(wedge, &aspect, k);
        for number in -6..=6_i32 {
            for mirrored in [false, true] {
                let sign = if mirrored { -1.0 } else { 1.0 };
                let from = 2.0 * f64::from(number) * wedge.opening_rad + sign * in_rad;
                let apart = (out_rad - from).abs();
                if apart < PI + ON_BOUNDARY_RAD / 2.0 {
                    let path = (s * s + t * t - 2.0 * s * t * apart.cos()).sqrt();
                    let spreading = ((s + t) / path).sqrt();
                    let phase = Complex64::cis(k * (s + t - path));
                    field += wedge.image_reflectance(number, mirrored) * spreading * phase;
                }
            }
        }
        field
    };
    let mut last = at(1);
    (2..steps).fold(0.0, |largest: f64, i| {
        let next = at(i);
        let step = (next - last).norm();
        last = next;
        largest.max(step)
    })
}

#[test]
fn corner_limit_is_one_echo() {
    for closed_by in [1e-3, 1e-5, 1e-7] {
        let echo = |opening_rad: f64| {
            let wedge = Wedge { opening_rad, reflectance: [1.0; 2] };
            EdgeLaw::Utd.echo(&wedge, &back(1e-3, 35.0), K / 1e-3)
        };
        // Two mirror echoes below 90 degrees, none above; with the edge the total is one on both
        // sides.
        let (below, above) = (echo(PI / 2.0 - closed_by), echo(PI / 2.0 + closed_by));
        assert!((2.0 + below - 1.0).norm() < 40.0 * closed_by.sqrt(), "{below}");
        assert!((above - 1.0).norm() < 40.0 * closed_by.sqrt(), "{above}");
    }
    let corner = Wedge { opening_rad: PI / 2.0, reflectance: [1.0; 2] };
    assert_eq!(EdgeLaw::Utd.echo(&corner, &back(0.8, 35.0), K), Complex64::ZERO);
}

#[test]
fn laws_are_reciprocal() {
    let wedge = Wedge { opening_rad: 4.1, reflectance: [0.9, 0.5] };
    let there = Aspect { in_rad: 0.7, out_rad: 3.3, distance_m: 0.4 };
    let back = Aspect { in_rad: 3.3, out_rad: 0.7, ..there };
    for law in [EdgeLaw::Utd, EdgeLaw::KucSiegel] {
        assert!((law.echo(&wedge, &there, K) - law.echo(&wedge, &back, K)).norm() < 1e-14);
    }
}

#[test]
fn bound_is_never_exceeded() {
    for opening in [1.2, 1.7, 3.5, 4.712, TAU] {
        let wedge = Wedge { opening_rad: opening, reflectance: [0.95, 0.8] };
        for i in 1..200 {
            for j in 1..200 {
                let aspect = Aspect {
                    in_rad: opening * f64::from(i) / 200.0,
                    out_rad: opening * f64::from(j) / 200.0,
                    distance_m: 0.3,
                };
                let (echo, bound) =
                    (EdgeLaw::Utd.echo(&wedge, &aspect, K), EdgeLaw::Utd.bound(&wedge, &aspect, K));
                assert!(echo.norm() <= bound * (1.0 + 1e-9) + 1e-12, "{aspect:?}");
            }
        }
    }
}

/// Compared with the integral on a contour where it does not oscillate: `F(x) = 2 i sqrt(x) e^(-i
/// pi/4) int_0^inf exp(-u^2 - 2 sqrt(x) e^(i pi/4) u) du`.
#[test]
fn transition_matches_its_integral() {
    for x in [1e-6, 0.01, 0.3, 1.0, 2.9, 3.1, 5.5, 10.0, 29.0, 31.0, 300.0, 1e5] {
        let root = f64::sqrt(x);
        let decay = 2.0 * root * Complex64::cis(FRAC_PI_4);
        let integrand = |u: f64| (-u * u - decay * u).exp();
        let last = 6.0 / (1.0 + root / 4.0);
        let steps = 20_000;
        let h = last / f64::from(steps);
        let sum: Complex64 = (0..=steps)
            .map(|i| {
                let weight = if i == 0 || i == steps { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                weight * integrand(h * f64::from(i))
            })
            .sum();
        let expected = 2.0 * root * Complex64::cis(FRAC_PI_4) * (h / 3.0) * sum;
        assert!(
            (transition(x) - expected).norm() < 1e-7,
            "F({x}) = {} not {expected}",
            transition(x)
        );
    }
}

/// Wall that ends 6 mm from the foot of the perpendicular: specular for most of a 38 mm wide face,
/// not for the rest.
fn near_the_end() -> EdgeView {
    let (range_m, offset_m) = (0.6, 0.006_f64);
    let aspect_rad = PI / 2.0 - (offset_m / range_m).asin();
    let aspect = back(range_m, aspect_rad.to_degrees());
    EdgeView {
        wedge: half_plane(),
        aspect,
        lit: half_plane().lit_images(&aspect),
        wave_number_per_m: K,
        legs_m: [range_m; 2],
        swapped: [false; 2],
    }
}

fn at(view: &EdgeView, left_m: f64) -> Complex64 {
    EdgeLaw::Utd.echo(&view.wedge, &view.aspect_from(left_m, left_m), view.wave_number_per_m)
}

/// Where the wall is specular as for the face's middle, the edge contribution is the coefficient.
/// Elsewhere the mirror echo, which is counted nevertheless, is subtracted.
#[test]
fn view_compensates_lost_echo() {
    let view = near_the_end();
    let (middle, share) = (at(&view, 0.0), view.relative_field());
    for left_mm in -19..=19 {
        let left_m = 1e-3 * f64::from(left_mm);
        let excess = at(&view, left_m) - share(left_m, left_m) * middle;
        // The aspect angle of the edge increases to the right.
        let expected = if left_mm < -6 { 1.0 } else { 0.0 };
        assert!(left_mm == -6 || (excess.norm() - expected).abs() < 1e-3, "{left_mm}: {excess}");
    }
}

#[test]
fn view_is_continuous() {
    let share = near_the_end().relative_field();
    let at = |i: i32| 1e-4 * f64::from(i);
    let shares: Vec<Complex64> = (-190..=190).map(|i| share(at(i), at(i))).collect();
    for pair in shares.windows(2) {
        assert!((pair[1] - pair[0]).norm() < 0.02, "{pair:?}");
    }
    assert!((shares[190] - 1.0).norm() < 1e-12);
}

/// Absorbing walls at slightly more or less than `pi / m` diffract no more than at that angle. Two
/// materials on one line are the limit of walls with a vanishing bend.
#[test]
fn edges_fade_at_regular_angles() {
    for opening_deg in [60.0, 90.0, 180.0] {
        for reflectance in [[1.0; 2], [0.6; 2], [0.0; 2], [0.9, 0.3]] {
            let wedge = |off_rad: f64| Wedge {
                opening_rad: f64::to_radians(opening_deg) + off_rad,
                reflectance,
            };
            for (into, out) in [(0.1, 0.4), (0.3, 0.5), (0.5, 0.9), (0.7, 0.25), (0.95, 0.6)] {
                let echo = |off_rad: f64| {
                    let opening_rad = wedge(off_rad).opening_rad;
                    let (in_rad, out_rad) = (into * opening_rad, out * opening_rad);
                    EdgeLaw::Utd.echo(
                        &wedge(off_rad),
                        &Aspect { in_rad, out_rad, distance_m: 0.25 },
                        K,
                    )
                };
                let limit = echo(0.0);
                for off_rad in [1e-9, -1e-9, 1e-6, -1e-6, 1e-3, -1e-3] {
                    let apart = (echo(off_rad) - limit).norm();
                    let bound = 1e-7 + 20.0 * off_rad.abs();
                    assert!(
                        apart < bound,
                        "{opening_deg} {reflectance:?} {into} {out} {off_rad}: {apart}"
                    );
                }
            }
        }
    }
}

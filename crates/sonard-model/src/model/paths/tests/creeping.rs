//! Contribution of the creeping wave around a cylinder.

use num_complex::Complex64;

/// Echo of a rigid cylinder over that of its mirror, far away: the series of cylindrical waves
/// (Bowman, Senior and Uslenghi, Electromagnetic and Acoustic Scattering by Simple Shapes, 1969,
/// section 2.2) at `ka`.
fn over_mirror(ka: f64) -> f64 {
    let slope = |of: fn(i32, f64) -> f64, n: i32| {
        if n == 0 { -of(1, ka) } else { 0.5 * (of(n - 1, ka) - of(n + 1, ka)) }
    };
    let term = |n: i32| {
        let j = slope(libm::jn, n);
        let hankel = Complex64::new(j, -slope(libm::yn, n));
        let (neumann, sign) = (if n == 0 { 1.0 } else { 2.0 }, if n % 2 == 0 { 1.0 } else { -1.0 });
        neumann * sign * j / hankel
    };
    let sum: Complex64 = (0..ka as i32 + 25).map(term).sum();
    2.0 / (std::f64::consts::PI * ka).sqrt() * sum.norm()
}

/// At 49.4 kHz a leg of 2 cm has a `ka` of 9.05. Between 8 and 10 the creeping wave beats with the
/// mirror's echo.
#[test]
fn creeping_wave_is_34_db_down() {
    let beats = |from: f64, to: f64| {
        let steps = (0..=400).map(|i| over_mirror(from + (to - from) * f64::from(i) / 400.0));
        steps.fold((f64::INFINITY, 0.0_f64), |(low, high), level| (low.min(level), high.max(level)))
    };
    let (low, high) = beats(8.0, 10.0);
    assert!(0.975 < low && high < 1.016, "{low} to {high}");
    let creeping_db = 20.0 * (0.5 * (high - low)).log10();
    assert!((-35.0..-33.0).contains(&creeping_db), "{creeping_db}");
    // A table leg of 5 cm, and a pipe of 1 cm.
    let (low, high) = beats(21.0, 24.0);
    assert!(0.995 < low && high < 1.003, "{low} to {high}");
    let (low, high) = beats(4.0, 5.0);
    assert!(0.94 < low && high < 1.04, "{low} to {high}");
}

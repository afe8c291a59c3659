//! Comparison of echo listings.

use std::f64::consts::FRAC_PI_2;

use sonard_model::{
    geometry::{DVec2, wrap_pi},
    model::{
        Mechanism, Reflector,
        paths::{EchoPath, PathSettings},
    },
};

/// Permitted differences between two listings of the same echoes, apart from rounding.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turned {
    /// Map of the directions of the second listing, radians; `None` if they are not compared.
    pub(crate) direction: Option<fn(f64, f64) -> f64>,
    pub(crate) by_rad: f64,
    /// `true` if up is down in the second listing.
    pub(crate) is_upside_down: bool,
}

/// Unchanged directions.
pub(crate) const AS_IS: Turned =
    Turned { direction: Some(|direction, _| direction), by_rad: 0.0, is_upside_down: false };

/// Returns `true` if two echoes are equal: length to 0.1 um, field to 1e-5, directions to a
/// microradian.
fn is_same(a: &EchoPath, b: &EchoPath, turned: Turned) -> bool {
    let field = |echo: &EchoPath| {
        let (sine, cosine) = echo.phase_rad.sin_cos();
        echo.amplitude * DVec2::new(cosine, sine)
    };
    // Straight up and down there is no direction in the plan.
    let is_upright = a.rise_rad.iter().all(|rise_rad| rise_rad.abs() > FRAC_PI_2 - 1e-6);
    let looks = |a: f64, b: f64| {
        let is_along = |to: fn(f64, f64) -> f64| wrap_pi(to(a, turned.by_rad) - b).abs() < 1e-6;
        is_upright || turned.direction.is_none_or(is_along)
    };
    let up = if turned.is_upside_down { -1.0 } else { 1.0 };
    let climbs = |end: usize| (up * a.rise_rad[end] - b.rise_rad[end]).abs() < 1e-6;
    (a.length_m - b.length_m).abs() < 1e-7
        && climbs(0)
        && climbs(1)
        && field(a).distance(field(b)) < 1e-5 * a.amplitude
        && looks(a.departure_rad, b.departure_rad)
        && looks(a.arrival_rad, b.arrival_rad)
}

/// Asserts that every echo of a listing that is not at its very limits is in another one.
#[track_caller]
pub(crate) fn assert_has_all(
    all: &[EchoPath],
    of: &[EchoPath],
    settings: &PathSettings,
    turned: Turned,
) {
    for echo in of.iter().filter(|echo| is_well_within(echo, settings)) {
        let found = all.iter().any(|other| is_same(echo, other, turned));
        assert!(found, "{echo:?} is missing: {:?}", nearest(all, echo));
    }
}

/// Asserts that two listings have the same echoes, apart from those at their very limits.
#[track_caller]
pub(crate) fn assert_same(a: &[EchoPath], b: &[EchoPath], settings: &PathSettings, turned: Turned) {
    assert_has_all(b, a, settings, turned);
    let back = Turned { by_rad: -turned.by_rad, ..turned };
    assert_has_all(a, b, settings, back);
    let count = |echoes: &[EchoPath]| echoes.iter().filter(|e| is_well_within(e, settings)).count();
    let slack = a.iter().chain(b).filter(|e| !is_well_within(e, settings)).count();
    assert!(count(a).abs_diff(count(b)) <= slack, "some are listed twice");
}

/// Returns `true` if an echo is above its floor and within reach by more than rounding.
pub(crate) fn is_well_within(echo: &EchoPath, settings: &PathSettings) -> bool {
    echo.amplitude > 1.0001 * floor_of(echo, settings) && echo.length_m < settings.max_path_m - 1e-6
}

/// Amplitude floor of the listing for such paths.
pub(crate) fn floor_of(echo: &EchoPath, settings: &PathSettings) -> f64 {
    let is_round = |m: &Mechanism| matches!(m, Mechanism::Reflection(Reflector::Cylinder(_)));
    let is_bend = |m: &Mechanism| matches!(m, Mechanism::Diffraction(_));
    let contacts = echo.path.mechanisms().filter(is_round).count();
    let diffractors = echo.path.mechanisms().filter(is_bend).count();
    let is_kept = contacts < 2 && (contacts == 0 || diffractors == 0);
    if is_kept { settings.floor } else { settings.repeated_contact_ratio * settings.floor }
}

fn nearest<'a>(all: &'a [EchoPath], echo: &EchoPath) -> Option<&'a EchoPath> {
    let off = |second: &&EchoPath| (second.length_m - echo.length_m).abs();
    all.iter().min_by(|first, second| off(first).total_cmp(&off(second)))
}

//! Strength of echoes.

use rand::RngExt;
use sonard_model::{
    model::paths::{EchoPath, PathSettings},
    reading::PathKind,
};

use crate::{
    compare::{AS_IS, assert_same, floor_of},
    worlds::*,
};

#[test]
fn mirrored_echoes_gain_nothing() {
    on_random_worlds("strength", WITH_LEGS_PAIR, |world, _| {
        let lossless = PathSettings { absorption_np_per_m: 0.0, max_path_m: 3.0, ..settings() };
        let rigid = world.with_reflectance(|_| 1.0);
        let mirrored = |echo: &EchoPath| echo.path.kind() == PathKind::Specular;
        for echo in rigid.echoes(&lossless).into_iter().filter(mirrored) {
            assert!(echo.amplitude <= 1.0 + 1e-12, "{echo:?}");
        }
    });
}

/// Asserts that each mirrored echo of a listing is in a stronger one, no weaker.
#[track_caller]
fn assert_no_weaker(louder: &[EchoPath], fainter: &[EchoPath]) {
    for echo in fainter.iter().filter(|echo| echo.path.kind() == PathKind::Specular) {
        let is_it = |other: &&EchoPath| {
            other.path.mechanisms().eq(echo.path.mechanisms())
                && (other.length_m - echo.length_m).abs() < 1e-7
        };
        let other = louder.iter().find(is_it);
        let other = other.unwrap_or_else(|| panic!("{echo:?} comes out of nothing"));
        assert!(other.amplitude >= echo.amplitude - 1e-12, "{echo:?} {other:?}");
    }
}

/// Diffracted paths may weaken: an edge of an absorbing wall returns more where a mirror's share
/// would be subtracted.
#[test]
fn reflectance_never_weakens_mirrors() {
    on_random_worlds("reflectance", WITH_LEGS, |world, random| {
        let by = random.random_range(0.7..1.0);
        let dull = world.with_reflectance(|reflectance| by * reflectance);
        assert_no_weaker(&world.echoes(&settings()), &dull.echoes(&settings()));
    });
}

#[test]
fn absorption_grows_with_length() {
    on_random_worlds("air", WITH_LEGS_PAIR, |world, random| {
        let more_np_per_m = random.random_range(0.0..0.3);
        let own = settings();
        let dull = PathSettings {
            absorption_np_per_m: own.absorption_np_per_m + more_np_per_m,
            ..settings()
        };
        let (loud, faint) = (world.echoes(&own), world.echoes(&dull));
        let weakened: Vec<_> = loud
            .into_iter()
            .map(|echo| EchoPath {
                amplitude: echo.amplitude * (-more_np_per_m * echo.length_m).exp(),
                ..echo
            })
            .filter(|echo| echo.amplitude >= floor_of(echo, &dull))
            .collect();
        assert_same(&weakened, &faint, &dull, AS_IS);
    });
}

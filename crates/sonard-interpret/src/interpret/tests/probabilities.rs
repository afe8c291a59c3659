//! Class probabilities and border uncertainties against hand calculation.

use crate::interpret::{
    Extents, Probabilities,
    posterior::{ExtentLikelihood, probabilities},
};
use sonard_model::acoustics::{Air, Sensor};

fn check(found: &Probabilities, weights: [f64; 4]) {
    let all: f64 = weights.iter().sum();
    let found = [found.plane, found.corner, found.edge, found.other];
    for (found, weight) in found.into_iter().zip(weights) {
        assert!((found - weight / all).abs() < 1e-12, "{found} {weights:?}");
    }
}

/// Densities of 0.2 and 0.1 per degree where a plane is 20 degrees wide; other has 1/30.
#[test]
fn priors_and_likelihoods_multiply() {
    let extent = ExtentLikelihood::new(0.2, 0.1, 20.0);
    // One nearer arc would hide it: 32 in 100 such arcs are other.
    let like_plane = 0.99 * 0.2 + 0.01 / 30.0;
    let plane = 0.68 * 0.58 * like_plane;
    let corner = 0.68 * 0.34 * like_plane;
    let edge = 0.68 * 0.08 * (0.7 * 0.1 + 0.3 / 30.0);
    let other = 0.32 * (0.65 * 0.2 + 0.35 / 30.0);
    check(&probabilities(&extent, 1, []), [plane, corner, edge, other]);
    // A turn three times as likely for a plane; other may turn by any of 60 degrees.
    let turned = probabilities(&extent, 1, [[0.3, 0.1]]);
    let other = other * (0.8 * 0.2 + 0.2 / 60.0);
    check(&turned, [0.3 * plane, 0.1 * corner, 0.1 * edge, other]);
    // The prior is constant beyond five nearer arcs.
    assert_eq!(probabilities(&extent, 5, []), probabilities(&extent, 9, []));
    assert!(probabilities(&extent, 0, []).other < 0.05);
    let nothing = probabilities(&ExtentLikelihood::NONE, 0, []);
    assert_eq!(nothing, Probabilities { other: 1.0, ..Probabilities::default() });
}

/// The repeated echo of a blanked wall competes with an edge of the same extent.
#[test]
fn near_narrow_arcs_may_be_repeats() {
    let extent = ExtentLikelihood::new(0.2, 0.1, 20.0);
    let near = |seen_deg, range_m| extent.with_repeat(seen_deg, 20.0, range_m, 0.4);
    let like_plane = 0.99 * 0.2 + 0.01 / 30.0;
    let kinds = (1.0 - 0.021) * 0.69;
    let plane = kinds * 0.70 * like_plane;
    let corner = kinds * 0.06 * like_plane;
    let edge = kinds * 0.24 * (0.7 * 0.1 + 0.3 / 30.0);
    let other = 0.021 * (0.65 * 0.2 + 0.35 / 30.0);
    let repeat = (1.0 - 0.021) * 0.31 / (0.36 * 20.0);
    check(&probabilities(&near(5.0, 0.5), 0, []), [plane, corner, edge, other + repeat]);
    // The arc of a repeat is wider than a tenth of a plane's, and narrower than half of it.
    for seen_deg in [1.0, 12.0] {
        check(&probabilities(&near(seen_deg, 0.5), 0, []), [plane, corner, edge, other]);
    }
    // At 1.7 times the minimum range and beyond, the wall itself is detected.
    assert_eq!(probabilities(&near(5.0, 0.68), 0, []), probabilities(&extent, 0, []));
}

/// Noise moves the border like an equal relative change of the threshold.
#[test]
fn border_sigma_follows_the_threshold() {
    for name in ["bozma-kuc-60khz", "senscomp-6500"] {
        let sensor = Sensor::preset(name).expect("a preset");
        let extent_deg = |share: f64| {
            let sensor = Sensor { threshold: share * sensor.threshold, ..sensor.clone() };
            let extents = Extents::new(&sensor, &Air::default(), true).expect("figures");
            (extents.plane_corner_deg(0.5, 1.0), extents)
        };
        let (at_deg, extents) = extent_deg(1.0);
        let (wider_deg, narrower_deg) = (extent_deg(0.99).0, extent_deg(1.01).0);
        // Half the extent, by 2 % of the threshold.
        let by_threshold = (wider_deg - narrower_deg) / 2.0 / 0.02;
        let noise = 0.001 * sensor.threshold;
        let found_deg = extents.border_sigma_deg(at_deg, noise);
        assert!((found_deg / (0.001 * by_threshold) - 1.0).abs() < 0.02, "{name}: {found_deg}");
        assert_eq!(extents.border_sigma_deg(at_deg, 0.0), 0.0);
        assert_eq!(extents.border_sigma_deg(0.0, noise), 0.0);
        // Limited by the width of the arc.
        assert!((extents.border_sigma_deg(at_deg, 10.0) - at_deg / 2.0).abs() < 1e-9);
    }
}

//! Readings too coarse for phases.

use sonard_model::acoustics::TofNoise;

use super::{first_pose, recovery::sweep, world};
use crate::{FitOptions, FitResult, Parameter, Prior, fit};

/// Fit of a pose with an initial error of 3 cm and 2 degrees to noisy readings, and its final
/// error.
fn fitted(noise_mm: f64) -> (FitResult, [f64; 3]) {
    let here = world("simple-room", "senscomp-6500");
    let pose = first_pose(&here.scene);
    let mut initial = pose;
    (initial.x_m, initial.heading_deg) = (pose.x_m + 0.03, pose.heading_deg - 2.0);
    let noise = TofNoise::from_range_sigma_mm(noise_mm, here.air.sound_speed_m_s());
    let sweep = sweep(&here, &pose, &initial, 240, noise, 1);
    let of = |parameter, sigma| Prior { parameter, sigma };
    let priors = [(Parameter::X(0), 0.05), (Parameter::Y(0), 0.05), (Parameter::Heading(0), 4.0)];
    let what =
        FitOptions::with_priors(priors.map(|(parameter, sigma)| of(parameter, sigma)).into(), 0.06);
    let fitted = fit(&here, &[sweep], &what).expect("a fit");
    let found = fitted.poses[0];
    let off = [found.x_m - pose.x_m, found.y_m - pose.y_m, found.heading_deg - pose.heading_deg];
    (fitted, off)
}

#[test]
fn reflections_add_level_uncertainty() {
    // Half a wavelength is 3.5 mm.
    for (noise_mm, sigma_db) in [(1.0, 0.0), (8.0, 1.5)] {
        let (fitted, off) = fitted(noise_mm);
        assert_eq!(fitted.errors.sigma_db_per_reflection, sigma_db, "{:?}", fitted.errors);
        for (estimate, off) in fitted.estimates.iter().zip(off) {
            assert!(off.abs() < 3.0 * estimate.sigma && estimate.identified, "{estimate:?}: {off}");
        }
    }
}

//! Numbers of sensor and air, fitted together with the plan.

use sonard_inverse::ParameterGroup;

use super::*;
use crate::{
    error::SurveyError,
    progress::NoObserver,
    result::{FittedNumber, SearchEnd, Survey},
    survey::{resume_survey, survey},
};

/// Survey with the sensor of `assumed`, of sweeps that another one measures.
fn surveyed(truth: &World, assumed: &World, fit: &[ParameterGroup]) -> Survey {
    let poses = stops();
    let sweeps = sweeps(truth, &poses, &drifted(&poses));
    let options = SurveyOptions { fit: fit.to_vec(), ..options() };
    survey(assumed, &sweeps, &options, &NoObserver).expect("sweeps with arcs")
}

fn number<'a>(found: &'a Survey, name: &str) -> &'a FittedNumber {
    let fitted = found.fitted.as_ref().expect("a fit");
    fitted.numbers.iter().find(|of| of.name == name).unwrap_or_else(|| panic!("{fitted:?}"))
}

/// Asserts that an estimate is within four standard deviations of the truth and of a scale.
fn assert_fitted(of: &FittedNumber, truth: f64, max_off: f64) {
    assert!(of.is_determined, "{of:?}");
    let off = (of.value - truth).abs();
    assert!(off < max_off, "{truth}: {of:?}");
    assert!(off < 4.0 * of.sigma + 0.02 * of.assumed_sigma, "{truth}: {of:?}");
}

fn assert_is_rectangle(found: &Survey) {
    assert_eq!((found.walls.len(), found.end), (4, SearchEnd::Complete), "{found:#?}");
    let mut lengths_m: Vec<f64> = found
        .walls
        .iter()
        .map(|wall| DVec2::from(wall.from.at_m).distance(wall.to.at_m.into()))
        .collect();
    lengths_m.sort_by(f64::total_cmp);
    let [width_m, depth_m] = SIZE_M;
    for (found_m, expected_m) in lengths_m.iter().zip([depth_m, depth_m, width_m, width_m]) {
        assert!((found_m - expected_m).abs() < 0.002, "{lengths_m:?}");
    }
}

#[test]
fn threshold_is_fitted() {
    let assumed = world(&rectangle());
    for by_db in [3.0, -3.0] {
        let mut truth = assumed.clone();
        truth.sensor.threshold *= 10f64.powf(by_db / 20.0);
        let found = surveyed(&truth, &assumed, &[ParameterGroup::Threshold]);
        assert_is_rectangle(&found);
        let of = number(&found, "threshold_db");
        assert_fitted(of, of.assumed + by_db, 0.3);
        let sensor = &found.fitted.as_ref().expect("a fit").sensor;
        let fitted_db = 20.0 * (sensor.threshold / assumed.sensor.threshold).log10();
        assert!((fitted_db - (of.value - of.assumed)).abs() < 1e-9, "{fitted_db} {of:?}");
        assert_ne!(sensor.name, assumed.sensor.name);
    }
}

#[test]
fn reflectance_is_fitted() {
    let assumed = world(&rectangle());
    let mut truth = assumed.clone();
    let mut scene = Scene::clone(&truth.scene);
    scene.walls.iter_mut().for_each(|wall| wall.material.reflectance = 0.8);
    truth.scene = Arc::new(scene);
    let found = surveyed(&truth, &assumed, &[ParameterGroup::Materials]);
    assert_is_rectangle(&found);
    let of = number(&found, "reflectance wall");
    assert_fitted(of, 0.8, 0.02);
    assert_eq!(found.reflectance.to_bits(), of.value.to_bits());
}

#[test]
fn mounting_is_fitted() {
    let assumed = world(&rectangle());
    let mut truth = assumed.clone();
    truth.sensor.mounting.ahead_m = 0.025;
    truth.sensor.mounting.left_m = -0.012;
    let found = surveyed(&truth, &assumed, &[ParameterGroup::Mounting]);
    assert_is_rectangle(&found);
    assert_fitted(number(&found, "ahead_m"), 0.025, 0.002);
    assert_fitted(number(&found, "left_m"), -0.012, 0.003);
    let mounting = &found.fitted.as_ref().expect("a fit").sensor.mounting;
    assert!((mounting.ahead_m - number(&found, "ahead_m").value).abs() < 1e-12, "{mounting:?}");
    assert!((mounting.left_m - number(&found, "left_m").value).abs() < 1e-12, "{mounting:?}");
    // A sensor file with these values is left as it is.
    let found = surveyed(&truth, &truth, &[ParameterGroup::Mounting]);
    assert_fitted(number(&found, "ahead_m"), 0.025, 0.002);
    assert_fitted(number(&found, "left_m"), -0.012, 0.003);
}

#[test]
fn sound_speed_without_odometry_is_not_determined() {
    let assumed = world(&rectangle());
    let poses = stops();
    let sweeps = sweeps(&assumed, &poses, &drifted(&poses));
    let fit = vec![ParameterGroup::Air];
    let options = SurveyOptions { fit, odometry: None, ..options() };
    let found = survey(&assumed, &sweeps, &options, &NoObserver).expect("sweeps with arcs");
    let of = number(&found, "sound_speed");
    assert!(!of.is_determined, "{of:?}");
    assert!((of.value - of.assumed).abs() < of.assumed_sigma, "{of:?}");
}

#[test]
fn fit_with_known_scores_is_that_without() {
    let assumed = world(&rectangle());
    let mut truth = assumed.clone();
    truth.sensor.threshold *= 1.4;
    let poses = stops();
    let sweeps = sweeps(&truth, &poses, &drifted(&poses));
    let options = SurveyOptions { fit: vec![ParameterGroup::Threshold], ..options() };
    let scores = PlanScores::default();
    let resumed = |scores: &PlanScores| {
        resume_survey(&assumed, &sweeps, &options, scores, &NoObserver).expect("sweeps with arcs")
    };
    let whole = resumed(&scores);
    // Scores of plans with the sensor assumed and with the fitted one are kept apart.
    assert_eq!(resumed(&scores), whole);
}

#[test]
fn groups_that_cannot_be_fitted_are_rejected() {
    let (_, _, world, all) = true_rectangle();
    let with = |group: ParameterGroup| {
        let options = SurveyOptions { fit: vec![group], ..options() };
        survey(&world, &all, &options, &NoObserver).expect_err("no survey")
    };
    let error = with(ParameterGroup::Walls);
    assert!(matches!(error, SurveyError::NotFittable { group: ParameterGroup::Walls, .. }));
    let text = error.to_string();
    assert!(
        text.starts_with("walls can't be fitted by a survey of these readings: it fits threshold,"),
        "{text}"
    );
}

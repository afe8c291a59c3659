//! Derivatives of detection limits, and of ranges by time walk, against finite differences.

use sonard_model::{
    acoustics::{Aperture, Pulse},
    geometry::Pose,
    scene::Scene,
};

use super::world;
use crate::{
    FiringOutcome, FitSweep, Parameter, SweepFiring, World, candidates::Phases,
    jacobian::JacobianBuilder, likelihood_terms::CandidateReading,
};

const AT: Pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };

/// World of a low-cost ranger with a single object.
fn before(text: &str) -> World {
    let mut here = world("simple-room", "hc-sr04");
    here.scene = Scene::from_json(text).expect("a scene").into();
    here.sensor.mounting.separation_m = 0.0;
    here
}

/// First candidates of beams within 40 degrees on either side.
fn first_possible(
    world: &World,
    pose: &Pose,
    parameters: &[Parameter],
    step_deg: usize,
) -> Vec<CandidateReading> {
    let azimuths = (-40..=40).step_by(step_deg).map(f64::from);
    let beams = azimuths
        .map(|azimuth_deg| SweepFiring { azimuth_deg, outcome: FiringOutcome::NoEcho })
        .collect();
    let sweep = FitSweep { scan: uuid::Uuid::nil(), pose: *pose, beams };
    let of: Vec<&Parameter> = parameters.iter().collect();
    let builder = JacobianBuilder::new(world, &of, world.air.sound_speed_m_s(), Phases::Known);
    let simulator = world.simulator(pose).expect("a model");
    let readings = builder.sweep(&simulator, &simulator.at(pose.position()), 0, &sweep, pose);
    readings.expect("candidates").iter().map(|beam| beam.possible[0].clone()).collect()
}

/// Compares derivatives of detection limits with differences between worlds changed by `by` either
/// way; `near` is the tolerance for a derivative.
fn compare(
    parameter: u32,
    found: &[CandidateReading],
    [before, after]: [Vec<CandidateReading>; 2],
    by: f64,
    near: impl Fn(f64) -> f64,
) {
    let mut compared = 0;
    for ((here, before), after) in found.iter().zip(&before).zip(&after) {
        let rate = here.until_rates.iter().find(|(of, _)| *of == parameter).map_or(0.0, |of| of.1);
        // An echo beyond the scanned thresholds has no limit to compare.
        if here.outcome.range_m().is_none() || here.until_db.abs() >= 11.0 {
            continue;
        }
        let expected = (after.until_db - before.until_db) / (2.0 * by);
        assert!((rate - expected).abs() < near(rate), "{parameter}: {rate} for {expected}");
        compared += 1;
    }
    assert!(compared >= 6, "{parameter}: {compared}");
}

/// Sensor and material parameters, with a single wall and no overlap.
#[test]
fn sensor_and_material() {
    let mut here = before(
        r#"{"name": "wall", "materials": {"wood": {"reflectance": 0.8}},
        "walls": [{"id": "w", "from": [1.2, -9], "to": [1.2, 9], "material": "wood"}]}"#,
    );
    here.sensor.aperture = Aperture::Piston { radius_m: 6e-3, skirts_db: Some(-10.0) };
    // Within the scanned thresholds, and steep enough for time walk to be negligible.
    (here.sensor.threshold, here.sensor.threshold_rise_db_per_m) = (0.1, 3.0);
    here.sensor.pulse = Pulse::Burst { cycles: 8.0, bandwidth_hz: 7000.0 };
    let parameters = [
        Parameter::Threshold,
        Parameter::ThresholdRise,
        Parameter::Skirts,
        Parameter::Aperture,
        Parameter::Reflectance("wood".to_owned()),
    ];
    let found = first_possible(&here, &AT, &parameters, 5);
    for ((at, parameter), by) in (0u32..).zip(&parameters).zip([0.1, 0.1, 0.05, 0.01, 0.02]) {
        let changed = |by: f64| here.changed(&[(parameter, by)]).expect("a world");
        let both = [-by, by].map(|by| first_possible(&changed(by), &AT, &parameters, 5));
        compare(at, &found, both, by, |rate| 0.02 * rate.abs().max(0.05));
    }
}

/// A wider band reduces the time walk of weak echoes: a single wall, from the middle of its arc to
/// the ends.
#[test]
fn bandwidth() {
    let mut here = before(
        r#"{"name": "wall", "materials": {"wood": {"reflectance": 0.8}},
        "walls": [{"id": "w", "from": [1.2, -9], "to": [1.2, 9], "material": "wood"}]}"#,
    );
    here.sensor.threshold = 0.05;
    // A chirp is summed in steps of an eightieth of its filter's width, which a difference would
    // show.
    for pulse in
        [Pulse::Burst { cycles: 8.0, bandwidth_hz: 1500.0 }, Pulse::Gaussian { sigma_us: 100.0 }]
    {
        const BY: f64 = 0.02;
        here.sensor.pulse = pulse;
        let parameters = [Parameter::Bandwidth];
        let found = first_possible(&here, &AT, &parameters, 2);
        let changed = |by: f64| here.changed(&[(&parameters[0], by)]).expect("a world");
        let [before, after] = [-BY, BY].map(|by| first_possible(&changed(by), &AT, &parameters, 2));
        let mut rates = Vec::new();
        for ((here, before), after) in found.iter().zip(&before).zip(&after) {
            let (Some(before_m), Some(after_m)) =
                (before.outcome.range_m(), after.outcome.range_m())
            else {
                continue;
            };
            // Below the nominal threshold, each world evaluates the range at a different threshold.
            if here.until_db < 0.5 {
                continue;
            }
            let rate = here.range_rates.first().map_or(0.0, |of| of.1);
            let expected = (after_m - before_m) / (2.0 * BY);
            // The effective threshold changes while a weak echo rises, which is not in the time
            // walk.
            let tolerance = 1e-5 + 4e-3 * rate.abs();
            assert!((rate - expected).abs() < tolerance, "{rate} for {expected} metres");
            rates.push(rate);
        }
        // Centimetres at the ends of the arc, a quarter of that at its middle.
        assert!(rates.len() > 10, "{}", rates.len());
        let by_size = |a: &&f64, b: &&f64| a.abs().total_cmp(&b.abs());
        let (min, max) = (rates.iter().min_by(by_size), rates.iter().max_by(by_size));
        let (Some(&min), Some(&max)) = (min, max) else { unreachable!("some are compared") };
        assert!(max < -0.01 && min > 0.4 * max, "{min} {max}");
    }
}

/// The direction of a pole changes as the ranger moves aside, or turns.
#[test]
fn bearing() {
    let mut here = before(
        r#"{"name": "pole", "materials": {"steel": {"reflectance": 1.0}},
        "cylinders": [{"id": "p", "center": [1.2, 0.1], "radius_m": 0.03, "material": "steel"}]}"#,
    );
    here.sensor.threshold = 0.01;
    let parameters = [Parameter::Y(0), Parameter::Heading(0)];
    let at = |pose: Pose| first_possible(&here, &pose, &parameters, 2);
    let found = at(AT);
    let aside = |by: f64| at(Pose { y_m: by, ..AT });
    // The effect of the range is omitted: 17 dB/m, of which a tenth is along the displacement.
    compare(0, &found, [-0.002, 0.002].map(aside), 0.002, |rate| 0.03 * rate.abs() + 2.0);
    let turned = |by: f64| at(Pose { heading_deg: by, ..AT });
    compare(1, &found, [-0.1, 0.1].map(turned), 0.1, |rate| 0.03 * rate.abs() + 0.02);
}

//! Feature Prediction on constructed scans.

mod course;

use super::{
    FeaturePrediction, PredictionSettings, combine, confidence_by_angle, confidence_by_distance,
};
use crate::interpret::{BeamOutcome, Sweep, SweepBeam};
use sonard_model::geometry::{DVec2, Pose};

const MAX_RANGE_M: f64 = 5.0;

/// Ring of readings: azimuth and range, 0 for no echo.
fn ring(pose: Pose, readings: &[(f64, f64)]) -> Sweep {
    let beam = |(index, &(azimuth_deg, range_m)): (u32, &(f64, f64))| SweepBeam {
        azimuth_deg,
        index,
        outcome: if range_m > 0.0 { BeamOutcome::Echo(range_m) } else { BeamOutcome::NoEcho },
        mount: DVec2::ZERO,
    };
    let beams = (0..).zip(readings).map(beam).collect();
    Sweep { pose, step_deg: 25.0, beams, closed: false }
}

const ORIGIN: Pose = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };

fn prediction() -> FeaturePrediction {
    FeaturePrediction::new(PredictionSettings::ring(MAX_RANGE_M))
}

#[test]
fn confidences_are_within_stated_ranges() {
    assert_eq!((confidence_by_angle(0.0), confidence_by_angle(1.0)), (0.25, 0.5));
    assert_eq!((confidence_by_distance(0.0, 2.0), confidence_by_distance(1.0, 2.0)), (0.0, 0.5));
    assert_eq!(confidence_by_distance(0.5, 2.0), 0.125);
    assert_eq!(confidence_by_distance(0.5, 1.0), 0.25);
    for confidence in [0.0, 0.1, 0.3, 0.5] {
        assert!((combine(0.5, confidence) - confidence).abs() < 1e-15, "0.5 is neutral");
    }
    assert!(combine(0.3, 0.3) < 0.3, "low confidences reinforce each other");
    assert_eq!(combine(0.0, 1.0), 0.5, "contradictions cancel");
}

#[test]
fn figures_4_to_6_are_reproduced() {
    // The robot faces a wall 1 m ahead: sonars 2, 3 and 4 detect it, 0, 1 and 6 have no echo, 5
    // detects something behind it.
    let readings = [
        (90.0, 0.0),
        (30.0, 0.0),
        (15.0, 1.0),
        (0.0, 1.0),
        (345.0, 1.0),
        (330.0, 2.0),
        (270.0, 0.0),
    ];
    let mut prediction = prediction();
    let assessments = prediction.assess(&ring(ORIGIN, &readings));
    let [wall] = prediction.local() else { panic!("{:?}", prediction.local()) };
    assert_eq!(wall.readings, [2, 3, 4]);
    assert!(wall.normal_rad.abs() < 1e-9 && (wall.a.x - 1.0).abs() < 1e-9, "{wall:?}");
    for neutral in [0, 2, 3, 4, 6] {
        assert_eq!(assessments[neutral].confidence, 0.5, "sonar {neutral}");
    }
    for contradicted in [1, 5] {
        assert!(
            assessments[contradicted].confidence < 0.5,
            "sonar {contradicted}: {assessments:?}"
        );
        let clear_m = assessments[contradicted].clear_m.expect("a crossing");
        assert!((clear_m - 1.0).abs() < 0.1, "{clear_m}");
    }
}

#[test]
fn earlier_wall_contradicts_readings() {
    let mut prediction = prediction();
    prediction.assess(&ring(ORIGIN, &[(15.0, 1.0), (0.0, 1.0), (345.0, 1.0)]));
    // From the side of the wall, looking along it at 60 degrees from its normal.
    let pose = Pose { x_m: 0.5, y_m: -0.9, heading_deg: 60.0 };
    let assessment = prediction.assess(&ring(pose, &[(0.0, 0.0)]))[0];
    let crossing_m = assessment.clear_m.expect("a crossing");
    let expected = (crossing_m / MAX_RANGE_M).powi(2) / 2.0;
    assert!((assessment.confidence - expected).abs() < 1e-12, "{assessment:?}");
    assert!(assessment.confidence < 0.02);
}

#[test]
fn undetected_wall_is_split() {
    let mut prediction = prediction();
    prediction.assess(&ring(ORIGIN, &[(15.0, 1.0), (0.0, 1.0), (345.0, 1.0)]));
    let before_m = prediction.local()[0].length_m();
    // The wall should be detected straight ahead and is not: there is none there.
    prediction.assess(&ring(ORIGIN, &[(0.0, 0.0)]));
    let parts = prediction.local();
    assert_eq!(parts.len(), 2, "{parts:?}");
    let shortened_m = before_m - parts.iter().map(super::PredictedWall::length_m).sum::<f64>();
    assert!((shortened_m - 0.1).abs() < 1e-9);
    for turn_deg in [-10.0, -5.0, 5.0, 10.0, -14.0, 14.0, -17.0, 17.0, -19.0, 19.0, -21.0, 21.0] {
        prediction.assess(&ring(Pose { heading_deg: turn_deg, ..ORIGIN }, &[(0.0, 0.0)]));
    }
    assert!(prediction.local().iter().all(|line| line.length_m() >= 0.15));
}

#[test]
fn split_wall_is_not_extended() {
    let settings = PredictionSettings { extend_m: 2.0, ..PredictionSettings::ring(MAX_RANGE_M) };
    let mut prediction = FeaturePrediction::new(settings);
    let wall = [(15.0, 1.0), (0.0, 1.0), (345.0, 1.0)];
    // Looking along the wall, where it can't be detected, through its possible extension.
    let aside = Pose { x_m: 0.0, y_m: 1.2, heading_deg: 35.0 };
    prediction.assess(&ring(ORIGIN, &wall));
    assert!(prediction.assess(&ring(aside, &[(0.0, 3.0)]))[0].confidence < 0.48, "extended");
    // Beyond its end there is no echo where a wall would be: it ends.
    let past_its_end = Pose { y_m: 0.45, ..ORIGIN };
    prediction.assess(&ring(past_its_end, &[(0.0, 3.0)]));
    assert_eq!(prediction.assess(&ring(aside, &[(0.0, 3.0)]))[0].confidence, 0.5);
    // The remainder is detected again, and its end stays known.
    prediction.assess(&ring(Pose { y_m: -0.4, ..ORIGIN }, &wall));
    assert_eq!(prediction.assess(&ring(aside, &[(0.0, 3.0)]))[0].confidence, 0.5);
}

#[test]
fn wall_seen_again_stays_one_feature() {
    let mut prediction = prediction();
    for _ in 0..30 {
        prediction.assess(&ring(ORIGIN, &[(15.0, 1.0), (0.0, 1.0), (345.0, 1.0)]));
        assert_eq!(prediction.local().len(), 1, "both parts belong to the detected wall");
        prediction.assess(&ring(ORIGIN, &[(0.0, 0.0)]));
        assert_eq!(prediction.local().len(), 2, "split where it is not detected");
    }
}

#[test]
fn distant_features_are_forgotten() {
    let mut prediction = prediction();
    prediction.assess(&ring(ORIGIN, &[(0.0, 1.0)]));
    assert_eq!(prediction.local().len(), 1);
    let far = Pose { x_m: -20.0, ..ORIGIN };
    prediction.assess(&ring(far, &[(180.0, 1.0)]));
    assert_eq!(prediction.local().len(), 1);
    assert!(prediction.local()[0].a.x < -20.0);
}

#[test]
fn stepper_arc_yields_its_wall() {
    let beams: Vec<(f64, f64)> = (-11..=11).map(|i| (f64::from(i) * 0.9 + 40.0, 1.5)).collect();
    let mut prediction = FeaturePrediction::new(PredictionSettings::stepper(20.7, MAX_RANGE_M));
    let assessments = prediction.assess(&ring(ORIGIN, &beams));
    let [wall] = prediction.local() else { panic!("{:?}", prediction.local()) };
    assert!((wall.normal_rad.to_degrees() - 40.0).abs() < 0.01, "{wall:?}");
    let normal = DVec2::from_angle(wall.normal_rad);
    assert!(
        (normal.dot(wall.a) - 1.5).abs() < 1e-9,
        "the wall is at the range, not within the arc"
    );
    assert!(assessments.iter().all(|assessment| assessment.confidence == 0.5));
}

#[test]
fn empty_and_near_readings_are_neutral() {
    let mut prediction = prediction();
    assert_eq!(prediction.assess(&ring(ORIGIN, &[])), []);
    let mut near = ring(ORIGIN, &[(0.0, 1.0), (5.0, 0.0)]);
    near.beams[1].outcome = BeamOutcome::BelowMinRange;
    assert_eq!(prediction.assess(&near)[1].confidence, 0.5);
}

//! Feature Prediction on hand-made sets of readings.

mod course;

use super::{FeaturePrediction, PredictionSettings, combine, of_angle, of_distance};
use crate::interpret::{Beam, Heard, Sweep};
use sonard_model::geometry::{DVec2, Pose};

const MAX_RANGE_M: f64 = 5.0;

/// A ring: azimuth and range, 0 for silence.
fn ring(pose: Pose, readings: &[(f64, f64)]) -> Sweep {
    let beam = |(index, &(azimuth_deg, range_m)): (u32, &(f64, f64))| Beam {
        azimuth_deg,
        index,
        heard: if range_m > 0.0 { Heard::Echo(range_m) } else { Heard::Silent },
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
fn confidences_have_the_ranges_that_the_text_gives() {
    assert_eq!((of_angle(0.0), of_angle(1.0)), (0.25, 0.5));
    assert_eq!((of_distance(0.0, 2.0), of_distance(1.0, 2.0)), (0.0, 0.5));
    assert_eq!(of_distance(0.5, 2.0), 0.125);
    assert_eq!(of_distance(0.5, 1.0), 0.25);
    for confidence in [0.0, 0.1, 0.3, 0.5] {
        assert!((combine(0.5, confidence) - confidence).abs() < 1e-15, "0.5 is neutral");
    }
    assert!(combine(0.3, 0.3) < 0.3, "two doubts are more than one");
    assert_eq!(combine(0.0, 1.0), 0.5, "contradictions cancel");
}

#[test]
fn figures_4_to_6_three_readings_of_a_wall_outvote_a_wrong_one() {
    // The robot faces a wall 1 m ahead: sonars 2, 3 and 4 hear it, 0, 1 and 6 are silent, 5 hears
    // something behind it.
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
    for doubtful in [1, 5] {
        assert!(assessments[doubtful].confidence < 0.5, "sonar {doubtful}: {assessments:?}");
        let clear_m = assessments[doubtful].clear_m.expect("a crossing");
        assert!((clear_m - 1.0).abs() < 0.1, "{clear_m}");
    }
}

#[test]
fn a_wall_seen_before_speaks_against_readings_through_it() {
    let mut prediction = prediction();
    prediction.assess(&ring(ORIGIN, &[(15.0, 1.0), (0.0, 1.0), (345.0, 1.0)]));
    // From beside the wall, looking along it at 60 degrees from its normal.
    let pose = Pose { x_m: 0.5, y_m: -0.9, heading_deg: 60.0 };
    let assessment = prediction.assess(&ring(pose, &[(0.0, 0.0)]))[0];
    let crossing_m = assessment.clear_m.expect("a crossing");
    let expected = (crossing_m / MAX_RANGE_M).powi(2) / 2.0;
    assert!((assessment.confidence - expected).abs() < 1e-12, "{assessment:?}");
    assert!(assessment.confidence < 0.02);
}

#[test]
fn an_unheard_wall_is_split_and_its_stubs_go() {
    let mut prediction = prediction();
    prediction.assess(&ring(ORIGIN, &[(15.0, 1.0), (0.0, 1.0), (345.0, 1.0)]));
    let before_m = prediction.local()[0].length_m();
    // The wall should be heard straight ahead and is not: it was none there.
    prediction.assess(&ring(ORIGIN, &[(0.0, 0.0)]));
    let parts = prediction.local();
    assert_eq!(parts.len(), 2, "{parts:?}");
    let shortened_m = before_m - parts.iter().map(super::Line::length_m).sum::<f64>();
    assert!((shortened_m - 0.1).abs() < 1e-9);
    for turn_deg in [-10.0, -5.0, 5.0, 10.0, -14.0, 14.0, -17.0, 17.0, -19.0, 19.0, -21.0, 21.0] {
        prediction.assess(&ring(Pose { heading_deg: turn_deg, ..ORIGIN }, &[(0.0, 0.0)]));
    }
    assert!(prediction.local().iter().all(|line| line.length_m() >= 0.15));
}

#[test]
fn a_wall_does_not_go_on_where_it_was_not_heard() {
    let settings = PredictionSettings { extend_m: 2.0, ..PredictionSettings::ring(MAX_RANGE_M) };
    let mut prediction = FeaturePrediction::new(settings);
    let wall = [(15.0, 1.0), (0.0, 1.0), (345.0, 1.0)];
    // Looking along the wall, so that it would not be heard, through what may be its going on.
    let beside = Pose { x_m: 0.0, y_m: 1.2, heading_deg: 35.0 };
    prediction.assess(&ring(ORIGIN, &wall));
    assert!(prediction.assess(&ring(beside, &[(0.0, 3.0)]))[0].confidence < 0.48, "it may go on");
    // Beyond its end nothing is heard where a wall would be: it ends.
    let past_its_end = Pose { y_m: 0.45, ..ORIGIN };
    prediction.assess(&ring(past_its_end, &[(0.0, 3.0)]));
    assert_eq!(prediction.assess(&ring(beside, &[(0.0, 3.0)]))[0].confidence, 0.5);
    // The rest of it is seen again: it is known to end all the same.
    prediction.assess(&ring(Pose { y_m: -0.4, ..ORIGIN }, &wall));
    assert_eq!(prediction.assess(&ring(beside, &[(0.0, 3.0)]))[0].confidence, 0.5);
}

#[test]
fn a_wall_lost_and_seen_again_stays_one_feature() {
    let mut prediction = prediction();
    for _ in 0..30 {
        prediction.assess(&ring(ORIGIN, &[(15.0, 1.0), (0.0, 1.0), (345.0, 1.0)]));
        assert_eq!(prediction.local().len(), 1, "both parts are of the wall that is seen");
        prediction.assess(&ring(ORIGIN, &[(0.0, 0.0)]));
        assert_eq!(prediction.local().len(), 2, "it is split where it is not heard");
    }
}

#[test]
fn the_far_past_is_forgotten() {
    let mut prediction = prediction();
    prediction.assess(&ring(ORIGIN, &[(0.0, 1.0)]));
    assert_eq!(prediction.local().len(), 1);
    let far = Pose { x_m: -20.0, ..ORIGIN };
    prediction.assess(&ring(far, &[(180.0, 1.0)]));
    assert_eq!(prediction.local().len(), 1);
    assert!(prediction.local()[0].a.x < -20.0);
}

#[test]
fn a_stepper_arc_gives_the_wall_it_came_from() {
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
fn nothing_and_near_readings_change_nothing() {
    let mut prediction = prediction();
    assert_eq!(prediction.assess(&ring(ORIGIN, &[])), []);
    let mut near = ring(ORIGIN, &[(0.0, 1.0), (5.0, 0.0)]);
    near.beams[1].heard = Heard::Near;
    assert_eq!(prediction.assess(&near)[1].confidence, 0.5);
}

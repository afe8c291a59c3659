//! Empty or insufficient input.

use uuid::Uuid;

use super::{features, scan, simulator};
use crate::interpret::{
    BeamOutcome, Extents, FeatureKind, InterpretSettings, Reason, Sweep, SweepError, interpret,
};
use sonard_model::{
    geometry::{Pose, wrap_360},
    scene::{Scene, shipped},
};
use sonard_records::{PingStatus, ScanView};

fn fig13() -> ScanView {
    let text = shipped::text("plane-corner-edge").expect("shipped");
    let scene = std::sync::Arc::new(Scene::from_json(text).expect("a scene"));
    let pose = scene.pose("fig13").expect("a pose");
    scan(&simulator(scene), 1, &pose)
}

#[test]
fn insufficient_scans_are_rejected() {
    let whole = fig13();
    assert_eq!(
        Sweep::from_scan(&ScanView { start: None, ..whole.clone() }),
        Err(SweepError::NoPose)
    );
    let one = ScanView { pings: whole.pings[..1].to_vec(), ..whole.clone() };
    assert_eq!(Sweep::from_scan(&one), Err(SweepError::TooFew(1)));
    let mut nowhere = whole;
    if let Some(start) = &mut nowhere.start {
        start.pose = Pose { x_m: f64::NAN, y_m: 0.0, heading_deg: 0.0 };
    }
    assert!(matches!(Sweep::from_scan(&nowhere), Err(SweepError::BadPose { .. })));
}

#[test]
fn no_echo_yields_no_features() {
    let mut empty = fig13();
    for ping in &mut empty.pings {
        (ping.status, ping.range_m) = (PingStatus::NoEcho, None);
    }
    assert_eq!(features(&[empty], &InterpretSettings::default()), []);
    assert_eq!(interpret(&[], &extents(), &InterpretSettings::default()), []);
}

fn extents() -> Extents {
    Extents::from_session(fig13().session.as_ref().expect("a session")).expect("figures")
}

#[test]
fn non_finite_readings_count_as_lost() {
    let mut scan = fig13();
    let expected = features(std::slice::from_ref(&scan), &InterpretSettings::default()).len();
    scan.pings[5].range_m = Some(f64::NAN);
    scan.pings[80].azimuth_deg = f64::INFINITY;
    scan.pings[150].status = PingStatus::LinkLost;
    scan.pings[160].range_m = Some(-3.0);
    let sweep = Sweep::from_scan(&scan).expect("a sweep");
    assert_eq!(sweep.beams.len(), 397);
    assert!(
        !sweep.beams.iter().any(|beam| matches!(beam.outcome, BeamOutcome::Echo(m) if m.is_nan()))
    );
    assert_eq!(features(&[scan], &InterpretSettings::default()).len(), expected);
}

#[test]
fn same_position_does_not_decide() {
    let (one, mut two) = (fig13(), fig13());
    two.scan = Uuid::from_u128(2);
    // Rotated; otherwise it would be a repeat.
    two.start.as_mut().expect("a start").pose.heading_deg += 45.0;
    for ping in &mut two.pings {
        ping.azimuth_deg = wrap_360(ping.azimuth_deg - 45.0);
    }
    let features = features(&[one, two], &InterpretSettings::default());
    assert_eq!(features.len(), 6);
    for feature in features.iter().filter(|feature| feature.extent_deg > 15.0) {
        assert_eq!(feature.kind, FeatureKind::Unresolved);
        assert_eq!(feature.reason, Some(Reason::Translation));
        assert!(feature.next.is_some());
    }
}

#[test]
fn repeats_are_merged() {
    let repeats = [1, 2, 3].map(|number| {
        let mut scan = fig13();
        scan.scan = Uuid::from_u128(number);
        // Each has an outlier in a different arc.
        let odd = &mut scan.pings[40 * number as usize];
        (odd.status, odd.range_m) = (PingStatus::Echo, Some(0.2));
        scan
    });
    let features = features(&repeats, &InterpretSettings::default());
    assert_eq!(features.len(), 6, "{features:#?}");
    let alone = super::features(&[fig13()], &InterpretSettings::default());
    for (feature, alone) in features.iter().zip(&alone) {
        assert_eq!((feature.beams, feature.reason), (alone.beams, alone.reason));
        assert_eq!(feature.scan, Uuid::from_u128(1));
    }
}

#[test]
fn circle_around_the_ranger_is_no_arc() {
    let mut round = fig13();
    for ping in &mut round.pings {
        (ping.status, ping.range_m) = (PingStatus::Echo, Some(1.0));
    }
    let features = features(&[round], &InterpretSettings::default());
    assert_eq!(features.len(), 1);
    assert_eq!(
        (features[0].kind, features[0].reason),
        (FeatureKind::Unresolved, Some(Reason::CutOff))
    );
}

#[test]
fn partial_sweep_cuts_off_its_ends() {
    let mut part = fig13();
    part.pings.retain(|ping| ping.azimuth_deg < 75.0);
    let features = features(&[part], &InterpretSettings::default());
    let reasons: Vec<_> = features.iter().map(|feature| feature.reason).collect();
    assert_eq!(reasons, [Some(Reason::CutOff), None, Some(Reason::CutOff)]);
}

#[test]
fn covered_arc_is_interference() {
    let mut covered = fig13();
    for ping in &mut covered.pings[90..100] {
        (ping.status, ping.range_m) = (PingStatus::Echo, Some(0.3));
    }
    let features = features(&[covered], &InterpretSettings::default());
    let plane = features.iter().find(|f| f.range_m.is_some_and(|m| (m - 0.7).abs() < 1e-3));
    assert_eq!(plane.and_then(|plane| plane.reason), Some(Reason::Interference));
}

/// An arc partly covered from the second position decides nothing and is reported as such.
#[test]
fn covered_second_view_is_interference() {
    let text = shipped::text("plane-corner-edge").expect("shipped");
    let scene = std::sync::Arc::new(Scene::from_json(text).expect("a scene"));
    let simulator = simulator(scene.clone());
    let places = ["fig13", "second-plane"].map(|name| scene.pose(name).expect("a pose"));
    let [one, two] =
        [(1, places[0]), (2, places[1])].map(|(number, at)| scan(&simulator, number, &at));
    let planes = |scans: &[ScanView]| -> Vec<_> {
        let all = features(scans, &InterpretSettings::default()).into_iter();
        all.filter(|feature| feature.kind == FeatureKind::Plane).collect()
    };
    let seen = planes(&[one.clone(), two.clone()]);
    assert!(!seen.is_empty());
    let mut interfered = 0;
    for (plane, side) in seen.iter().flat_map(|plane| [(plane, 1.0), (plane, -1.0)]) {
        // A near object covers one end as seen from the second position.
        let mut covered = two.clone();
        let range_m = plane.range_m.expect("a range");
        let is_before = |ping: &sonard_records::Ping| {
            let off_deg = wrap_360(ping.azimuth_deg - plane.bearing_deg + 180.0) - 180.0;
            (8.0..16.0).contains(&(side * off_deg))
        };
        for ping in covered.pings.iter_mut().filter(|ping| is_before(ping)) {
            (ping.status, ping.range_m) = (PingStatus::Echo, Some(0.5 * range_m));
        }
        let all = features(&[one.clone(), covered], &InterpretSettings::default());
        let again =
            all.iter().find(|feature| (feature.scan, feature.beams) == (plane.scan, plane.beams));
        let again = again.expect("the first scan is unchanged");
        assert_ne!(again.kind, FeatureKind::Corner, "{again:?}");
        interfered += usize::from(again.reason == Some(Reason::Interference));
    }
    assert!(interfered > 0, "{} planes", seen.len());
}

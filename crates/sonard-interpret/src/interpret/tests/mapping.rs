//! Extent of the mapped region, and weights of scans.

use crate::interpret::{
    BeamOutcome, Sweep, SweepBeam,
    mapping::{MAX_RANGE_M, MapSettings},
};
use sonard_model::geometry::{DVec2, Pose};

/// Readings along +x from (1.02, 2.01).
fn sweep(outcomes: &[BeamOutcome]) -> Sweep {
    let beam = |&outcome| SweepBeam { azimuth_deg: 0.0, index: 0, outcome, mount: DVec2::ZERO };
    let pose = Pose { x_m: 1.02, y_m: 2.01, heading_deg: 0.0 };
    Sweep { pose, step_deg: 0.9, beams: outcomes.iter().map(beam).collect(), closed: false }
}

#[test]
fn few_scans_have_more_weight() {
    let mapping = MapSettings::default();
    let counts = [0, 1, 2, 3, 4, 5, 6, 1000].map(|scans| mapping.evidence(scans));
    assert_eq!(counts, [5, 5, 3, 2, 2, 1, 1, 1]);
    let fixed = MapSettings { evidence: Some(3), ..mapping };
    assert_eq!([1, 100].map(|scans| fixed.evidence(scans)), [3, 3]);
}

#[test]
fn mapped_region_has_a_margin() {
    let mapping = MapSettings::default();
    let sweeps = [sweep(&[
        BeamOutcome::Echo(2.0),
        BeamOutcome::Echo(4.5),
        BeamOutcome::NoEcho,
        BeamOutcome::BelowMinRange,
    ])];
    // Echoes reach x = 3.02; those beyond 4 m are ignored.
    let shape = mapping.shape(&sweeps, 4.0).expect("few cells");
    assert!(shape.origin.distance(DVec2::new(0.5, 1.5)) < 1e-9, "{shape:?}");
    assert_eq!((shape.width, shape.height, shape.resolution_m), (61, 21, 0.05));
    let region = Some([DVec2::new(-1.0, 0.0), DVec2::new(1.0, 0.5)]);
    let shape = MapSettings { region, ..mapping }.shape(&sweeps, MAX_RANGE_M).expect("few cells");
    assert_eq!((shape.origin, shape.width, shape.height), (DVec2::new(-1.0, 0.0), 40, 10));
}

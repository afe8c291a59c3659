//! Interpretation: one scan of 400 beams each, and line clusters.

use std::{hint::black_box, sync::Arc};

use criterion::{Criterion, criterion_group, criterion_main};
use jiff::Timestamp;
use sonard::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    interpret::{
        Extents, InterpretSettings, Sweep,
        grid::{BeamModel, GaussianBeam, Grid, GridShape, Trust},
        interpret,
        lines::clusters,
        prediction::{FeaturePrediction, PredictionSettings},
    },
    model::{Options, Simulator},
    scan::{ScanPlan, ScanView},
    scene::{Scene, shipped},
};
use uuid::Uuid;

const MAX_RANGE_M: f64 = 5.0;

/// Scans of a room, from places along a way.
fn sweeps() -> (Extents, Vec<Sweep>) {
    let scene = Scene::from_json(shipped::text("two-surface-room").expect("shipped"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let options = Options { max_range_m: Some(MAX_RANGE_M), ..Options::default() };
    let extents = Extents::new(&sensor, &Air::default(), false).expect("figures");
    let scene = Arc::new(scene.expect("a scene"));
    let simulator = Simulator::new(scene, sensor, Air::default(), options).expect("figures");
    let sweep = |i: u32| {
        let pose = Pose { x_m: 0.5 + 0.1 * f64::from(i), y_m: 0.9, heading_deg: 0.0 };
        let (id, plan) = (Uuid::from_u128(i.into()), ScanPlan::default());
        let scan = ScanView::simulated(&simulator, id, &pose, &plan, Timestamp::UNIX_EPOCH)
            .expect("few paths");
        Sweep::from_scan(&scan).expect("a sweep")
    };
    (extents, (0..20).map(sweep).collect())
}

fn interpretation(c: &mut Criterion) {
    let (extents, sweeps) = sweeps();
    let settings = InterpretSettings::default();
    let one = [(Uuid::nil(), sweeps[0].clone())];
    c.bench_function("interpret a scan", |b| {
        b.iter(|| interpret(black_box(&one), &extents, &settings));
    });

    let prediction = PredictionSettings::stepper(extents.plane_corner_deg(1.0, 1.0), MAX_RANGE_M);
    let mut predictor = FeaturePrediction::new(prediction);
    let mut next = (0..sweeps.len()).cycle();
    c.bench_function("feature prediction of a scan", |b| {
        b.iter(|| predictor.assess(black_box(&sweeps[next.next().unwrap_or(0)])));
    });

    let shape = GridShape::covering(DVec2::splat(-3.0), DVec2::splat(7.0), 0.02).expect("a grid");
    let model = BeamModel::Gaussian(GaussianBeam::new(20.7, MAX_RANGE_M));
    let mut grid = Grid::new(shape);
    c.bench_function("scan into 10 m x 10 m at 2 cm", |b| {
        b.iter(|| grid.add(black_box(&sweeps[0]), None, &model, &Trust::default()));
    });
}

fn clustering(c: &mut Criterion) {
    for count in [1_000, 10_000] {
        // Spread evenly by the golden angle.
        let points: Vec<DVec2> = (0..count)
            .map(|i| f64::from(i).sqrt() * DVec2::from_angle(2.399_963 * f64::from(i)))
            .collect();
        c.bench_function(&format!("clusters of {count} points"), |b| {
            b.iter(|| clusters(black_box(&points), 0.1));
        });
    }
}

criterion_group!(benches, interpretation, clustering);
criterion_main!(benches);

//! Pings and scans a second by engine, in `simple-room` to 10.7 m.

use std::{hint::black_box, sync::Arc};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use sonard::{
    acoustics::{Air, BeamPattern, Sensor},
    geometry::Pose,
    model::{EngineKind, Options, Simulator},
    scan::ScanPlan,
    scene::{Scene, shipped},
};

fn simulator(engine: EngineKind) -> (Simulator, Pose) {
    let text = shipped::text("simple-room").expect("shipped");
    let scene = Scene::from_json(text).expect("a scene");
    let pose = scene.poses["fig9"];
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let options = Options::from(engine.options());
    let simulator =
        Simulator::new(Arc::new(scene), sensor, Air::default(), options).expect("good options");
    (simulator, pose)
}

/// A firing from a new observation point: path search and one weighting.
fn ping(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("ping");
    group.throughput(Throughput::Elements(1)).sample_size(20);
    for engine in [EngineKind::Fan, EngineKind::Cone] {
        let (simulator, pose) = simulator(engine);
        group.bench_function(engine.name(), |bencher| {
            bencher.iter(|| {
                black_box(simulator.at(pose.position()).ping(black_box(-1.5)).expect("few paths"))
            });
        });
    }
    group.finish();
}

/// A full turn of 400 firings: one search, 400 weightings.
fn scan(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("scan of 400");
    let plan = ScanPlan::default();
    group.throughput(Throughput::Elements(plan.beams().into())).sample_size(20);
    for engine in [EngineKind::Fan, EngineKind::Cone] {
        let (simulator, pose) = simulator(engine);
        group.bench_function(engine.name(), |bencher| {
            bencher.iter(|| black_box(simulator.predict(&pose, &plan).expect("few paths")));
        });
    }
    group.finish();
}

/// Cost of a new sensor or temperature before the first ping.
fn beam(criterion: &mut Criterion) {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    criterion.bench_function("beam pattern", |bencher| {
        bencher.iter(|| black_box(BeamPattern::new(&sensor, black_box(343.99))));
    });
}

criterion_group!(benches, ping, scan, beam);
criterion_main!(benches);

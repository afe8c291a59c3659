//! Test room and scans of it, constructed from mirror images.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use uuid::Uuid;

use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose, wrap_pi},
    scene::{Cylinder, DEFAULT_SNAP_M, Material, Scene, Wall},
};
use sonard_records::{
    InteractionKind, InteractionRecord, LOG_FORMAT, ModelRecord, PathKind, PathRecord, Ping,
    PingStatus, Point, Provenance, Record, ScanEnd, ScanPlan, ScanStart, ScanView, SceneRef,
    Session, SimRecord,
};

const WIDTH_M: f64 = 0.928;
const HEIGHT_M: f64 = 0.742;
const SHELVING: Material = Material::smooth(0.98);

/// Rigid room of Dudek, Jenkin, Milios and Wilkes, figures 7 to 9.
pub(super) fn room() -> Scene {
    let corners = [(0.0, 0.0), (WIDTH_M, 0.0), (WIDTH_M, HEIGHT_M), (0.0, HEIGHT_M)];
    let names = ["south", "east", "north", "west"];
    let walls = (0..4).map(|i| Wall {
        id: names[i].into(),
        a: corners[i].into(),
        b: corners[(i + 1) % 4].into(),
        material: SHELVING,
        z_m: None,
    });
    Scene {
        name: "simple-room".into(),
        source: Some("Dudek, Jenkin, Milios and Wilkes, figures 7 to 9".into()),
        approximate: vec!["The reflectance is chosen.".into()],
        materials: BTreeMap::from([("shelving".into(), SHELVING)]),
        walls: walls.collect(),
        cylinders: Vec::new(),
        floor_z_m: None,
        ceiling_z_m: None,
        floor_material: Material::RIGID,
        ceiling_material: Material::RIGID,
        snap_m: DEFAULT_SNAP_M,
        poses: BTreeMap::from([
            ("fig7".into(), Pose { x_m: 0.834, y_m: 0.345, heading_deg: 0.0 }),
            ("fig9".into(), Pose { x_m: 0.774, y_m: 0.085, heading_deg: 0.0 }),
        ]),
        robot: None,
        sha256: String::new(),
        text: "".into(),
    }
}

/// Room with a rough cupboard and a table leg.
pub(super) fn furnished_room() -> Scene {
    let mut scene = room();
    let rough = Material { reflectance: 0.7, roughness: 0.4 };
    let corners = [(0.05, 0.5), (0.2, 0.5), (0.2, 0.7), (0.05, 0.7)];
    scene.walls.extend((0..4).map(|i| Wall {
        id: format!("cupboard.{i}").into(),
        a: corners[i].into(),
        b: corners[(i + 1) % 4].into(),
        material: rough,
        z_m: None,
    }));
    scene.cylinders.push(Cylinder {
        id: "leg".into(),
        center: DVec2::new(0.4, 0.3),
        radius_m: 0.02,
        material: rough,
        z_m: None,
    });
    scene
}

/// Scan of the room from its mirror images: measured (with noise) and simulated.
pub(super) fn scan_of_room(pose: Pose, step_deg: f64, seed: u64) -> ScanView {
    let mut rng = rand_pcg::Pcg32::seed_from_u64(seed);
    let scan = Uuid::from_u128(u128::from(seed) + 1);
    let plan = ScanPlan { step_deg, ..ScanPlan::default() };
    let pings = (0..plan.stops()).map(|i| {
        let azimuth_deg = plan.azimuth_deg(i);
        let sim = predict(&pose, azimuth_deg);
        measure(scan, i, azimuth_deg, sim, &mut rng)
    });
    let time = jiff::Timestamp::UNIX_EPOCH;
    let start = ScanStart::new(scan, time, pose, plan);
    let end = ScanEnd {
        scan,
        time: jiff::Timestamp::UNIX_EPOCH,
        beams: plan.beams(),
        missing: 0,
        repaired: 2,
        duration_s: 25.1,
        acoustic_limit_s: 24.9,
        home_drift_steps: Some(0),
        provenance: None,
    };
    let records = [Record::Session(Box::new(session())), Record::ScanStart(start)]
        .into_iter()
        .chain(pings.map(|ping| Record::Ping(Box::new(ping))).collect::<Vec<_>>())
        .chain([Record::ScanEnd(end)]);
    ScanView::from_records(records).remove(0)
}

/// Scan as logged by the model alone.
pub(super) fn simulated(mut view: ScanView) -> ScanView {
    let mut session = session();
    session.provenance = Provenance::Simulated;
    session.device = None;
    view.session = Some(session.into());
    for ping in &mut view.pings {
        if let Some(sim) = ping.sim.take() {
            ping.status = sim.status;
            ping.range_m = sim.range_m;
            ping.amplitude = sim.amplitude;
            ping.margin_db = sim.margin_db;
            ping.path = sim.path;
            ping.residual_m = None;
        }
    }
    view
}

/// Session of the default ranger in ordinary air.
pub(super) fn session() -> Session {
    let air = Air::new(20.0, 50.0, 101.325).expect("ordinary air");
    Session {
        format: LOG_FORMAT,
        started: jiff::Timestamp::UNIX_EPOCH,
        sonard: "0.1.0".into(),
        build: None,
        provenance: Provenance::Mock,
        robot: None,
        device: None,
        sensor: Sensor::preset("senscomp-6500").expect("a preset"),
        array: None,
        air: (&air).into(),
        scene: Some(SceneRef { name: "simple-room".into(), sha256: String::new() }),
        scene_text: None,
        model: Some(ModelRecord { engine: "fan".into(), settings: serde_json::Map::new() }),
        collection: None,
        imported: None,
    }
}

/// First image of the ranger with an echo above the threshold, in order of distance.
fn predict(pose: &Pose, azimuth_deg: f64) -> SimRecord {
    const THRESHOLD: f64 = 0.05;
    const BLANKING_M: f64 = 0.409;
    let mut images: Vec<(f64, f64, u32)> = Vec::new();
    for i in -4_i32..=4 {
        for k in -4_i32..=4 {
            let order = i.unsigned_abs() + k.unsigned_abs();
            if order == 0 {
                continue;
            }
            let mirrored = |n: i32, at: f64, size: f64| {
                f64::from(n) * size + if n % 2 == 0 { at } else { size - at }
            };
            let image = DVec2::new(mirrored(i, pose.x_m, WIDTH_M), mirrored(k, pose.y_m, HEIGHT_M));
            let ray = image - pose.position();
            let off = wrap_pi(ray.y.atan2(ray.x) - pose.direction_rad(azimuth_deg));
            let pattern = (-4.0 * (off / 0.127_f64).powi(2)).exp();
            let amplitude = pattern * 0.98_f64.powi(order as i32) * (-0.1 * ray.length()).exp();
            images.push((ray.length(), amplitude, order));
        }
    }
    images.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ringing = images.iter().any(|(length, amplitude, _)| {
        *amplitude > 0.3 && (2.0 * BLANKING_M - 0.11..2.0 * BLANKING_M).contains(length)
    });
    let found = images
        .iter()
        .find(|(length, amplitude, _)| *amplitude > THRESHOLD && *length > 2.0 * BLANKING_M);
    let best = found.or_else(|| images.iter().max_by(|a, b| a.1.total_cmp(&b.1)));
    let margin = |amplitude: f64| 20.0 * (amplitude / THRESHOLD).log10();
    SimRecord {
        status: match (ringing, found) {
            (true, _) => PingStatus::MinRange,
            (_, Some(_)) => PingStatus::Echo,
            _ => PingStatus::NoEcho,
        },
        range_m: if ringing { Some(BLANKING_M) } else { found.map(|f| f.0 / 2.0) },
        amplitude: best.map(|b| b.1),
        margin_db: best.map(|b| margin(b.1)),
        crosstalk: None,
        path: best.map(|(length_m, _, order)| PathRecord {
            kind: if order % 5 == 4 { PathKind::Diffracted } else { PathKind::Specular },
            order: *order,
            interactions: (0..*order)
                .map(|i| ["south", "north"][i as usize % 2])
                .map(reflection)
                .collect(),
            length_m: *length_m,
        }),
    }
}

/// Reflection at the origin.
pub(crate) fn reflection(id: impl Into<String>) -> InteractionRecord {
    InteractionRecord {
        kind: InteractionKind::Reflection,
        id: id.into(),
        point: Point::Plan([0.0; 2]),
    }
}

fn measure(
    scan: Uuid,
    index: u32,
    azimuth_deg: f64,
    sim: SimRecord,
    rng: &mut rand_pcg::Pcg32,
) -> Ping {
    let noise = Normal::new(0.0, 0.002).expect("a positive deviation").sample(rng);
    let mut range_m = sim.range_m.map(|range| range + noise);
    let mut status = sim.status;
    match rng.random_range(0..60) {
        0 => (status, range_m) = (PingStatus::NoEcho, None),
        1 => (status, range_m) = (PingStatus::Echo, Some(rng.random_range(0.45..6.0))),
        _ => {}
    }
    Ping {
        step: index as i32,
        time_sigma_us: Some(12.0),
        fired_ticks: Some(u64::from(index) * 100_000),
        tof_us: range_m.map(|range| range * 2e6 / 343.99),
        range_m,
        residual_m: range_m.zip(sim.range_m).map(|(a, b)| a - b),
        sim: Some(sim),
        ..Ping::new(scan, index, azimuth_deg, status)
    }
}

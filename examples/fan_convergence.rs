//! Convergence of the fan of rays to the exact paths with its number of rays, in all shipped scenes:
//! `cargo run --release --example fan_convergence -- PICTURE.png`.
//!
//! Both engines use the same ideal receiver, Kuc and Siegel's edge law and a transducer face
//! without reflection, the only ones that the fan supports, so the results differ by the geometry
//! alone.

use std::{error::Error, fs, sync::Arc};

use sonard::{
    acoustics::{Air, Sensor},
    geometry::wrap_pi,
    model::{Arrival, EdgeLawKind, EngineOptions, FanOptions, Options, PathOptions, Simulator},
    plot::{Convergence, badge_for, draw_convergence},
    scan::Provenance,
    scene::{Scene, shipped},
};

const SPACINGS_DEG: [f64; 9] = [5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01];

/// Off a round body neighbouring rays part faster.
const FINER_DEG: [f64; 3] = [0.005, 0.002, 0.001];

/// With a round body there are a hundred times more echoes beyond the first metres.
const MAX_RANGE_M: [f64; 2] = [8.0, 2.5];

const STEP_DEG: f64 = 9.0;

const THRESHOLD: f64 = 0.02;

/// Echoes that agree in length, departure and strength to within this are one: metres, radians,
/// share.
const SAME: [f64; 3] = [1e-3, 0.01, 0.05];

fn main() -> Result<(), Box<dyn Error>> {
    let target = std::env::args().nth(1).ok_or("give the name of a PNG file to write")?;
    let mut cases = Vec::new();
    for name in shipped::names() {
        let scene = Scene::from_json(shipped::text(name).ok_or("not shipped")?)?;
        let finer = if scene.robot.is_some() || !scene.cylinders.is_empty() { 3 } else { 0 };
        let spacings = SPACINGS_DEG.iter().chain(&FINER_DEG[..finer]);
        let errors: Result<Vec<[f64; 2]>, Box<dyn Error>> =
            spacings.map(|&spacing_deg| Ok([spacing_deg, error(&scene, spacing_deg)?])).collect();
        let case = Convergence { name: name.to_owned(), errors: errors? };
        println!("{name}: {:?}", case.errors);
        cases.push(case);
    }
    let lines = [format!(
        "Share of the echoes above the threshold, 40 azimuths at each pose of a scene to {} m ({} m with a \
         round body), that the fan lacks or makes up.",
        MAX_RANGE_M[0], MAX_RANGE_M[1]
    )];
    let axes = ["angle between the rays of the fan, degrees", "share of echoes that differ"];
    let badge = badge_for(Some(Provenance::Simulated));
    let picture =
        draw_convergence("The fan of rays and the exact paths", badge, &lines, axes, &cases);
    fs::write(target, picture.to_png(1200)?)?;
    Ok(())
}

/// Share of a scene's echoes in which the fan differs.
fn error(scene: &Scene, spacing_deg: f64) -> Result<f64, Box<dyn Error>> {
    let (mut differ, mut all) = (0, 0);
    for pose in scene.poses.values() {
        let plan = Arc::new(scene.with_robot_at(pose));
        let exact = PathOptions {
            ideal_receiver: true,
            edge_law: Some(EdgeLawKind::KucSiegel),
            ..PathOptions::default()
        };
        let fan = FanOptions { ray_spacing_deg: spacing_deg, ..FanOptions::default() };
        let (exact, fan) = (simulator(&plan, exact.into())?, simulator(&plan, fan.into())?);
        let [exact, fan] = [&exact, &fan].map(|simulator| simulator.at(pose.position()));
        for azimuth in 0..(360.0 / STEP_DEG) as u32 {
            let direction_rad = pose.direction_rad(STEP_DEG * f64::from(azimuth) + 1.0);
            let (exact, fan) = (exact.arrivals(direction_rad)?, fan.arrivals(direction_rad)?);
            let missing = lacks(&exact, &fan) + lacks(&fan, &exact);
            differ += missing;
            all += exact.iter().filter(|echo| is_loud(echo)).count();
        }
    }
    Ok(differ as f64 / all.max(1) as f64)
}

/// Counts the echoes above the threshold that are not among others, including those below it.
fn lacks(echoes: &[Arrival], others: &[Arrival]) -> usize {
    let known = |echo: &&Arrival| others.iter().any(|other| is_same(echo, other));
    echoes.iter().filter(|echo| is_loud(echo) && !known(echo)).count()
}

fn is_loud(echo: &Arrival) -> bool {
    echo.amplitude > THRESHOLD
}

fn simulator(scene: &Arc<Scene>, engine: EngineOptions) -> Result<Simulator, Box<dyn Error>> {
    let options = Options {
        engine,
        max_range_m: Some(MAX_RANGE_M[usize::from(!scene.cylinders.is_empty())]),
        threshold: Some(THRESHOLD),
    };
    let sensor = Sensor { face: None, ..Sensor::preset("senscomp-6500")? };
    Ok(Simulator::new(Arc::clone(scene), sensor, Air::default(), options)?)
}

fn is_same(one: &Arrival, other: &Arrival) -> bool {
    let turn = wrap_pi(one.departure_rad - other.departure_rad).abs();
    (one.length_m - other.length_m).abs() < SAME[0]
        && turn < SAME[1]
        && (one.amplitude / other.amplitude - 1.0).abs() < SAME[2]
}

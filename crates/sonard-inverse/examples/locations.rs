//! How often a sweep is located without a guess, and how long that takes.
//!
//! `cargo run --release -p sonard-inverse --example locations -- COUNT [SEED] [SCENE...]` draws COUNT places in each
//! scene (all shipped ones, if none is named) and locates a sweep of 400 beams from each, read to 4 m with noise of 1 mm
//! and the far tail of `TofNoise`. Right is a listed pose within 2 cm and 1 degree of the truth; sure is one that has
//! most of the probability. Prints both as shares, and times on one core.

mod rooms;

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use rooms::{place, readings};
use sonard_inverse::{Atlas, Mode, Sweep, World, locate};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{Pose, wrap_180},
    model::Options,
    scene::{Scene, shipped},
};
use uuid::Uuid;

fn main() {
    // One core, as a robot has it to spare.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("a thread");
    let (numbers, names): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|text| text.parse::<u64>().is_ok());
    let number =
        |at: usize, usual: u64| numbers.get(at).and_then(|text| text.parse().ok()).unwrap_or(usual);
    let (count, seed) = (number(0, 10), number(1, 1));
    println!(
        "{:24} {:>7} {:>7} {:>7} {:>10} {:>10} {:>10}",
        "scene", "places", "right", "sure", "atlas s", "median s", "95 % s"
    );
    let is_wanted = |name: &&str| names.is_empty() || names.iter().any(|wanted| wanted == name);
    for name in shipped::names().filter(is_wanted) {
        located_in(name, count, seed);
    }
}

fn located_in(name: &str, count: u64, seed: u64) {
    let text = shipped::text(name).expect("a shipped scene");
    let scene = Arc::new(Scene::from_json(text).expect("a scene"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let mut world = World::new(scene, sensor, Air::default(), Options::default());
    world.options.max_range_m = Some(4.0);
    let began = Instant::now();
    let atlas = match Atlas::new(&world, Atlas::usual_spacing_m(&world.scene)) {
        Ok(atlas) => atlas,
        Err(error) => return println!("{name:24} {error}"),
    };
    let atlas_s = began.elapsed().as_secs_f64();
    let mut rng = Pcg64::seed_from_u64(seed);
    let (mut right, mut sure, mut times) = (0, 0, Vec::new());
    for _ in 0..count {
        let Some(pose) = place(&world.scene, &mut rng) else { continue };
        let Some(beams) = readings(&world, &pose, &mut rng) else { continue };
        let unknown = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        let sweep = Sweep { scan: Uuid::nil(), pose: unknown, beams };
        let began = Instant::now();
        let modes = locate(&world, &atlas, &sweep).unwrap_or_default();
        times.push(began.elapsed());
        let found = modes.iter().find(|mode| is_there(mode, &pose));
        right += u32::from(found.is_some());
        sure += u32::from(found.is_some_and(|mode| mode.probability > 0.5));
        if found.is_none() {
            println!("{name}: not found: {pose:?} in {modes:?}");
        }
    }
    times.sort();
    let at = |share: f64| {
        let index = ((times.len() as f64 * share) as usize).min(times.len().saturating_sub(1));
        times.get(index).map_or(0.0, Duration::as_secs_f64)
    };
    let share = |of: u32| 100.0 * f64::from(of) / times.len().max(1) as f64;
    println!(
        "{name:24} {:7} {:5.1} % {:5.1} % {atlas_s:10.2} {:10.2} {:10.2}",
        times.len(),
        share(right),
        share(sure),
        at(0.5),
        at(0.95)
    );
}

fn is_there(mode: &Mode, pose: &Pose) -> bool {
    (mode.x_m - pose.x_m).hypot(mode.y_m - pose.y_m) < 0.02
        && wrap_180(mode.heading_deg - pose.heading_deg).abs() < 1.0
}

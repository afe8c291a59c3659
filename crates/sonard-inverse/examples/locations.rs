//! Success rate and duration of global localization of a sweep.
//!
//! `cargo run --release -p sonard-inverse --example locations -- COUNT [SEED] [BEAMS] [SCENE...]`
//! draws COUNT positions in each scene (all shipped ones by default) and locates a sweep of 400
//! beams from each. Ranges reach 4 m, with noise of 1 mm and the far tail of `TofNoise`. A listed
//! pose within 2 cm and 1 degree of the truth is correct (10 cm and 5 degrees with fewer than 100
//! beams). A listed pose is consistent if it is correct, or has a large standard deviation and a 95
//! % interval that contains the truth. A pose is confident if it is correct and has most of the
//! probability. The output gives all three as fractions, and CPU times of one core without other
//! processes.

mod rooms;

use std::{
    sync::{Arc, LazyLock},
    time::Instant,
};

use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use rooms::{BEAMS, place, readings};
use sonard_inverse::{CoarseGrid, FiringOutcome, FitSweep, PoseMode, World, locate};
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
    let (count, seed, beams) = (number(0, 10), number(1, 1), number(2, BEAMS.into()) as usize);
    println!(
        "{:24} {:>7} {:>7} {:>7} {:>7} {:>10} {:>10} {:>10}",
        "scene", "places", "right", "reported", "sure", "atlas s", "median s", "95 % s"
    );
    let is_wanted = |name: &&str| names.is_empty() || names.iter().any(|wanted| wanted == name);
    for name in shipped::names().filter(is_wanted) {
        located_in(name, count, seed, beams);
    }
}

fn located_in(name: &str, count: u64, seed: u64, beams: usize) {
    let text = shipped::text(name).expect("a shipped scene");
    let scene = Arc::new(Scene::from_json(text).expect("a scene"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let mut world = World::new(scene, sensor, Air::default(), Options::default());
    world.options.max_range_m = Some(4.0);
    let began = cpu_s();
    let atlas = match CoarseGrid::new(&world, CoarseGrid::default_spacing_m(&world.scene)) {
        Ok(atlas) => atlas,
        Err(error) => return println!("{name:24} {error}"),
    };
    let atlas_s = cpu_s() - began;
    let mut rng = Pcg64::seed_from_u64(seed);
    let (mut right, mut reported, mut sure, mut times) = (0, 0, 0, Vec::new());
    for _ in 0..count {
        let Some(pose) = place(&world.scene, &mut rng) else { continue };
        let Some(all) = readings(&world, &pose, 0.0, &mut rng) else { continue };
        let every = (all.len() / beams).max(1);
        let unknown = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        let beams_of = all.into_iter().step_by(every).collect();
        let sweep = FitSweep { scan: Uuid::nil(), pose: unknown, beams: beams_of };
        let began = cpu_s();
        let modes = locate(&world, &atlas, &sweep).unwrap_or_default();
        times.push(cpu_s() - began);
        let found = modes.iter().find(|mode| is_there(mode, &pose, beams));
        let is_reported =
            found.is_some() || modes.iter().any(|mode| is_reported(mode, &pose, beams));
        reported += u32::from(is_reported);
        right += u32::from(found.is_some());
        sure += u32::from(found.is_some_and(|mode| mode.probability > 0.5));
        if found.is_none() {
            let how = if is_reported { "reported as unknown" } else { "not found" };
            let echoes = sweep
                .beams
                .iter()
                .filter(|beam| matches!(beam.outcome, FiringOutcome::Echo { .. }));
            println!("{name}: {how} by {} echoes: {pose:?} in {modes:?}", echoes.count());
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = ((times.len() as f64 * share) as usize).min(times.len().saturating_sub(1));
        times.get(index).copied().unwrap_or(0.0)
    };
    let share = |of: u32| 100.0 * f64::from(of) / times.len().max(1) as f64;
    println!(
        "{name:24} {:7} {:5.1} % {:5.1} % {:5.1} % {atlas_s:10.2} {:10.2} {:10.2}",
        times.len(),
        share(right),
        share(reported),
        share(sure),
        at(0.5),
        at(0.95)
    );
}

/// Tolerance of a correct pose, metres and degrees.
const fn near(beams: usize) -> (f64, f64) {
    if beams < 100 { (0.1, 5.0) } else { (0.02, 1.0) }
}

fn off(mode: &PoseMode, pose: &Pose) -> (f64, f64, f64) {
    let turned_deg = wrap_180(mode.heading_deg - pose.heading_deg);
    (mode.x_m - pose.x_m, mode.y_m - pose.y_m, turned_deg)
}

fn is_there(mode: &PoseMode, pose: &Pose, beams: usize) -> bool {
    let ((x_m, y_m, turned_deg), (most_m, most_deg)) = (off(mode, pose), near(beams));
    x_m.hypot(y_m) < most_m && turned_deg.abs() < most_deg
}

/// Checks that an uncertain pose contains the truth in its 95 % interval.
fn is_reported(mode: &PoseMode, pose: &Pose, beams: usize) -> bool {
    // Each of three is within so many standard deviations in 98.3 % of cases, all in 95 %.
    const SIGMAS: f64 = 2.39;
    let ((x_m, y_m, turned_deg), (most_m, most_deg)) = (off(mode, pose), near(beams));
    let is_open =
        mode.sigma_x_m.hypot(mode.sigma_y_m) > most_m || mode.sigma_heading_deg > most_deg;
    let within = |off: f64, sigma: f64| off.abs() < SIGMAS * sigma;
    is_open
        && within(x_m, mode.sigma_x_m)
        && within(y_m, mode.sigma_y_m)
        && within(turned_deg, mode.sigma_heading_deg)
}

/// CPU time of this process, seconds; wall time where the system lacks it.
fn cpu_s() -> f64 {
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    let of = |task: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        Some(1e-9 * text.split_whitespace().next()?.parse::<f64>().ok()?)
    };
    let reported: Option<f64> =
        std::fs::read_dir("/proc/self/task").ok().and_then(|tasks| tasks.map(of).sum());
    reported.unwrap_or_else(|| BEGAN.elapsed().as_secs_f64())
}

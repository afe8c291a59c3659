//! Global localization of a sweep compared with standard range-based methods.
//!
//! `cargo run --release -p sonard-inverse --example baselines -- COUNT [SEED] [SCENE...]` draws
//! COUNT positions in each scene (all shipped ones by default) and locates a sweep of 400 beams
//! from each. Ranges reach 4 m, with noise of 1 mm and the far tail of `TofNoise`. The methods:
//!
//! - `locate` of this crate;
//! - nearest hit: ranges to the nearest hit within the beam, with a standard deviation of 5 cm and
//!   a floor for outliers;
//! - beam model: the four components of Thrun, Burgard and Fox (Probabilistic Robotics, section
//!   6.3: hit, short, none, random), with weights and widths learned from twenty sweeps at known
//!   poses in the same scene;
//! - histogram: the position with the most similar learned histogram of ranges (25 cm bins, and one
//!   for no echo), as in place recognition, from one sweep at each grid position; the heading is
//!   the rotation with the best fit of the ranges.
//!
//! All methods use the same grid (0.1 m, 3 degrees); the second and third refine the four best
//! poses by a pattern search. The output is the fraction of first answers within 2 cm and 1 degree,
//! and within 10 cm and 10 degrees, and the median time on one core. In a scene with point symmetry
//! either pose is correct.

mod methods;
mod rooms;
mod symmetry;

use std::{sync::Arc, time::Instant};

use methods::{BeamModel, Grid, Histograms, nearest_hit};
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use rooms::{place, readings};
use sonard_inverse::{CoarseGrid, FitSweep, World, locate};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{Pose, wrap_180},
    model::{EngineKind, Options},
    scene::{Scene, shipped},
};
use symmetry::equivalent_poses;
use uuid::Uuid;

const REACH_M: f64 = 4.0;
const TRAINING_SWEEPS: usize = 20;
const NAMES: [&str; 4] = ["locate", "nearest hit", "beam model", "histogram"];

fn main() {
    // One core, as a robot has it to spare.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("a thread");
    let (numbers, names): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|text| text.parse::<u64>().is_ok());
    let number =
        |at: usize, usual: u64| numbers.get(at).and_then(|text| text.parse().ok()).unwrap_or(usual);
    let (count, seed) = (number(0, 10), number(1, 1));
    println!("{:24} {:12} {:>8} {:>8} {:>10}", "scene", "by", "2 cm", "10 cm", "median s");
    let is_wanted = |name: &&str| names.is_empty() || names.iter().any(|wanted| wanted == name);
    for name in shipped::names().filter(is_wanted) {
        compared_in(name, count, seed);
    }
}

fn world_of(name: &str, engine: EngineKind) -> World {
    let text = shipped::text(name).expect("a shipped scene");
    let scene = Arc::new(Scene::from_json(text).expect("a scene"));
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let options =
        Options { engine: engine.options(), max_range_m: Some(REACH_M), ..Options::default() };
    World::new(scene, sensor, Air::default(), options)
}

/// Result of one localization method.
#[derive(Default)]
struct Tally {
    near: u32,
    far: u32,
    times_s: Vec<f64>,
}

fn compared_in(name: &str, count: u64, seed: u64) {
    let world = world_of(name, EngineKind::Paths);
    let atlas = match CoarseGrid::new(&world, CoarseGrid::default_spacing_m(&world.scene)) {
        Ok(atlas) => atlas,
        Err(error) => return println!("{name:24} {error}"),
    };
    let mut rng = Pcg64::seed_from_u64(seed);
    let taken = |rng: &mut Pcg64| {
        let pose = place(&world.scene, rng)?;
        let beams = readings(&world, &pose, 0.0, rng)?;
        let unknown = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        Some((pose, FitSweep { scan: Uuid::nil(), pose: unknown, beams }))
    };
    let grid = Grid::new(&world_of(name, EngineKind::Cone), REACH_M);
    let training: Vec<(Pose, FitSweep)> =
        (0..TRAINING_SWEEPS).filter_map(|_| taken(&mut rng)).collect();
    let beam_model = BeamModel::learned(&grid, &training);
    let histograms = Histograms::learned(&world, &grid, &mut rng);
    let mut tallies: [Tally; NAMES.len()] = Default::default();
    for _ in 0..count {
        let Some((pose, sweep)) = taken(&mut rng) else { continue };
        let by_crate = || {
            let modes = locate(&world, &atlas, &sweep).ok()?;
            modes.first().map(|m| Pose { x_m: m.x_m, y_m: m.y_m, heading_deg: m.heading_deg })
        };
        let (measured, right) = (grid.readings(&sweep), equivalent_poses(&world, &pose));
        let methods: [&dyn Fn() -> Option<Pose>; NAMES.len()] = [
            &by_crate,
            &|| grid.locate(&measured, &nearest_hit),
            &|| grid.locate(&measured, &|expected, read| beam_model.log_likelihood(expected, read)),
            &|| histograms.locate(&measured),
        ];
        for (tally, method) in tallies.iter_mut().zip(methods) {
            let began = Instant::now();
            let found = method();
            tally.times_s.push(began.elapsed().as_secs_f64());
            tally.near +=
                u32::from(found.is_some_and(|found| is_within(&found, &right, 0.02, 1.0)));
            tally.far += u32::from(found.is_some_and(|found| is_within(&found, &right, 0.1, 10.0)));
        }
    }
    for (method, mut tally) in NAMES.into_iter().zip(tallies) {
        tally.times_s.sort_by(f64::total_cmp);
        let of = tally.times_s.len();
        let share = |part: u32| format!("{:.0} %", 100.0 * f64::from(part) / of.max(1) as f64);
        let median_s = tally.times_s.get(of / 2).copied().unwrap_or(0.0);
        println!(
            "{name:24} {method:12} {:>8} {:>8} {median_s:>10.3}",
            share(tally.near),
            share(tally.far)
        );
    }
}

fn is_within(found: &Pose, right: &[Pose], max_m: f64, max_deg: f64) -> bool {
    right.iter().any(|pose| {
        found.position().distance(pose.position()) < max_m
            && wrap_180(found.heading_deg - pose.heading_deg).abs() < max_deg
    })
}

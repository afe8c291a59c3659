//! Cost of one pose hypothesis of a sweep, with derivatives by x, y and heading.
//!
//! `cargo run --release -p sonard-inverse --example hypotheses` predicts 400 beams from many
//! positions in each scene, sequentially on one core. The output is the median time of the
//! predictions alone and of a hypothesis. Scene names as arguments select among the scenes.

#[path = "rooms/error_model.rs"]
mod error_model;
mod rooms;

use std::{hint::black_box, sync::Arc, time::Instant};

use error_model::ERRORS;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use rooms::{place, readings};
use sonard_inverse::{FitSweep, Hypotheses, Parameter, World};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    model::Options,
    scene::{Scene, shipped},
};
use uuid::Uuid;

/// Scenes with their maximum ranges, metres.
const TO_M: [(&str, f64); 4] =
    [("simple-room", 4.0), ("simple-room", 10.7), ("simple-room-robot", 4.0), ("mcgill-lab", 10.7)];
/// Positions per scene.
const PLACES: usize = 41;
/// Repetitions per position.
const RUNS: u32 = 9;

fn main() {
    println!("{:20} {:>8} {:>10} {:>12}", "scene", "to", "readings", "hypothesis");
    let only: Vec<String> = std::env::args().skip(1).collect();
    for (name, to_m) in TO_M {
        if !only.is_empty() && !only.iter().any(|wanted| wanted == name) {
            continue;
        }
        let Some((readings_ms, hypothesis_ms)) = times(name, to_m) else {
            eprintln!("{name}: can't be predicted");
            std::process::exit(1);
        };
        println!("{name:20} {to_m:6.1} m {readings_ms:7.3} ms {hypothesis_ms:9.3} ms");
    }
}

/// Median time of a sweep's predictions alone and of its likelihood with derivatives, milliseconds.
fn times(name: &str, to_m: f64) -> Option<(f64, f64)> {
    let scene = Arc::new(Scene::from_json(shipped::text(name)?).ok()?);
    let sensor = Sensor::preset("senscomp-6500").ok()?;
    let mut world = World::new(scene, sensor, Air::default(), Options::default());
    world.options.max_range_m = Some(to_m);
    let mut rng = Pcg64::seed_from_u64(1);
    let parameters = vec![Parameter::X(0), Parameter::Y(0), Parameter::Heading(0)];
    let hypotheses = Hypotheses::new(world.clone(), parameters).ok()?;
    let (mut alone, mut whole) = (Vec::new(), Vec::new());
    for _ in 0..PLACES {
        let pose = place(&world.scene, &mut rng)?;
        let sweep =
            FitSweep { scan: Uuid::nil(), pose, beams: readings(&world, &pose, 0.0, &mut rng)? };
        let off = Pose { x_m: pose.x_m + 0.02, ..pose };
        let simulator = world.simulator(&off).ok()?;
        alone.push(best_ms(|| {
            // As a hypothesis is: with a body moved along, and nothing known of the place.
            let simulator = simulator.in_scene(Arc::clone(simulator.scene())).ok()?;
            let point = simulator.at(off.position());
            for beam in &sweep.beams {
                black_box(point.ping(world.direction_rad(&off, beam.azimuth_deg)).ok()?);
            }
            Some(())
        })?);
        whole.push(best_ms(|| {
            black_box(hypotheses.log_likelihood(&sweep, &off, &ERRORS).ok()?);
            Some(())
        })?);
    }
    Some((median(alone), median(whole)))
}

/// Minimum time of several runs, milliseconds, to exclude other load on the computer.
fn best_ms(mut run: impl FnMut() -> Option<()>) -> Option<f64> {
    let mut best = f64::INFINITY;
    for _ in 0..RUNS {
        let began = Instant::now();
        run()?;
        best = best.min(began.elapsed().as_secs_f64() * 1e3);
    }
    Some(best)
}

fn median(mut of: Vec<f64>) -> f64 {
    of.sort_by(f64::total_cmp);
    of[of.len() / 2]
}

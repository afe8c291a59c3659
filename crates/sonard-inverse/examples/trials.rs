//! How well parameters are found again in simulation, beside the bound of Cramer and Rao.
//!
//! `cargo run --release -p sonard-inverse --example trials -- COUNT [SEED]` draws COUNT worlds: a shipped scene, a place
//! in it, and what is wrong with what is believed of it (pose by up to 10 cm and 8 degrees, air by 8 degrees
//! Celsius, a wall by 5 cm, threshold by 6 dB). Readings have noise of 1 mm with the far tail of `TofNoise`.
//! Prints for each parameter the root mean square of the errors, the same as a multiple of the bound, the median of
//! that and of the standard deviations told, the share of 95 % intervals that hold the truth, and how many trials went
//! wrong with a small interval (beyond six standard deviations).

mod rooms;
#[path = "rooms/spread.rs"]
mod spread;

use std::sync::Arc;

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use rooms::{BEAMS, NOISE_MM, place, readings};
use sonard_inverse::{Fit, Parameter, Prior, Sweep, World, bound, fit};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::Options,
    scene::{Scene, shipped},
};
use spread::SPREAD;
use uuid::Uuid;

/// What a trial found of a parameter.
#[derive(Clone)]
struct Found {
    name: String,
    error: f64,
    sigma: f64,
    bound: f64,
}

struct Trial {
    scene: &'static str,
    found: Vec<Found>,
    took_s: f64,
    explained: f64,
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|text| text.parse::<u64>().ok());
    let (count, seed) = (arguments.next().unwrap_or(50), arguments.next().unwrap_or(1));
    let trials: Vec<Trial> = (0..count)
        .into_par_iter()
        .filter_map(|at| trial(seed.wrapping_mul(1_000_003) + at))
        .collect();
    print(&trials, count);
}

fn trial(seed: u64) -> Option<Trial> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let names: Vec<&'static str> = shipped::names().collect();
    let name = names[rng.random_range(0..names.len())];
    let scene = Arc::new(Scene::from_json(shipped::text(name)?).ok()?);
    let sensor = Sensor::preset("senscomp-6500").ok()?;
    let mut believed = World::new(scene, sensor, Air::default(), Options::default());
    believed.options.max_range_m = Some(4.0);
    let pose = place(&believed.scene, &mut rng)?;
    let mut off = |most: f64| rng.random_range(-most..most);
    let (wall_m, shift, turn_deg) = (off(0.05), DVec2::new(off(0.1), off(0.1)), off(8.0));
    let (air_c, threshold_db) = (off(8.0), off(6.0));
    let wall = rng.random_range(0..believed.scene.walls.len());
    let warmer = Air::new(20.0 + air_c, 50.0, 101.325).ok()?.sound_speed_m_s();
    let faster = warmer / believed.air.sound_speed_m_s() - 1.0;
    // From the truth to what is believed.
    let parameters = [
        (Parameter::X(0), -shift.x, 0.058),
        (Parameter::Y(0), -shift.y, 0.058),
        (Parameter::Heading(0), -turn_deg, 4.6),
        (Parameter::SoundSpeed, faster, 0.008),
        (Parameter::Threshold, threshold_db, 3.5),
        (Parameter::Wall(wall), wall_m, 0.029),
    ];
    let changes: Vec<_> = parameters.iter().map(|(parameter, by, _)| (parameter, *by)).collect();
    let truth = believed.changed(&changes).ok()?;
    if truth.scene.check_pose(&pose).is_err() {
        return None;
    }
    let beams = readings(&truth, &pose, &mut rng)?;
    let there = Sweep { scan: Uuid::nil(), pose, beams };
    let said = Pose {
        x_m: pose.x_m + shift.x,
        y_m: pose.y_m + shift.y,
        heading_deg: pose.heading_deg + turn_deg,
    };
    let here = Sweep { pose: said, ..there.clone() };
    let priors =
        parameters.iter().map(|(of, _, sigma)| Prior { parameter: of.clone(), sigma: *sigma });
    let what = Fit {
        priors: priors.collect(),
        widest_m: 0.15,
        widest_turn_deg: 12.0,
        least_sigma_m: 2e-4,
        least_sigma_db: 0.5,
    };
    let bounds = bound(&truth, std::slice::from_ref(&there), &what, &SPREAD).ok()?;
    let began = std::time::Instant::now();
    let fitted = fit(&believed, std::slice::from_ref(&here), &what).ok()?;
    let took_s = began.elapsed().as_secs_f64();
    let found = parameters.iter().zip(&fitted.estimates).zip(bounds).map(
        |(((parameter, expected, _), estimate), bound)| Found {
            name: match parameter {
                Parameter::Wall(_) => "wall".to_owned(),
                other => other.to_string(),
            },
            error: estimate.change - expected,
            sigma: estimate.sigma,
            bound,
        },
    );
    Some(Trial {
        scene: name,
        found: found.collect(),
        took_s,
        explained: 1.0 - fitted.errors.clutter,
    })
}

fn print(trials: &[Trial], count: u64) {
    println!("{} of {count} trials, {BEAMS} beams, noise {NOISE_MM} mm", trials.len());
    let mut times: Vec<f64> = trials.iter().map(|trial| trial.took_s).collect();
    times.sort_by(f64::total_cmp);
    if let Some(median) = times.get(times.len() / 2) {
        println!("a fit took {median:.2} s (median), {:.2} s (most)", times[times.len() - 1]);
    }
    println!(
        "{:16} {:>10} {:>10} {:>10} {:>10} {:>9} {:>8}",
        "", "rms", "rms/bound", "median/b.", "sigma/b.", "95 % hold", "wrong"
    );
    let names = trials.first().map_or(0, |trial| trial.found.len());
    for at in 0..names {
        let of: Vec<&Found> = trials.iter().map(|trial| &trial.found[at]).collect();
        let count = of.len() as f64;
        let rms = (of.iter().map(|found| found.error.powi(2)).sum::<f64>() / count).sqrt();
        let ratio = (of.iter().map(|found| (found.error / found.bound).powi(2)).sum::<f64>()
            / count)
            .sqrt();
        let mut sizes: Vec<f64> =
            of.iter().map(|found| (found.error / found.bound).abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let holds = of.iter().filter(|found| found.error.abs() < 1.96 * found.sigma).count();
        let wrong = of.iter().filter(|found| found.error.abs() > 6.0 * found.sigma).count();
        let mut doubts: Vec<f64> = of.iter().map(|found| found.sigma / found.bound).collect();
        doubts.sort_by(f64::total_cmp);
        println!(
            "{:16} {rms:10.5} {ratio:10.2} {:10.2} {:10.2} {:7.1} % {wrong:8}",
            of[0].name,
            sizes[sizes.len() / 2] / 0.6745,
            doubts[doubts.len() / 2],
            100.0 * holds as f64 / count
        );
    }
    for trial in trials {
        let worst =
            trial.found.iter().map(|found| (found.error / found.sigma).abs()).fold(0.0, f64::max);
        if worst > 6.0 {
            let of = |found: &Found| {
                format!(
                    "{} {:.4} ({:.1} sigma)",
                    found.name,
                    found.error,
                    found.error / found.sigma
                )
            };
            let all: Vec<String> = trial.found.iter().map(of).collect();
            println!(
                "{}: {:.0} % explained, {}",
                trial.scene,
                100.0 * trial.explained,
                all.join(", ")
            );
        }
    }
}

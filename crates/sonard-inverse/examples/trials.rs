//! How well parameters are found again in simulation, beside the bound of Cramer and Rao.
//!
//! `cargo run --release -p sonard-inverse --example trials -- COUNT [SEED] [MINUTES] [mounting] [furniture] [bodiless] [quick] [each]`
//! draws COUNT worlds: a shipped scene, a place in it, and what is wrong with what is believed of it (pose by up to 10 cm
//! and 8 degrees, air by 8 degrees Celsius, a wall by 5 cm, threshold by 6 dB; with `mounting` the face by 3 cm ahead and
//! aside, with `furniture` five round things that the scene lacks). Readings have noise of 1 mm with the far tail of
//! `TofNoise`, and thresholds that vary by 0.5 dB from firing to firing. None is begun after so many minutes. Prints for each parameter the root mean square of the errors, the
//! same as a multiple of the bound and of the standard deviations told, the median of that and of the standard deviations told, the share of 95 % intervals
//! that hold the truth, the same of parameters that readings say more of than was believed, with how many these are (what is left at its prior is
//! drawn from as wide an interval, which holds it always), and how many trials went wrong with a small interval (beyond six standard deviations).
//!
//! Each trial is fitted a second time from the truth. Where that ends in the same place, the bound tells how far off an
//! estimate should be. Where it ends elsewhere and is likelier, the search failed; where it is less likely, the readings
//! mislead whoever believes them. The table is printed for all trials, and for those that ended where the truth's own fit
//! does. `each` prints a line for every trial, `at=N` runs that one alone; `bodiless` leaves out scenes with a robot's body, and `quick`
//! fits as `sonard calibrate --search quick` does.

mod rooms;
#[path = "rooms/spread.rs"]
mod spread;
mod wrong;

use std::time::{Duration, Instant};

use rayon::prelude::*;
use rooms::{BEAMS, NOISE_MM};
use sonard_inverse::{Parameter, Search, bound, fit, fit_from};
use spread::SPREAD;
use wrong::{Kinds, Wrong};

/// What a trial found of a parameter.
#[derive(Clone)]
struct Found {
    name: String,
    error: f64,
    sigma: f64,
    is_identified: bool,
    /// Of the readings as they are, furniture left out.
    bound: f64,
    /// Of those that there would be without furniture.
    unhindered: f64,
}

struct Trial {
    number: u64,
    scene: &'static str,
    found: Vec<Found>,
    took_s: f64,
    explained: f64,
    /// By how much the logarithm of the posterior is higher where the fit ended than where one ends that begins at the
    /// truth.
    likelier: f64,
    /// Whether both ended in the same place.
    is_same: bool,
}

/// Ends this near to each other are the same: in standard deviations that the truth's own fit tells.
const SAME: f64 = 4.0;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let numbers: Vec<u64> = words.iter().filter_map(|text| text.parse().ok()).collect();
    let number = |at: usize, usual: u64| numbers.get(at).copied().unwrap_or(usual);
    let (count, seed, minutes) = (number(0, 50), number(1, 1), number(2, 1_000_000));
    let has = |wanted: &str| words.iter().any(|word| word == wanted);
    let kinds = Kinds {
        mounting: has("mounting"),
        furniture: has("furniture"),
        bodiless: has("bodiless"),
        search: has("quick").then_some(Search::Quick),
    };
    let alone = words.iter().find_map(|word| word.strip_prefix("at=")?.parse().ok());
    let wanted = alone.map_or(0..count, |at: u64| at..at + 1);
    let (began, is_each) = (Instant::now(), has("each") || alone.is_some());
    let trials: Vec<Trial> = wanted
        .into_par_iter()
        .filter(|_| began.elapsed() < Duration::from_secs(60 * minutes))
        .filter_map(|at| {
            let trial = trial(at, seed, kinds)?;
            if is_each {
                println!("{}", line(&trial));
            }
            Some(trial)
        })
        .collect();
    print(&trials);
}

fn trial(number: u64, seed: u64, kinds: Kinds) -> Option<Trial> {
    let wrong = Wrong::drawn(seed.wrapping_mul(1_000_003) + number, kinds)?;
    let there = std::slice::from_ref(&wrong.there);
    let bounds = bound(&wrong.truth, there, &wrong.fit, &SPREAD).ok()?;
    let unhindered = std::slice::from_ref(&wrong.unhindered);
    let unhindered = bound(&wrong.truth, unhindered, &wrong.fit, &SPREAD).ok()?;
    let began = Instant::now();
    let here = std::slice::from_ref(&wrong.here);
    let fitted = fit(&wrong.believed, here, &wrong.fit).ok()?;
    let took_s = began.elapsed().as_secs_f64();
    let of_truth = fit_from(&wrong.believed, here, &wrong.fit, &wrong.expected, &SPREAD).ok()?;
    let both = fitted.estimates.iter().zip(&of_truth.estimates);
    let is_same =
        both.clone().all(|(one, other)| (one.change - other.change).abs() < SAME * other.sigma);
    let found = wrong.fit.priors.iter().enumerate().map(|(at, prior)| Found {
        name: match &prior.parameter {
            Parameter::Wall(_) => "wall".to_owned(),
            other => other.to_string(),
        },
        error: fitted.estimates[at].change - wrong.expected[at],
        sigma: fitted.estimates[at].sigma,
        is_identified: fitted.estimates[at].identified,
        bound: bounds[at],
        unhindered: unhindered[at],
    });
    Some(Trial {
        number,
        scene: wrong.scene,
        found: found.collect(),
        took_s,
        explained: fitted.errors.explained(),
        likelier: fitted.log_posterior - of_truth.log_posterior,
        is_same,
    })
}

fn print(trials: &[Trial]) {
    println!("{} trials, {BEAMS} beams, noise {NOISE_MM} mm", trials.len());
    let mut times: Vec<f64> = trials.iter().map(|trial| trial.took_s).collect();
    times.sort_by(f64::total_cmp);
    if let Some(median) = times.get(times.len() / 2) {
        println!("a fit took {median:.2} s (median), {:.2} s (most)", times[times.len() - 1]);
    }
    table(&trials.iter().collect::<Vec<_>>());
    let (same, other): (Vec<&Trial>, Vec<&Trial>) = trials.iter().partition(|trial| trial.is_same);
    let (likelier, less): (Vec<&Trial>, Vec<&Trial>) =
        other.iter().copied().partition(|trial| trial.likelier > 0.0);
    println!("\n{} ended where the truth's own fit does:", same.len());
    table(&same);
    let mut by: Vec<f64> = likelier.iter().map(|trial| trial.likelier).collect();
    by.sort_by(f64::total_cmp);
    println!(
        "\n{} ended elsewhere where the posterior is higher, its logarithm by {:.1} (median), {:.1} (most)",
        likelier.len(),
        by.get(by.len() / 2).copied().unwrap_or(0.0),
        by.last().copied().unwrap_or(0.0)
    );
    println!("{} ended elsewhere where it is lower: the search failed\n", less.len());
    let of_sigma = |trial: &Trial| {
        trial.found.iter().map(|found| (found.error / found.sigma).abs()).fold(0.0, f64::max)
    };
    println!("beyond 6 sigma:");
    for trial in trials.iter().filter(|trial| of_sigma(trial) > 6.0) {
        println!("{}", line(trial));
    }
}

fn table(trials: &[&Trial]) {
    println!(
        "{:16} {:>10} {:>10} {:>10} {:>10} {:>10} {:>10} {:>9} {:>17} {:>8}",
        "",
        "rms",
        "rms/bound",
        "rms/sigma",
        "median/b.",
        "median/u.",
        "sigma/b.",
        "95 % hold",
        "identified hold",
        "wrong"
    );
    let names = trials.first().map_or(0, |trial| trial.found.len());
    for at in 0..names {
        let of: Vec<&Found> = trials.iter().map(|trial| &trial.found[at]).collect();
        let count = of.len() as f64;
        let rms = |of: &mut dyn Iterator<Item = f64>| {
            (of.map(|error| error * error).sum::<f64>() / count).sqrt()
        };
        let median = |of: &mut dyn Iterator<Item = f64>| {
            let mut sizes: Vec<f64> = of.map(f64::abs).collect();
            sizes.sort_by(f64::total_cmp);
            sizes[sizes.len() / 2]
        };
        let holds = |of: &[&Found]| {
            let holding = of.iter().filter(|found| found.error.abs() < 1.96 * found.sigma);
            100.0 * holding.count() as f64 / of.len().max(1) as f64
        };
        let identified: Vec<&Found> =
            of.iter().copied().filter(|found| found.is_identified).collect();
        let wrong = of.iter().filter(|found| found.error.abs() > 6.0 * found.sigma).count();
        println!(
            "{:16} {:10.5} {:10.2} {:10.2} {:10.2} {:10.2} {:10.2} {:7.1} % {:7.1} % of {:4} {wrong:8}",
            of[0].name,
            rms(&mut of.iter().map(|found| found.error)),
            rms(&mut of.iter().map(|found| found.error / found.bound)),
            rms(&mut of.iter().map(|found| found.error / found.sigma)),
            // Of a normal distribution as many standard deviations.
            median(&mut of.iter().map(|found| found.error / found.bound)) / 0.6745,
            median(&mut of.iter().map(|found| found.error / found.unhindered)) / 0.6745,
            median(&mut of.iter().map(|found| found.sigma / found.bound)),
            holds(&of),
            holds(&identified),
            identified.len()
        );
    }
}

fn line(trial: &Trial) -> String {
    let of = |found: &Found| {
        format!(
            "{} {:.4} ({:.1} sigma, {:.1} bounds)",
            found.name,
            found.error,
            found.error / found.sigma,
            found.error / found.bound
        )
    };
    let all: Vec<String> = trial.found.iter().map(of).collect();
    format!(
        "{} {}: {:.0} % explained, {} {:.2}, {:.1} s, {}",
        trial.number,
        trial.scene,
        100.0 * trial.explained,
        if trial.is_same { "same" } else { "other" },
        trial.likelier,
        trial.took_s,
        all.join(", ")
    )
}

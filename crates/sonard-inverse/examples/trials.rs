//! Accuracy of estimated parameters in simulation, compared with the Cramer-Rao bound.
//!
//! ```text
//! cargo run --release -p sonard-inverse --example trials -- \
//!     COUNT [SEED] [MINUTES] [mounting] [furniture] [bodiless] [quick] [each]
//! ```
//!
//! draws COUNT worlds: a shipped scene, a position in it, and initial errors (pose up to 10 cm and
//! 8 degrees, air 8 degrees Celsius, a wall 5 cm, threshold 6 dB; with `mounting` the transducer
//! face 3 cm ahead and to the side, with `furniture` five cylinders missing in the scene). Readings
//! have noise of 1 mm with the far tail of `TofNoise`, and thresholds that vary by 0.5 dB between
//! firings. No trial starts after MINUTES.
//!
//! The output gives for each parameter the root mean square error; its ratios to the bound and to
//! the estimated standard deviation; the medians of that ratio and of the standard deviations; the
//! fraction of 95 % intervals that contain the truth; the same fraction of the identified
//! parameters with their number (an unidentified parameter is drawn from as wide an interval as its
//! prior, which always contains it); and the number of failed trials with a small interval (errors
//! beyond six standard deviations).
//!
//! Each trial is fitted a second time from the truth. If both fits agree, the bound predicts the
//! error of an estimate. If the first ends elsewhere with a lower posterior, the search failed;
//! with a higher one, the readings are misleading. The table covers all trials, and those whose
//! fits agree. `each` prints a line per trial, `at=N` runs a single trial; `bodiless` omits scenes
//! with a robot body, and `quick` fits as `sonard calibrate --search quick` does.

#[path = "rooms/error_model.rs"]
mod error_model;
mod perturbed;
mod rooms;

use std::time::{Duration, Instant};

use error_model::ERRORS;
use perturbed::{Kinds, PerturbedWorld};
use rayon::prelude::*;
use rooms::{BEAMS, NOISE_MM};
use sonard_inverse::{Parameter, Search, cramer_rao_bound, fit, fit_from};

/// Estimate of one parameter in a trial.
#[derive(Clone)]
struct ParameterError {
    name: String,
    error: f64,
    sigma: f64,
    is_identified: bool,
    /// Bound for the actual readings, with the furniture missing in the model.
    bound: f64,
    /// Bound for the readings without furniture.
    unobstructed: f64,
}

struct Trial {
    number: u64,
    scene: &'static str,
    found: Vec<ParameterError>,
    duration_s: f64,
    explained: f64,
    /// Log-posterior of this fit minus that of the fit from the truth.
    log_ratio: f64,
    /// Agreement of both fits.
    is_same: bool,
}

/// Maximum distance of equal optima, in standard deviations of the fit from the truth.
const SAME: f64 = 4.0;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let numbers: Vec<u64> = words.iter().filter_map(|text| text.parse().ok()).collect();
    let number = |at: usize, default: u64| numbers.get(at).copied().unwrap_or(default);
    let (count, seed, minutes) = (number(0, 50), number(1, 1), number(2, 1_000_000));
    let has = |flag: &str| words.iter().any(|word| word == flag);
    let kinds = Kinds {
        mounting: has("mounting"),
        furniture: has("furniture"),
        bodiless: has("bodiless"),
        search: has("quick").then_some(Search::Quick),
    };
    let alone = words.iter().find_map(|word| word.strip_prefix("at=")?.parse().ok());
    let numbers_to_run = alone.map_or(0..count, |at: u64| at..at + 1);
    let (began, is_each) = (Instant::now(), has("each") || alone.is_some());
    let trials: Vec<Trial> = numbers_to_run
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
    let perturbed = PerturbedWorld::random(seed.wrapping_mul(1_000_003) + number, kinds)?;
    let true_sweeps = std::slice::from_ref(&perturbed.true_sweep);
    let bounds = cramer_rao_bound(&perturbed.truth, true_sweeps, &perturbed.fit, &ERRORS).ok()?;
    let unobstructed_sweeps = std::slice::from_ref(&perturbed.unobstructed);
    let unobstructed =
        cramer_rao_bound(&perturbed.truth, unobstructed_sweeps, &perturbed.fit, &ERRORS).ok()?;
    let began = Instant::now();
    let assumed_sweeps = std::slice::from_ref(&perturbed.assumed_sweep);
    let fitted = fit(&perturbed.assumed, assumed_sweeps, &perturbed.fit).ok()?;
    let duration_s = began.elapsed().as_secs_f64();
    let from_truth =
        fit_from(&perturbed.assumed, assumed_sweeps, &perturbed.fit, &perturbed.expected, &ERRORS)
            .ok()?;
    let both = fitted.estimates.iter().zip(&from_truth.estimates);
    let is_same = both.clone().all(|(a, b)| (a.change - b.change).abs() < SAME * b.sigma);
    let found = perturbed.fit.priors.iter().enumerate().map(|(at, prior)| ParameterError {
        name: match &prior.parameter {
            Parameter::Wall(_) => "wall".to_owned(),
            other => other.to_string(),
        },
        error: fitted.estimates[at].change - perturbed.expected[at],
        sigma: fitted.estimates[at].sigma,
        is_identified: fitted.estimates[at].identified,
        bound: bounds[at],
        unobstructed: unobstructed[at],
    });
    Some(Trial {
        number,
        scene: perturbed.scene,
        found: found.collect(),
        duration_s,
        explained: fitted.errors.explained(),
        log_ratio: fitted.log_posterior - from_truth.log_posterior,
        is_same,
    })
}

fn print(trials: &[Trial]) {
    println!("{} trials, {BEAMS} beams, noise {NOISE_MM} mm", trials.len());
    let mut times: Vec<f64> = trials.iter().map(|trial| trial.duration_s).collect();
    times.sort_by(f64::total_cmp);
    if let Some(median) = times.get(times.len() / 2) {
        println!("a fit took {median:.2} s (median), {:.2} s (maximum)", times[times.len() - 1]);
    }
    table(&trials.iter().collect::<Vec<_>>());
    let (same, other): (Vec<&Trial>, Vec<&Trial>) = trials.iter().partition(|trial| trial.is_same);
    let (log_ratio, less): (Vec<&Trial>, Vec<&Trial>) =
        other.iter().copied().partition(|trial| trial.log_ratio > 0.0);
    println!("\n{} ended where the truth's own fit does:", same.len());
    table(&same);
    let mut by: Vec<f64> = log_ratio.iter().map(|trial| trial.log_ratio).collect();
    by.sort_by(f64::total_cmp);
    println!(
        "\n{} ended elsewhere where the posterior is higher, its logarithm by {:.1} (median), {:.1} (maximum)",
        log_ratio.len(),
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
        "failed"
    );
    let names = trials.first().map_or(0, |trial| trial.found.len());
    for at in 0..names {
        let of: Vec<&ParameterError> = trials.iter().map(|trial| &trial.found[at]).collect();
        let count = of.len() as f64;
        let rms = |of: &mut dyn Iterator<Item = f64>| {
            (of.map(|error| error * error).sum::<f64>() / count).sqrt()
        };
        let median = |of: &mut dyn Iterator<Item = f64>| {
            let mut sizes: Vec<f64> = of.map(f64::abs).collect();
            sizes.sort_by(f64::total_cmp);
            sizes[sizes.len() / 2]
        };
        let holds = |of: &[&ParameterError]| {
            let holding = of.iter().filter(|found| found.error.abs() < 1.96 * found.sigma);
            100.0 * holding.count() as f64 / of.len().max(1) as f64
        };
        let identified: Vec<&ParameterError> =
            of.iter().copied().filter(|found| found.is_identified).collect();
        let failed = of.iter().filter(|found| found.error.abs() > 6.0 * found.sigma).count();
        println!(
            "{:16} {:10.5} {:10.2} {:10.2} {:10.2} {:10.2} {:10.2} {:7.1} % {:7.1} % of {:4} {failed:8}",
            of[0].name,
            rms(&mut of.iter().map(|found| found.error)),
            rms(&mut of.iter().map(|found| found.error / found.bound)),
            rms(&mut of.iter().map(|found| found.error / found.sigma)),
            // 0.6745 converts the median of a normal distribution to its standard deviation.
            median(&mut of.iter().map(|found| found.error / found.bound)) / 0.6745,
            median(&mut of.iter().map(|found| found.error / found.unobstructed)) / 0.6745,
            median(&mut of.iter().map(|found| found.sigma / found.bound)),
            holds(&of),
            holds(&identified),
            identified.len()
        );
    }
}

fn line(trial: &Trial) -> String {
    let of = |found: &ParameterError| {
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
        trial.log_ratio,
        trial.duration_s,
        all.join(", ")
    )
}

//! Error densities against the paper's formulas and against samples.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

use crate::interpret::UniformSum;

/// Quantisation step, degrees.
const STEP: f64 = 0.9;

/// Kolmogorov-Smirnov bound at a significance of 0.001, times the root of the sample size.
const KS_BOUND: f64 = 1.95;

const SAMPLES: usize = 20_000;

#[test]
fn extent_error_is_equation_19() {
    let error = UniformSum::for_extent([STEP; 2], 0.0);
    for i in -12..=12 {
        let x = f64::from(i) * 0.1;
        let paper = if x.abs() < STEP { 1.0 / STEP - x.abs() / STEP.powi(2) } else { 0.0 };
        assert!((error.density(x) - paper).abs() < 1e-12, "{x}");
    }
    assert_eq!(error.reach(3.0), STEP);
}

#[test]
fn beta_error_is_equation_23() {
    let error = UniformSum::for_beta([[STEP; 2]; 2], [0.0; 2], 0.0);
    let d4 = STEP.powi(4);
    for i in -11..=11 {
        let x = f64::from(i) * 0.1;
        let paper = match x.abs() {
            far if far > STEP => 0.0,
            far if far > STEP / 2.0 => 8.0 / (3.0 * d4) * (STEP - far).powi(3),
            near => {
                let cubic = 6.0 * near.powi(3) - 6.0 * near.powi(2) * STEP + STEP.powi(3);
                4.0 / (3.0 * d4) * cubic
            }
        };
        assert!((error.density(x) - paper).abs() < 1e-12, "{x}");
    }
}

#[test]
fn densities_integrate_to_cumulative() {
    for (widths, sigma) in
        [(&[0.9, 0.9][..], 0.4), (&[0.9, 1.8, 0.45, 0.45][..], 0.1), (&[][..], 0.3)]
    {
        let error = UniformSum::new(widths, sigma);
        let (mut sum, step) = (0.0, 1e-3);
        for i in -6000..6000 {
            let middle = (f64::from(i) + 0.5) * step;
            sum += error.density(middle) * step;
            if i % 500 == 0 && !widths.is_empty() {
                assert!((error.cumulative(middle + step / 2.0) - sum).abs() < 1e-5, "{middle}");
            }
        }
        assert!((sum - 1.0).abs() < 1e-6, "{widths:?}: {sum}");
    }
}

/// Kolmogorov-Smirnov distance between samples and a distribution.
fn ks_distance(mut samples: Vec<f64>, cumulative: impl Fn(f64) -> f64) -> f64 {
    samples.sort_by(f64::total_cmp);
    let count = samples.len() as f64;
    samples
        .iter()
        .enumerate()
        .map(|(i, x)| {
            let there = cumulative(*x);
            (there - i as f64 / count).abs().max(((i + 1) as f64 / count - there).abs())
        })
        .fold(0.0, f64::max)
}

/// Middle and extent estimated from the first and last beam, on a grid of random phase, within an
/// arc with noisy borders.
fn estimate(rng: &mut Pcg64, middle: f64, extent: f64, sigma: f64) -> (f64, f64) {
    let noise = Normal::new(0.0, sigma).expect("a deviation");
    let start = middle - extent / 2.0 + noise.sample(rng);
    let end = middle + extent / 2.0 + noise.sample(rng);
    let phase = rng.random_range(0.0..STEP);
    let first = ((start - phase) / STEP).ceil() * STEP + phase;
    let last = ((end - phase) / STEP).floor() * STEP + phase;
    ((first + last) / 2.0, last - first + STEP)
}

#[test]
fn sampled_errors_follow_the_densities() {
    let mut rng = Pcg64::seed_from_u64(19);
    let bound = KS_BOUND / (SAMPLES as f64).sqrt();
    for sigma in [0.0, 0.3] {
        let (mut extent_errors, mut beta_errors) = (Vec::new(), Vec::new());
        for _ in 0..SAMPLES {
            // The paper assumes independent border errors, so the extent is random as well.
            let (extent, second) = (rng.random_range(15.0..25.0), rng.random_range(15.0..25.0));
            let (first_middle, estimated) = estimate(&mut rng, 3.0, extent, sigma);
            let (second_middle, _) = estimate(&mut rng, 3.0, second, sigma);
            extent_errors.push(estimated - extent);
            beta_errors.push(first_middle - second_middle);
        }
        let extent_error = UniformSum::for_extent([STEP; 2], sigma);
        let beta_error = UniformSum::for_beta([[STEP; 2]; 2], [sigma; 2], 0.0);
        let far = ks_distance(extent_errors, |x| extent_error.cumulative(x));
        assert!(far < bound, "extent, sigma {sigma}: {far} against {bound}");
        let far = ks_distance(beta_errors, |x| beta_error.cumulative(x));
        assert!(far < bound, "beta, sigma {sigma}: {far} against {bound}");
    }
}

#[test]
fn wrong_density_is_detected() {
    let mut rng = Pcg64::seed_from_u64(23);
    let samples: Vec<f64> = (0..SAMPLES)
        .map(|_| {
            let extent = rng.random_range(15.0..25.0);
            estimate(&mut rng, 3.0, extent, 0.0).1 - extent
        })
        .collect();
    let wider = UniformSum::for_extent([STEP * 1.05; 2], 0.0);
    let bound = KS_BOUND / (SAMPLES as f64).sqrt();
    assert!(ks_distance(samples, |x| wider.cumulative(x)) > bound);
}

//! Overlap of the readings that two predicted outcomes lead to.

use crate::{judge::outcome_nats, readings::Outcome};

/// Difference of ranges beyond which the overlap is constant, and its step, standard deviations.
const MAX_OFF: f64 = 24.0;
const OFF_STEP: f64 = 0.25;
/// Step of the integral over ranges, standard deviations.
const STEP: f64 = 0.125;

/// Bhattacharyya distances between the distributions of readings under predicted outcomes, by the
/// likelihood of the score.
#[derive(Debug, Clone)]
pub(super) struct ReadingOverlap {
    sigma_m: f64,
    max_range_m: f64,
    /// Distances of echoes by the difference of their ranges, in steps of [`OFF_STEP`], nats.
    of_echoes: Vec<f64>,
    /// Distance of an echo from no echo, nats, and from a target below the minimum range, which is
    /// as far.
    echo_from_none: f64,
    /// Distance of no echo from a target below the minimum range, nats.
    none_from_near: f64,
}

impl ReadingOverlap {
    /// Distances for a standard deviation of ranges and a maximum range, metres.
    pub(super) fn new(sigma_m: f64, max_range_m: f64) -> Self {
        let (of_echoes, echo_from_none, none_from_near) = (Vec::new(), 0.0, 0.0);
        let mut overlap = Self { sigma_m, max_range_m, of_echoes, echo_from_none, none_from_near };
        let count = (MAX_OFF / OFF_STEP) as usize;
        let echo = |at: usize| Outcome::Echo(OFF_STEP * at as f64 * sigma_m);
        let of_echoes = (0..=count).map(|at| overlap.integrated_nats(echo(0), echo(at)));
        overlap.of_echoes = of_echoes.collect();
        overlap.echo_from_none = overlap.integrated_nats(echo(0), Outcome::NoEcho);
        overlap.none_from_near = overlap.integrated_nats(Outcome::NoEcho, Outcome::BelowMinRange);
        overlap
    }

    /// Distance of the readings that two predicted outcomes lead to, nats; 0 for equal outcomes.
    pub(super) fn distance_nats(&self, a: Outcome, b: Outcome) -> f64 {
        match (a, b) {
            (Outcome::Echo(a_m), Outcome::Echo(b_m)) => {
                let at = (a_m - b_m).abs() / (self.sigma_m * OFF_STEP);
                let from = (at as usize).min(self.of_echoes.len() - 1);
                let to = (from + 1).min(self.of_echoes.len() - 1);
                let [low, high] = [from, to].map(|of| self.of_echoes[of]);
                low + (at - from as f64).min(1.0) * (high - low)
            }
            (Outcome::Echo(_), _) | (_, Outcome::Echo(_)) => self.echo_from_none,
            (a, b) if a == b => 0.0,
            _ => self.none_from_near,
        }
    }

    /// Distance by numerical integration.
    fn integrated_nats(&self, a: Outcome, b: Outcome) -> f64 {
        let [own, of_b] = [a, b].map(|of| self.common(of, of));
        -(self.common(a, b) / (own * of_b).sqrt()).ln()
    }

    /// Integral of the geometric mean of two likelihoods over all readings. Ranges of both
    /// outcomes are relative to the first one's, far from the limits of ranges.
    fn common(&self, a: Outcome, b: Outcome) -> f64 {
        let mean = |of: Outcome| {
            let [a, b] =
                [a, b].map(|expected| outcome_nats([of, expected], self.sigma_m, self.max_range_m));
            (0.5 * (a + b)).exp()
        };
        let range_m = |of: Outcome| match of {
            Outcome::Echo(range_m) => range_m,
            _ => 0.0,
        };
        let step_m = STEP * self.sigma_m;
        let around_m = MAX_OFF * self.sigma_m;
        let span_m = 2.0 * around_m + range_m(a).max(range_m(b));
        let steps = (span_m / step_m).ceil() as usize;
        let at_m = |at: usize| (at as f64 + 0.5) * step_m - around_m;
        let near: f64 = (0..steps).map(|at| mean(Outcome::Echo(at_m(at)))).sum::<f64>() * step_m;
        // Elsewhere both are outliers.
        let rest_m = (self.max_range_m - span_m).max(0.0);
        let far = rest_m * mean(Outcome::Echo(f64::MAX));
        near + far + mean(Outcome::NoEcho) + mean(Outcome::BelowMinRange)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_grows_with_the_difference_of_ranges() {
        let overlap = ReadingOverlap::new(0.004, 4.0);
        let off_nats =
            |off_m: f64| overlap.distance_nats(Outcome::Echo(1.0), Outcome::Echo(1.0 + off_m));
        assert_eq!(off_nats(0.0), 0.0);
        let nats: Vec<f64> = (0..60).map(|mm| off_nats(1e-3 * f64::from(mm))).collect();
        assert!(nats.windows(2).all(|pair| pair[0] < pair[1]), "{nats:?}");
        assert!((off_nats(0.2) - off_nats(3.0)).abs() < 1e-12);
        assert_eq!(off_nats(0.3), off_nats(-0.3));
        let [echo, none, near] = [Outcome::Echo(1.0), Outcome::NoEcho, Outcome::BelowMinRange];
        assert_eq!(overlap.distance_nats(none, none), 0.0);
        assert_eq!(overlap.distance_nats(echo, none), overlap.distance_nats(near, echo));
        assert!(overlap.distance_nats(echo, none) > 1.0);
        assert!(overlap.distance_nats(near, none) > 0.5);
    }

    /// Small differences have a fourth of the Kullback-Leibler divergence, as any smooth density:
    /// an eighth of the Fisher information times the difference squared.
    #[test]
    fn small_differences_have_an_eighth_of_the_information() {
        let (sigma_m, max_range_m) = (0.004, 4.0);
        let overlap = ReadingOverlap::new(sigma_m, max_range_m);
        let off_m = 0.25 * sigma_m;
        let density = |at_m: f64, expected_m: f64| {
            let outcomes = [Outcome::Echo(at_m), Outcome::Echo(expected_m)];
            outcome_nats(outcomes, sigma_m, max_range_m).exp()
        };
        let step_m = 1e-5;
        let (mut divergence, mut mass) = (0.0, 0.1);
        for at in -200_000..200_000 {
            let at_m = (f64::from(at) + 0.5) * step_m;
            let [own, other] = [density(at_m, 0.0), density(at_m, off_m)];
            divergence += own * (own / other).ln() * step_m;
            mass += own * step_m;
        }
        let expected = 0.25 * divergence / mass;
        let found = overlap.distance_nats(Outcome::Echo(0.0), Outcome::Echo(off_m));
        assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
    }
}

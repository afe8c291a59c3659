//! Time walk, and at which thresholds a reading is told that varies with them.

use sonard_model::acoustics::Receiver;

use crate::likelihood::{normal_density, normal_up_to};

/// Margins that are tabulated, decibels: beyond the last a pulse rises where it begins.
const MOST_DB: f64 = 60.0;
/// Steps of the table, in the root of the margin: at its top a pulse is flat, and its rise takes any time.
const STEPS: usize = 256;
/// So unlikely are thresholds that nothing is asked about them.
const LEAST_PROBABILITY: f64 = 1e-200;

/// Ranges that are missed by more than this, in wavelengths, are not known so well that what moves them by tenths of a
/// millimetre could be believed, or phases far off.
pub(crate) const WELL_KNOWN: f64 = 0.35;

/// By how much later an echo is told that reaches less far above the threshold (time walk of a lone echo).
#[derive(Debug, Clone)]
pub(crate) struct TimeWalk {
    late_m: Vec<f64>,
    wavelength_m: f64,
}

impl TimeWalk {
    /// Of a receiver that hears a wavelength, in ranges that are told `stretch` times as long.
    pub(crate) fn of(receiver: &Receiver, wavelength_m: f64, stretch: f64) -> Self {
        let root = |step: usize| step as f64 * MOST_DB.sqrt() / STEPS as f64;
        let late_m = |step: usize| stretch * receiver.time_walk_m(root(step).powi(2));
        Self { late_m: (0..=STEPS).map(late_m).collect(), wavelength_m }
    }

    /// Whether ranges with a standard deviation, metres, say how strong echoes are.
    pub(crate) fn is_believed(&self, sigma_m: f64) -> bool {
        sigma_m < WELL_KNOWN * self.wavelength_m
    }

    /// At a margin above the threshold, decibels: metres, and what it gains with each decibel more.
    pub(crate) fn at(&self, margin_db: f64) -> [f64; 2] {
        let per_root = STEPS as f64 / MOST_DB.sqrt();
        let root = margin_db.clamp(0.0, MOST_DB).sqrt();
        let place = root * per_root;
        let below = (place as usize).min(STEPS - 1);
        let [low_m, high_m] = [self.late_m[below], self.late_m[below + 1]];
        let late_m = low_m + (place - below as f64) * (high_m - low_m);
        // Of the root, whose own rate has no limit at 0.
        let slope = (high_m - low_m) * per_root / (2.0 * root.max(0.5 / per_root));
        [late_m, if margin_db < MOST_DB { slope } else { 0.0 }]
    }

    /// The same of margins with a mean and a variance, none of which is below 0: as of a gamma distribution, by Gauss'
    /// quadrature at two places. The weaker the echo, the more does a little less margin make it late.
    pub(crate) fn among(&self, mean_db: f64, variance: f64) -> Late {
        if mean_db <= 0.0 || variance < 1e-6 * mean_db * mean_db {
            let [mean_m, per_db] = self.at(mean_db);
            return Late { mean_m, sigma_m: per_db.abs() * variance.sqrt(), per_db };
        }
        let scale_db = variance / mean_db;
        let root = (mean_db / scale_db + 1.0).sqrt();
        let places = [(-1.0, 0.5 + 0.5 / root), (1.0, 0.5 - 0.5 / root)];
        let [(one, of_one), (other, of_other)] =
            places.map(|(sign, weight)| (self.at(scale_db * root * (root + sign)), weight));
        Late {
            mean_m: of_one * one[0] + of_other * other[0],
            sigma_m: (of_one * of_other).sqrt() * (one[0] - other[0]).abs(),
            per_db: of_one * one[1] + of_other * other[1],
        }
    }
}

/// How late echoes are whose margins vary.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Late {
    /// Mean and standard deviation, metres.
    pub(crate) mean_m: f64,
    pub(crate) sigma_m: f64,
    /// What the mean gains with each decibel that all margins grow by.
    pub(crate) per_db: f64,
}

/// Mean and variance of a standard normal deviate between two limits.
pub(crate) fn between(from: f64, to: f64) -> (f64, f64) {
    // Where all of it is within, to less than 1e-8.
    const AMPLE: f64 = 6.0;
    if from < -AMPLE && to > AMPLE {
        return (0.0, 1.0);
    }
    // What is overtaken by what comes before it has no room left.
    let from = from.min(to);
    if from > 0.0 {
        // On the other side probabilities are not the difference of two that are nearly 1.
        let (mean, variance) = between(-to, -from);
        return (-mean, variance);
    }
    let probability = normal_up_to(to) - normal_up_to(from);
    if probability < LEAST_PROBABILITY {
        return (to.min(0.0), 0.0);
    }
    let [at_from, at_to] = [from, to].map(|at| normal_density(at) / probability);
    let weighted = |at: f64, density: f64| if density > 0.0 { at * density } else { 0.0 };
    let mean = at_from - at_to;
    let variance = 1.0 + weighted(from, at_from) - weighted(to, at_to) - mean * mean;
    (mean.clamp(from, to), variance.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against sums over the density.
    #[test]
    fn moments_between_limits() {
        for (from, to) in
            [(-9.0, 9.0), (-9.0, 0.3), (-9.0, -2.0), (-0.4, 0.1), (1.0, 9.0), (2.0, 2.5)]
        {
            let steps = 40_000;
            let step = (to - from) / f64::from(steps);
            let at = |number: i32| from + (f64::from(number) + 0.5) * step;
            let moment = |power: i32| {
                (0..steps).map(|of| normal_density(at(of)) * at(of).powi(power)).sum::<f64>()
            };
            let mean = moment(1) / moment(0);
            let variance = moment(2) / moment(0) - mean * mean;
            let (found, found_variance) = between(from, to);
            assert!((found - mean).abs() < 1e-6, "{from} to {to}: {found} for {mean}");
            assert!((found_variance - variance).abs() < 1e-6, "{from} to {to}: {found_variance}");
        }
        // Without limits, and where next to nothing is: at the limit that is nearer to all else.
        assert_eq!(between(f64::NEG_INFINITY, f64::INFINITY), (0.0, 1.0));
        let (mean, variance) = between(f64::NEG_INFINITY, -20.0);
        assert!((mean + 20.05).abs() < 0.01 && variance < 0.003, "{mean} {variance}");
        assert_eq!(between(f64::NEG_INFINITY, -60.0), (-60.0, 0.0));
    }
}

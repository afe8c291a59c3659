//! Time walk, and its expectation over varying thresholds.

use sonard_model::acoustics::Receiver;

/// Maximum tabulated margin, decibels: above it a pulse is detected at its onset.
const MAX_DB: f64 = 60.0;
/// Number of table steps, in the square root of the margin: the time walk diverges at margin 0,
/// where the top of a pulse is flat.
const STEPS: usize = 256;
/// Threshold limits beyond this many standard deviations are ignored.
const AMPLE: f64 = 5.0;
/// Time walk below this fraction of the range error is not integrated.
const NEGLIGIBLE: f64 = 0.2;
/// Positive nodes and weights of the 12-point Gauss-Legendre rule on [-1, 1].
const PLACES: [(f64, f64); 6] = [
    (0.125_233_408_511_468_9, 0.249_147_045_813_402_8),
    (0.367_831_498_998_180_2, 0.233_492_536_538_354_8),
    (0.587_317_954_286_617_5, 0.203_167_426_723_065_9),
    (0.769_902_674_194_304_7, 0.160_078_328_543_346_2),
    (0.904_117_256_370_474_9, 0.106_939_325_995_318_4),
    (0.981_560_634_246_719_3, 0.047_175_336_386_511_8),
];

/// Range error in wavelengths above which time walk of tenths of a millimetre, or remote phase
/// matches, are not trusted.
pub(crate) const WELL_KNOWN: f64 = 0.35;

/// Time walk of an isolated echo as a function of its margin above the detection limit.
#[derive(Debug, Clone)]
pub(crate) struct TimeWalk {
    late_m: Vec<f64>,
    wavelength_m: f64,
}

impl TimeWalk {
    /// Tabulates a receiver's time walk at a wavelength, for ranges scaled by `stretch`.
    pub(crate) fn new(receiver: &Receiver, wavelength_m: f64, stretch: f64) -> Self {
        let root = |step: usize| step as f64 * MAX_DB.sqrt() / STEPS as f64;
        let lost_db = receiver.min_margin_db();
        let late_m = |step: usize| stretch * receiver.time_walk_m(lost_db + root(step).powi(2));
        Self { late_m: (0..=STEPS).map(late_m).collect(), wavelength_m }
    }

    /// Returns `true` if ranges with a standard deviation, metres, carry information on levels.
    pub(crate) fn is_believed(&self, sigma_m: f64) -> bool {
        sigma_m < WELL_KNOWN * self.wavelength_m
    }

    /// Time walk `margin_db` above the detection limit: range error in metres, and derivative in
    /// m/dB.
    pub(crate) fn at(&self, margin_db: f64) -> [f64; 2] {
        let per_root = STEPS as f64 / MAX_DB.sqrt();
        let root = margin_db.clamp(0.0, MAX_DB).sqrt();
        let place = root * per_root;
        let below = (place as usize).min(STEPS - 1);
        let [low_m, high_m] = [self.late_m[below], self.late_m[below + 1]];
        let late_m = low_m + (place - below as f64) * (high_m - low_m);
        // Chain rule for the square root, whose derivative diverges at 0.
        let slope = (high_m - low_m) * per_root / (2.0 * root.max(0.5 / per_root));
        [late_m, if margin_db < MAX_DB { slope } else { 0.0 }]
    }

    /// Expected time walk of an echo reported between two threshold limits, the upper one being its
    /// detection limit `until_db` above the nominal threshold, for a standard deviation of the
    /// threshold. Effects much smaller than `sigma_m` are approximated.
    pub(crate) fn expected(
        &self,
        [from_db, until_db]: [f64; 2],
        sigma_db: f64,
        sigma_m: f64,
    ) -> ExpectedWalk {
        if until_db > AMPLE * sigma_db && from_db < -AMPLE * sigma_db {
            let [mean_m, by_until_m] = self.at(until_db);
            return ExpectedWalk { mean_m, sigma_m: (by_until_m * sigma_db).abs(), by_until_m };
        }
        let [strongest_db, weakest_db] = likely_limits([from_db, until_db].map(|db| db / sigma_db))
            .map(|threshold| until_db - sigma_db * threshold)
            .map(|margin_db| margin_db.max(0.0));
        let [[latest_m, _], [earliest_m, _]] = [weakest_db, strongest_db].map(|db| self.at(db));
        if latest_m - earliest_m < NEGLIGIBLE * sigma_m {
            let [mean_m, by_until_m] = self.at(0.5 * (weakest_db + strongest_db));
            return ExpectedWalk { mean_m, sigma_m: 0.0, by_until_m };
        }
        self.summed(until_db, sigma_db, [weakest_db, strongest_db])
    }

    /// Gauss-Legendre integral over the square root of the margin, in which time walk is smooth.
    fn summed(&self, until_db: f64, sigma_db: f64, margins_db: [f64; 2]) -> ExpectedWalk {
        let [low, high] = margins_db.map(f64::sqrt);
        let [max, min] = margins_db.map(|margin_db| (until_db - margin_db) / sigma_db);
        let densest = 0.0_f64.max(min).min(max);
        let mut sums = [0.0; 5];
        for (place, weight) in PLACES {
            for sign in [-1.0, 1.0] {
                let root = 0.5 * (low + high + sign * place * (high - low));
                let margin_db = root * root;
                let [late_m, _] = self.at(margin_db);
                let deviate = (until_db - margin_db) / sigma_db;
                // Relative to the maximum density, which cancels in the ratios.
                let density = (0.5 * (densest * densest - deviate * deviate)).exp();
                let weight = weight * root * density;
                let of = [1.0, late_m, late_m * late_m, margin_db, late_m * margin_db];
                sums.iter_mut().zip(of).for_each(|(sum, of)| *sum += weight * of);
            }
        }
        let [all, ..] = sums;
        let [_, mean_m, square, margin_db, product] = sums.map(|sum| sum / all);
        ExpectedWalk {
            mean_m,
            sigma_m: (square - mean_m * mean_m).max(0.0).sqrt(),
            // The derivative of the mean of a truncated normal distribution: a covariance.
            by_until_m: (product - mean_m * margin_db) / (sigma_db * sigma_db),
        }
    }
}

/// Expected time walk.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ExpectedWalk {
    /// Mean, metres.
    pub(crate) mean_m: f64,
    /// Standard deviation, metres.
    pub(crate) sigma_m: f64,
    /// Derivative of the mean by the detection limit, m/dB.
    pub(crate) by_until_m: f64,
}

/// Part of an interval that contains all but 1e-4 of a standard normal deviate within it.
fn likely_limits([from, until]: [f64; 2]) -> [f64; 2] {
    /// Twice the log-ratio of the maximum density to that at the ends of the part.
    const FAINT: f64 = 19.0;
    /// Deviate at which the density is lower by that ratio than at a limit.
    fn beyond(limit: f64) -> f64 {
        (limit * limit + FAINT).sqrt()
    }
    let low = -beyond((-until).max(0.0));
    let high = beyond(from.max(0.0));
    let high = high.min(until);
    // An empty interval collapses to its upper limit.
    [low.max(from).min(high), high]
}

#[cfg(test)]
mod tests {
    use sonard_model::acoustics::Sensor;

    use super::*;

    /// Holds for limits far from the nominal threshold: the result is close to the likeliest ones.
    #[test]
    fn unlikely_limits_have_an_expectation() {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let walk = TimeWalk::new(&Receiver::new(&sensor, 343.0), 7e-3, 1.0);
        let mut last_m = f64::INFINITY;
        for until_db in [-40.0, -5.0, -1.0, -0.3, 0.0, 0.1, 0.4, 2.0, 30.0] {
            let late = walk.expected([f64::NEG_INFINITY, until_db], 0.1, 1e-6);
            assert!(late.mean_m < last_m && late.sigma_m > 0.0, "{until_db}: {late:?}");
            assert!(late.by_until_m < 0.0 && late.by_until_m > -0.1, "{until_db}: {late:?}");
            last_m = late.mean_m;
        }
        // An empty interval is evaluated at its upper limit.
        let late = walk.expected([1.0, 0.5], 0.1, 1e-6);
        assert!((late.mean_m - walk.at(0.0)[0]).abs() < 1e-9, "{late:?}");
    }

    #[test]
    fn likely_limits_hold_nearly_all() {
        let up_to = crate::likelihood::normal_up_to;
        for (from, until) in
            [(-9.0, 9.0), (-9.0, 0.3), (-9.0, -2.0), (-9.0, -6.0), (-0.4, 0.1), (-9.0, -0.01)]
        {
            let [low, high] = likely_limits([from, until]);
            let [all, likely] = [[from, until], [low, high]].map(|[a, b]| up_to(b) - up_to(a));
            assert!(from <= low && high <= until, "{from} {until}: {low} {high}");
            assert!((likely / all - 1.0).abs() < 1e-4, "{from} {until}: {low} {high}");
            // And mirrored.
            let [other_low, other_high] = likely_limits([-until, -from]);
            assert!((other_low + high).abs() < 1e-12 && (other_high + low).abs() < 1e-12);
        }
        assert_eq!(likely_limits([1.0, 0.5]), [0.5, 0.5]);
    }
}

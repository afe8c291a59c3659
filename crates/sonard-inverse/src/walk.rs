//! Time walk, and at which thresholds a reading is told that varies with them.

use sonard_model::acoustics::Receiver;

/// Margins that are tabulated, decibels: beyond the last a pulse rises where it begins.
const MOST_DB: f64 = 60.0;
/// Steps of the table, in the root of the margin: at its top a pulse is flat, and its rise takes any time.
const STEPS: usize = 256;
/// Standard deviations of the threshold beyond which nothing is asked about limits.
const AMPLE: f64 = 5.0;
/// Of the standard deviation of ranges: so little time walk is not looked at closely.
const NEGLIGIBLE: f64 = 0.2;
/// Places on one side of the middle of an interval from -1 to 1, and weights, of Gauss' and Legendre's rule of twelve.
const PLACES: [(f64, f64); 6] = [
    (0.125_233_408_511_468_9, 0.249_147_045_813_402_8),
    (0.367_831_498_998_180_2, 0.233_492_536_538_354_8),
    (0.587_317_954_286_617_5, 0.203_167_426_723_065_9),
    (0.769_902_674_194_304_7, 0.160_078_328_543_346_2),
    (0.904_117_256_370_474_9, 0.106_939_325_995_318_4),
    (0.981_560_634_246_719_3, 0.047_175_336_386_511_8),
];

/// Ranges that are missed by more than this, in wavelengths, are not known so well that what moves them by tenths of a
/// millimetre could be believed, or phases far off.
pub(crate) const WELL_KNOWN: f64 = 0.35;

/// By how much later a lone echo is told (time walk) that reaches less far above the threshold at which it is lost.
#[derive(Debug, Clone)]
pub(crate) struct TimeWalk {
    late_m: Vec<f64>,
    wavelength_m: f64,
}

impl TimeWalk {
    /// Of a receiver that hears a wavelength, in ranges that are told `stretch` times as long.
    pub(crate) fn of(receiver: &Receiver, wavelength_m: f64, stretch: f64) -> Self {
        let root = |step: usize| step as f64 * MOST_DB.sqrt() / STEPS as f64;
        let lost_db = receiver.least_margin_db();
        let late_m = |step: usize| stretch * receiver.time_walk_m(lost_db + root(step).powi(2));
        Self { late_m: (0..=STEPS).map(late_m).collect(), wavelength_m }
    }

    /// Whether ranges with a standard deviation, metres, say how strong echoes are.
    pub(crate) fn is_believed(&self, sigma_m: f64) -> bool {
        sigma_m < WELL_KNOWN * self.wavelength_m
    }

    /// That far below the threshold at which it is lost, decibels: metres, and what it gains with each decibel more.
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

    /// How late an echo is expected to be that is told by thresholds between two limits, and reaches `until_db`, the upper one,
    /// above the usual one: of those that vary by a standard deviation. What moves ranges by a small part of `sigma_m` is
    /// hardly looked at.
    pub(crate) fn expected(
        &self,
        [from_db, until_db]: [f64; 2],
        sigma_db: f64,
        sigma_m: f64,
    ) -> Late {
        if until_db > AMPLE * sigma_db && from_db < -AMPLE * sigma_db {
            let [mean_m, by_until_m] = self.at(until_db);
            return Late { mean_m, sigma_m: (by_until_m * sigma_db).abs(), by_until_m };
        }
        let [strongest_db, weakest_db] = likely_limits([from_db, until_db].map(|db| db / sigma_db))
            .map(|threshold| until_db - sigma_db * threshold)
            .map(|margin_db| margin_db.max(0.0));
        let [[latest_m, _], [earliest_m, _]] = [weakest_db, strongest_db].map(|db| self.at(db));
        if latest_m - earliest_m < NEGLIGIBLE * sigma_m {
            let [mean_m, by_until_m] = self.at(0.5 * (weakest_db + strongest_db));
            return Late { mean_m, sigma_m: 0.0, by_until_m };
        }
        self.summed(until_db, sigma_db, [weakest_db, strongest_db])
    }

    /// By sums over margins: in steps of their root, of which time walk is smooth (Gauss and Legendre).
    fn summed(&self, until_db: f64, sigma_db: f64, margins_db: [f64; 2]) -> Late {
        let [low, high] = margins_db.map(f64::sqrt);
        let [most, least] = margins_db.map(|margin_db| (until_db - margin_db) / sigma_db);
        let densest = 0.0_f64.max(least).min(most);
        let mut sums = [0.0; 5];
        for (place, weight) in PLACES {
            for sign in [-1.0, 1.0] {
                let root = 0.5 * (low + high + sign * place * (high - low));
                let margin_db = root * root;
                let [late_m, _] = self.at(margin_db);
                let deviate = (until_db - margin_db) / sigma_db;
                // Beside the densest, which no quotient of two sums depends on.
                let density = (0.5 * (densest * densest - deviate * deviate)).exp();
                let weight = weight * root * density;
                let of = [1.0, late_m, late_m * late_m, margin_db, late_m * margin_db];
                sums.iter_mut().zip(of).for_each(|(sum, of)| *sum += weight * of);
            }
        }
        let [all, ..] = sums;
        let [_, mean_m, square, margin_db, product] = sums.map(|sum| sum / all);
        Late {
            mean_m,
            sigma_m: (square - mean_m * mean_m).max(0.0).sqrt(),
            // The derivative of the mean of a truncated normal distribution: a covariance.
            by_until_m: (product - mean_m * margin_db) / (sigma_db * sigma_db),
        }
    }
}

/// How late echoes are expected to be.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Late {
    /// Mean and standard deviation, metres.
    pub(crate) mean_m: f64,
    pub(crate) sigma_m: f64,
    /// What the mean gains with each decibel that they reach higher.
    pub(crate) by_until_m: f64,
}

/// The part of what is between two limits where a standard normal deviate is likely to be: all but 1e-4 of it.
fn likely_limits([from, until]: [f64; 2]) -> [f64; 2] {
    /// Twice the logarithm of how much fainter the density is at the ends of the part than at its densest.
    const FAINT: f64 = 19.0;
    /// Where a density is as much fainter than at a limit on its own side.
    fn beyond(limit: f64) -> f64 {
        (limit * limit + FAINT).sqrt()
    }
    let low = -beyond((-until).max(0.0));
    let high = beyond(from.max(0.0));
    let high = high.min(until);
    // What is overtaken by what comes before it has no room left.
    [low.max(from).min(high), high]
}

#[cfg(test)]
mod tests {
    use sonard_model::acoustics::Sensor;

    use super::*;

    /// However far from the usual one thresholds have to be: close to where they are most likely.
    #[test]
    fn what_is_unlikely_is_expected_too() {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let walk = TimeWalk::of(&Receiver::new(&sensor, 343.0), 7e-3, 1.0);
        let mut last_m = f64::INFINITY;
        for until_db in [-40.0, -5.0, -1.0, -0.3, 0.0, 0.1, 0.4, 2.0, 30.0] {
            let late = walk.expected([f64::NEG_INFINITY, until_db], 0.1, 1e-6);
            assert!(late.mean_m < last_m && late.sigma_m > 0.0, "{until_db}: {late:?}");
            assert!(late.by_until_m < 0.0 && late.by_until_m > -0.1, "{until_db}: {late:?}");
            last_m = late.mean_m;
        }
        // Between limits that leave no room, at the upper one.
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
            // And on the other side.
            let [other_low, other_high] = likely_limits([-until, -from]);
            assert!((other_low + high).abs() < 1e-12 && (other_high + low).abs() < 1e-12);
        }
        assert_eq!(likely_limits([1.0, 0.5]), [0.5, 0.5]);
    }
}

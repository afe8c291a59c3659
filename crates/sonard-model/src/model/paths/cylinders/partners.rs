//! Candidate partners that a half-path can be connected to.

use std::{
    cell::OnceCell,
    f64::consts::{PI, TAU},
};

use super::{departures::Departures, half_path::HalfPath, strength::Strength};
use crate::model::paths::pattern::TwoWayBound;

/// Number of bins of the departure directions.
const BINS: usize = 120;

/// Number of steps of length up to the longest path.
const LENGTH_STEPS: usize = 8;

/// Strongest possible partners of a ray, by its direction of departure.
#[derive(Debug, Clone)]
pub(crate) struct Partners {
    /// Strongest half-paths of each bin that has any, unweighted.
    own: Vec<(usize, PartnersByLength)>,
    /// Bound of the pattern's power by the number of bins apart.
    pattern_power: Vec<f64>,
    /// Best partners of all bins, with the pattern's bound for directions far apart.
    far: PartnersByLength,
    /// Best partners by bin, weighted; computed for the bins that half-paths depart in.
    by_bin: Vec<OnceCell<PartnersByLength>>,
}

/// Strongest possible partners up to a length, in steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PartnersByLength {
    up_to: [Strength; LENGTH_STEPS],
    steps_per_m: f64,
}

impl PartnersByLength {
    fn none(steps_per_m: f64) -> Self {
        Self { up_to: [Strength::default(); LENGTH_STEPS], steps_per_m }
    }

    /// Returns the best of all partners that are at most this long.
    pub(crate) fn up_to(&self, length_m: f64) -> Strength {
        if length_m < 0.0 {
            Strength::default()
        } else {
            self.up_to[step(length_m, self.steps_per_m)]
        }
    }

    fn include(&mut self, other: &Self, power: f64) {
        for (best, other) in self.up_to.iter_mut().zip(&other.up_to) {
            *best = best.max(other.times(power));
        }
    }
}

fn step(length_m: f64, steps_per_m: f64) -> usize {
    ((length_m * steps_per_m) as usize).min(LENGTH_STEPS - 1)
}

impl Partners {
    /// Collects, for each bin, the maximum over all half-paths, weighted by the beam pattern's
    /// bound on departures that far apart. Without a bound each bin has the overall maximum.
    pub(crate) fn from_half_paths(
        all: &[HalfPath],
        bound: Option<&TwoWayBound>,
        max_path_m: f64,
    ) -> Self {
        let each =
            |half_path: &HalfPath| (half_path.departures, half_path.strength, half_path.min_m);
        Self::from_strengths(all.iter().map(each), bound, max_path_m)
    }

    /// Collects the maxima from departures, strengths and lengths alone.
    fn from_strengths(
        all: impl Iterator<Item = (Departures, Strength, f64)>,
        bound: Option<&TwoWayBound>,
        max_path_m: f64,
    ) -> Self {
        let steps_per_m = LENGTH_STEPS as f64 / max_path_m;
        let none = PartnersByLength::none(steps_per_m);
        let mut own = vec![none; BINS];
        for (departures, strength, length_m) in all {
            for bin in bins(&departures) {
                let best = &mut own[bin].up_to[step(length_m.max(0.0), steps_per_m)];
                *best = best.max(strength);
            }
        }
        for PartnersByLength { up_to, .. } in &mut own {
            for step in 1..LENGTH_STEPS {
                up_to[step] = up_to[step].max(up_to[step - 1]);
            }
        }
        // Most directions have none.
        let known: Vec<(usize, PartnersByLength)> = own
            .into_iter()
            .enumerate()
            .filter(|(_, own)| own.up_to[LENGTH_STEPS - 1].y > 0.0)
            .collect();
        let width_rad = TAU / BINS as f64;
        let power = |apart: usize| {
            let apart_rad = (apart as f64 - 1.0).max(0.0) * width_rad;
            bound.map_or(1.0, |bound| bound.at(apart_rad).powi(2))
        };
        let pattern_power: Vec<f64> = (0..=BINS / 2).map(power).collect();
        let mut far = none;
        known.iter().for_each(|(_, own)| far.include(own, pattern_power[BINS / 2]));
        Self { own: known, pattern_power, far, by_bin: vec![OnceCell::new(); BINS] }
    }

    fn of_bin(&self, bin: usize) -> &PartnersByLength {
        self.by_bin[bin].get_or_init(|| {
            let mut best = self.far;
            for (other, own) in &self.own {
                let apart = bin.abs_diff(*other);
                let power = self.pattern_power[apart.min(BINS - apart)];
                // Far apart the bound has the same value everywhere.
                if power > self.pattern_power[BINS / 2] {
                    best.include(own, power);
                }
            }
            best
        })
    }

    /// Returns the best partners for rays with these departures.
    pub(crate) fn best(&self, departures: &Departures) -> PartnersByLength {
        let mut best = PartnersByLength::none(self.far.steps_per_m);
        bins(departures).for_each(|bin| best.include(self.of_bin(bin), 1.0));
        best
    }
}

/// Bins that departures fall into.
fn bins(departures: &Departures) -> impl Iterator<Item = usize> {
    let bin = |angle: f64| ((angle + PI) / TAU * BINS as f64).floor() as i64;
    let from = bin(departures.middle_rad - departures.half_rad);
    let to = bin(departures.middle_rad + departures.half_rad).min(from + BINS as i64 - 1);
    (from..=to).map(|bin| bin.rem_euclid(BINS as i64) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        acoustics::{BeamPattern, Sensor},
        model::paths::pattern::PatternEnvelope,
    };

    /// The best partner of a bin bounds each half-path's contribution, wherever in their bins both
    /// leave.
    #[test]
    fn best_bounds_every_partner() {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let beam = BeamPattern::new(&sensor, 343.0);
        let bound = TwoWayBound::new(&PatternEnvelope::new(&beam), 0.0);
        let towards = |angle_rad: f64| Departures { middle_rad: angle_rad, half_rad: 0.0 };
        let strength = Strength { x: 1.0, y: 2.0 };
        for step in 0..400 {
            let (one_rad, apart_rad) = (-PI + 0.017 * f64::from(step), 0.003 * f64::from(step));
            let other_rad = crate::geometry::wrap_pi(one_rad + apart_rad);
            let partners = Partners::from_strengths(
                [(towards(one_rad), strength, 1.5)].into_iter(),
                Some(&bound),
                4.0,
            );
            let partners = partners.best(&towards(other_rad));
            let [best, most] = [partners.up_to(1.5).x, bound.at(apart_rad).powi(2)];
            assert_eq!(partners.up_to(1.0).x, 0.0);
            assert!(best >= most, "{apart_rad} apart: {best}, {most}");
        }
    }
}

//! Candidate partners that a half-path can be connected to.

use std::f64::consts::{PI, TAU};

use super::{departures::Departures, half_path::HalfPath, strength::Strength};
use crate::model::paths::pattern::TwoWayBound;

/// Number of bins of the departure directions.
const BINS: usize = 120;

/// Strongest possible partners of a ray, by its direction of departure.
#[derive(Debug, Clone)]
pub(crate) struct Partners(Vec<Strength>);

impl Partners {
    /// Collects, for each bin, the maximum over all half-paths, weighted by the beam pattern's
    /// bound on departures that far apart. Without a bound each bin has the overall maximum.
    pub(crate) fn from_half_paths(all: &[HalfPath], bound: Option<&TwoWayBound>) -> Self {
        Self::from_strengths(
            all.iter().map(|half_path| (half_path.departures, half_path.strength)),
            bound,
        )
    }

    /// Collects the maxima from departures and strengths alone.
    fn from_strengths(
        all: impl Iterator<Item = (Departures, Strength)>,
        bound: Option<&TwoWayBound>,
    ) -> Self {
        let mut own = vec![Strength::default(); BINS];
        for (departures, strength) in all {
            for bin in bins(&departures) {
                own[bin] = own[bin].max(strength);
            }
        }
        let Some(bound) = bound else {
            let max_value = own.into_iter().fold(Strength::default(), Strength::max);
            return Self(vec![max_value; BINS]);
        };
        let width_rad = TAU / BINS as f64;
        let pattern_power: Vec<f64> = (0..=BINS / 2)
            .map(|apart| bound.at((apart as f64 - 1.0).max(0.0) * width_rad).powi(2))
            .collect();
        // Most directions have none.
        let known: Vec<(usize, Strength)> =
            own.into_iter().enumerate().filter(|(_, strength)| strength.y > 0.0).collect();
        let best = |bin: usize| {
            known.iter().fold(Strength::default(), |best, &(other, strength)| {
                let apart = bin.abs_diff(other);
                let pattern_power = pattern_power[apart.min(BINS - apart)];
                best.max(Strength { x: pattern_power * strength.x, y: pattern_power * strength.y })
            })
        };
        Self((0..BINS).map(best).collect())
    }

    /// Returns the best partner for rays with these departures.
    pub(crate) fn best(&self, departures: &Departures) -> Strength {
        bins(departures).map(|bin| self.0[bin]).fold(Strength::default(), Strength::max)
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
            let partners =
                Partners::from_strengths([(towards(one_rad), strength)].into_iter(), Some(&bound));
            let [best, most] = [partners.best(&towards(other_rad)).x, bound.at(apart_rad).powi(2)];
            assert!(best >= most, "{apart_rad} apart: {best}, {most}");
        }
    }
}

//! The half-paths that others can be connected to.

use std::f64::consts::{PI, TAU};

use super::{departures::Departures, half_path::HalfPath, strength::Strength};
use crate::model::paths::pattern::TwoWayBound;

/// Departures are sorted into this many bins.
const BINS: usize = 120;

/// The strongest partners that a ray can have, by the direction in which it leaves.
#[derive(Debug, Clone)]
pub(crate) struct Partners(Vec<Strength>);

impl Partners {
    /// For each bin the most of all half-paths, weighed by the beam pattern's bound on departures so far
    /// apart; without a bound each bin has the most of all.
    pub(crate) fn of(all: &[HalfPath], bound: Option<&TwoWayBound>) -> Self {
        Self::among(all.iter().map(|half_path| (half_path.departures, half_path.strength)), bound)
    }

    /// The same of half-paths of which no more is known than how they leave and how strong they are.
    fn among(
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
            let most = own.into_iter().fold(Strength::default(), Strength::max);
            return Self(vec![most; BINS]);
        };
        let width_rad = TAU / BINS as f64;
        let heard: Vec<f64> = (0..=BINS / 2)
            .map(|apart| bound.at((apart as f64 - 1.0).max(0.0) * width_rad).powi(2))
            .collect();
        // In most directions there is none.
        let known: Vec<(usize, Strength)> =
            own.into_iter().enumerate().filter(|(_, strength)| strength.y > 0.0).collect();
        let best = |bin: usize| {
            known.iter().fold(Strength::default(), |best, &(other, strength)| {
                let apart = bin.abs_diff(other);
                let heard = heard[apart.min(BINS - apart)];
                best.max(Strength { x: heard * strength.x, y: heard * strength.y })
            })
        };
        Self((0..BINS).map(best).collect())
    }

    /// The best for rays that leave like this.
    pub(crate) fn best(&self, departures: &Departures) -> Strength {
        bins(departures).map(|bin| self.0[bin]).fold(Strength::default(), Strength::max)
    }
}

/// The bins that departures fall into.
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

    /// What is told of partners bounds what each of them could give, wherever in their bins both leave.
    #[test]
    fn no_partner_is_better_than_the_best() {
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let beam = BeamPattern::new(&sensor, 343.0);
        let bound = TwoWayBound::of(&PatternEnvelope::of(&beam), 0.0);
        let towards = |angle_rad: f64| Departures { middle_rad: angle_rad, half_rad: 0.0 };
        let strength = Strength { x: 1.0, y: 2.0 };
        for step in 0..400 {
            let (one_rad, apart_rad) = (-PI + 0.017 * f64::from(step), 0.003 * f64::from(step));
            let other_rad = crate::geometry::wrap_pi(one_rad + apart_rad);
            let partners =
                Partners::among([(towards(one_rad), strength)].into_iter(), Some(&bound));
            let [best, most] = [partners.best(&towards(other_rad)).x, bound.at(apart_rad).powi(2)];
            assert!(best >= most, "{apart_rad} apart: {best}, {most}");
        }
    }
}

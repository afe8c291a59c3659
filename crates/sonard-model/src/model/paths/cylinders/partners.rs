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
    pub(crate) fn of<'a>(
        all: impl Iterator<Item = &'a HalfPath>,
        bound: Option<&TwoWayBound>,
    ) -> Self {
        let mut own = vec![Strength::default(); BINS];
        for half_path in all {
            for bin in bins(&half_path.departures) {
                own[bin] = own[bin].max(half_path.strength);
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

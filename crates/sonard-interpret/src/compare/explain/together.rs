//! Pose, heading and speed of sound at once: what a tape measure and a thermometer get wrong together, and what none of
//! them explains alone.

use glam::DVec3;

use super::{
    fit::{Fit, Moved, fit},
    found::{Estimate, Explanation, Pair, Quantity},
    likelihood::is_near,
    shift::{Turns, of_lapse, of_pair, parabola},
};
use crate::compare::Judged;

/// Beams that are kept.
const MOST_BEAMS: usize = 20_000;

/// Scans whose beams are evenly apart, each as readings and predictions.
#[derive(Debug, Default)]
pub(super) struct Together {
    /// To how many beams on both sides they can be turned.
    most: usize,
    scans: Vec<Turnable>,
    beams: usize,
}

#[derive(Debug)]
struct Turnable {
    /// Readings that are asked at every turn.
    asked: std::ops::Range<usize>,
    /// Measured ranges, metres.
    measured_m: Vec<Option<f64>>,
    /// Predicted ranges, metres, and what they gain where the transducer moves.
    predicted: Vec<Option<(f64, [f64; 2])>>,
}

impl Turnable {
    /// Readings beside the predictions of beams so many to the left.
    fn turned(&self, beams: isize) -> impl Iterator<Item = (Option<f64>, Option<(f64, [f64; 2])>)> {
        let count = self.predicted.len() as isize;
        self.asked.clone().map(move |at| {
            let beside = (at as isize + beams).rem_euclid(count) as usize;
            (self.measured_m[at], self.predicted[beside])
        })
    }
}

impl Together {
    /// Whether so many beams more are kept.
    pub(super) const fn has_room(&self, beams: usize) -> bool {
        self.beams + beams <= MOST_BEAMS
    }

    pub(super) fn add(&mut self, turns: &Turns, beams: &[Judged<'_>], pairs: Vec<Option<Pair>>) {
        self.most = turns.most;
        self.beams += beams.len();
        let predicted = beams.iter().zip(pairs).map(|(beam, pair)| {
            let range_m = beam.ping.sim.as_ref()?.range_m?;
            Some((range_m, pair?.by_place.to_array()))
        });
        self.scans.push(Turnable {
            asked: turns.asked.clone(),
            measured_m: beams.iter().map(|beam| beam.ping.range_m).collect(),
            predicted: predicted.collect(),
        });
    }

    fn moved(&self, beams: isize) -> impl Iterator<Item = Moved> {
        let pairs = self.scans.iter().flat_map(move |scan| scan.turned(beams));
        pairs.filter_map(|(measured, predicted)| {
            let (measured_m, (predicted_m, [x, y])) = measured.zip(predicted)?;
            Some((measured_m - predicted_m, DVec3::new(x, y, -measured_m)))
        })
    }

    /// Log-likelihood of all readings after a turn, and how many are explained.
    fn likelihood(&self, beams: isize, left_m: impl Fn(Moved) -> f64) -> (f64, u32) {
        let lapses = self
            .scans
            .iter()
            .flat_map(|scan| scan.turned(beams))
            .filter(|(measured, predicted)| measured.is_some() != predicted.is_some())
            .count();
        let mut sum = (lapses as f64 * of_lapse(), 0);
        for moved in self.moved(beams) {
            let left_m = left_m(moved);
            sum.0 += of_pair(left_m);
            sum.1 += u32::from(is_near(left_m));
        }
        sum
    }

    /// The turn, place and speed of sound that explain most, if they are within what the first order holds for.
    pub(super) fn explanation(&self, step_deg: f64) -> Option<Explanation> {
        let most = self.most as isize;
        let at = |beams: isize| -> (f64, u32, Option<Fit>) {
            match fit(self.moved(beams)) {
                Some(fit) => {
                    let (sum, explained) = self.likelihood(beams, |moved| fit.left_m(moved));
                    (sum, explained, Some(fit))
                }
                None => (f64::NEG_INFINITY, 0, None),
            }
        };
        let found: Vec<_> = (-most..=most).map(at).collect();
        let best = (1..found.len().checked_sub(1)?)
            .max_by(|&one, &other| found[one].0.total_cmp(&found[other].0))?;
        let (sum, explained, Some(fit)) = found[best] else { return None };
        let [before, after] = [best - 1, best + 1].map(|at| found[at].0);
        let (peak, sigma) = match before.is_finite() && after.is_finite() {
            true => parabola([before, sum, after]),
            false => (0.0, 0.5),
        };
        let (now, explained_now) = self.likelihood(0, |(residual_m, _)| residual_m);
        let heading = Estimate {
            name: Quantity::HeadingDeg,
            value: (best as f64 - most as f64 + peak) * step_deg,
            sigma: sigma * step_deg,
        };
        let values = [(Quantity::XM, 0), (Quantity::YM, 1), (Quantity::Percent, 2)];
        let mut estimates: Vec<_> =
            values.into_iter().map(|(name, at)| fit.estimate(name, at)).collect();
        estimates.insert(2, heading);
        Some(Explanation {
            change: "together".to_owned(),
            estimates,
            gain: sum - now,
            explains: explained.saturating_sub(explained_now),
        })
    }
}

//! Combined fit of pose, heading and speed of sound: typical errors of a tape measure and a
//! thermometer, which no single change explains.

use glam::DVec3;

use super::{
    explanation::{ChangeEstimate, ChangedQuantity, Explanation, LinearizedPair},
    fit::{LinearFit, Linearized, fit},
    likelihood::is_near,
    shift::{BeamShifts, echo_log_likelihood, mismatch_log_likelihood, parabola},
};
use crate::compare::ClassifiedPing;

/// Maximum number of beams kept.
const MAX_BEAMS: usize = 20_000;

/// Scans with evenly spaced beams, as readings and predictions.
#[derive(Debug, Default)]
pub(super) struct CombinedFit {
    /// Maximum shift to either side, beams.
    max_shift: usize,
    scans: Vec<ShiftableScan>,
    beams: usize,
}

#[derive(Debug)]
struct ShiftableScan {
    /// Readings compared at every shift.
    compared: std::ops::Range<usize>,
    /// Measured ranges, metres.
    measured_m: Vec<Option<f64>>,
    /// Predicted ranges, metres, and their gradients with respect to the transducer position.
    predicted: Vec<Option<(f64, [f64; 2])>>,
}

impl ShiftableScan {
    /// Readings paired with the predictions of the beams `shift` to the left.
    fn shifted(
        &self,
        shift: isize,
    ) -> impl Iterator<Item = (Option<f64>, Option<(f64, [f64; 2])>)> {
        let count = self.predicted.len() as isize;
        self.compared.clone().map(move |at| {
            let neighbour = (at as isize + shift).rem_euclid(count) as usize;
            (self.measured_m[at], self.predicted[neighbour])
        })
    }
}

impl CombinedFit {
    /// Returns `true` if so many more beams may be kept.
    pub(super) const fn has_room(&self, beams: usize) -> bool {
        self.beams + beams <= MAX_BEAMS
    }

    pub(super) fn add(
        &mut self,
        shifts: &BeamShifts,
        beams: &[ClassifiedPing<'_>],
        pairs: Vec<Option<LinearizedPair>>,
    ) {
        self.max_shift = shifts.max_shift;
        self.beams += beams.len();
        let predicted = beams.iter().zip(pairs).map(|(beam, pair)| {
            let range_m = beam.ping.sim.as_ref()?.range_m?;
            Some((range_m, pair?.d_position.to_array()))
        });
        self.scans.push(ShiftableScan {
            compared: shifts.compared.clone(),
            measured_m: beams.iter().map(|beam| beam.ping.range_m).collect(),
            predicted: predicted.collect(),
        });
    }

    fn linearized(&self, shift: isize) -> impl Iterator<Item = Linearized> {
        let pairs = self.scans.iter().flat_map(move |scan| scan.shifted(shift));
        pairs.filter_map(|(measured, predicted)| {
            let (measured_m, (predicted_m, [x, y])) = measured.zip(predicted)?;
            Some((measured_m - predicted_m, DVec3::new(x, y, -measured_m)))
        })
    }

    /// Log-likelihood of all readings at a shift, and the number of explained ones.
    fn likelihood(&self, shift: isize, remaining_m: impl Fn(Linearized) -> f64) -> (f64, u32) {
        let mismatches = self
            .scans
            .iter()
            .flat_map(|scan| scan.shifted(shift))
            .filter(|(measured, predicted)| measured.is_some() != predicted.is_some())
            .count();
        let mut sum = (mismatches as f64 * mismatch_log_likelihood(), 0);
        for pair in self.linearized(shift) {
            let remaining_m = remaining_m(pair);
            sum.0 += echo_log_likelihood(remaining_m);
            sum.1 += u32::from(is_near(remaining_m));
        }
        sum
    }

    /// Most likely heading, position and speed of sound, if within the first-order limits.
    pub(super) fn explanation(&self, step_deg: f64) -> Option<Explanation> {
        let max_shift = self.max_shift as isize;
        let at = |shift: isize| -> (f64, u32, Option<LinearFit>) {
            match fit(self.linearized(shift)) {
                Some(fit) => {
                    let (sum, explained) = self.likelihood(shift, |pair| fit.remaining_m(pair));
                    (sum, explained, Some(fit))
                }
                None => (f64::NEG_INFINITY, 0, None),
            }
        };
        let found: Vec<_> = (-max_shift..=max_shift).map(at).collect();
        let best =
            (1..found.len().checked_sub(1)?).max_by(|&a, &b| found[a].0.total_cmp(&found[b].0))?;
        let (sum, explained, Some(fit)) = found[best] else { return None };
        let [before, after] = [best - 1, best + 1].map(|at| found[at].0);
        let (peak, sigma) = match before.is_finite() && after.is_finite() {
            true => parabola([before, sum, after]),
            false => (0.0, 0.5),
        };
        let (current, current_explained) = self.likelihood(0, |(residual_m, _)| residual_m);
        let heading = ChangeEstimate {
            name: ChangedQuantity::HeadingDeg,
            value: (best as f64 - max_shift as f64 + peak) * step_deg,
            sigma: sigma * step_deg,
        };
        let values =
            [(ChangedQuantity::XM, 0), (ChangedQuantity::YM, 1), (ChangedQuantity::Percent, 2)];
        let mut estimates: Vec<_> =
            values.into_iter().map(|(name, at)| fit.estimate(name, at)).collect();
        estimates.insert(2, heading);
        Some(Explanation {
            change: "together".to_owned(),
            estimates,
            gain: sum - current,
            explains: explained.saturating_sub(current_explained),
        })
    }
}

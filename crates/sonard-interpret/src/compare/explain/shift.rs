//! Changes that move no path but its detection: heading and threshold.

use std::ops::Range;

use sonard_records::{Ping, ScanPlan};

use super::{
    explanation::{ChangeEstimate, ChangedQuantity, Explanation},
    likelihood::{has_echo, is_near, log_likelihood},
};
use crate::compare::ClassifiedPing;

/// Maximum heading change on either side, degrees.
const MAX_HEADING_DEG: f64 = 12.0;
/// Maximum heading change on either side, beams.
const MAX_SHIFT_BEAMS: usize = 40;
/// Probability that presence or absence of an echo contradicts the prediction.
const P_MISMATCH: f64 = 0.05;

/// Log-likelihoods and explained readings over evenly spaced shifts; the middle one is zero.
#[derive(Debug, Default)]
struct ShiftLikelihoods(Vec<(f64, u32)>);

impl ShiftLikelihoods {
    /// The shifts, created on first use.
    fn iter_mut(&mut self, count: usize) -> impl Iterator<Item = (usize, &mut (f64, u32))> {
        self.0.resize(count, (0.0, 0));
        self.0.iter_mut().enumerate()
    }

    /// Explanation by the most likely shift, unless that is zero or at an end; `step` is the
    /// spacing.
    fn explanation(&self, change: &str, name: ChangedQuantity, step: f64) -> Option<Explanation> {
        let (middle, likelihood) = (self.0.len() / 2, |at: usize| self.0[at].0);
        let best = (0..self.0.len()).max_by(|&a, &b| likelihood(a).total_cmp(&likelihood(b)))?;
        if best == 0 || best + 1 >= self.0.len() || best == middle {
            return None;
        }
        let (peak, sigma) =
            parabola([likelihood(best - 1), likelihood(best), likelihood(best + 1)]);
        let value = (best as f64 - middle as f64 + peak) * step;
        Some(Explanation {
            change: change.to_owned(),
            estimates: vec![ChangeEstimate { name, value, sigma: sigma * step }],
            gain: likelihood(best) - likelihood(middle),
            explains: self.0[best].1.saturating_sub(self.0[middle].1),
        })
    }
}

/// Rotations of a scan against its predictions, by whole beams.
#[derive(Debug, Clone)]
pub(super) struct BeamShifts {
    /// Angle between neighbouring beams, degrees.
    pub(super) step_deg: f64,
    /// Maximum shift to either side, beams.
    pub(super) max_shift: usize,
    /// Readings compared at every shift: in a partial sweep, those that always have a neighbour.
    pub(super) compared: Range<usize>,
}

impl BeamShifts {
    /// Shifts for a scan; `None` unless its beams are complete, in order and evenly spaced.
    pub(super) fn for_scan(plan: &ScanPlan, beams: &[ClassifiedPing<'_>]) -> Option<Self> {
        let (count, step_deg) = (beams.len(), plan.step_deg);
        let is_whole = plan.pings_per_stop == 1 && plan.beams() as usize == count && count >= 8;
        let in_order = beams.iter().zip(0..).all(|(beam, index)| beam.ping.index == index);
        if !is_whole || !in_order {
            return None;
        }
        let max_shift =
            ((MAX_HEADING_DEG / step_deg) as usize).clamp(1, MAX_SHIFT_BEAMS).min(count / 3);
        let is_full = (plan.to_deg - plan.from_deg - 360.0).abs() < step_deg / 2.0;
        let compared = if is_full { 0..count } else { max_shift..count - max_shift };
        Some(Self { step_deg, max_shift, compared })
    }

    /// Returns `true` if both have the same shifts, so that likelihoods can be summed.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (self.step_deg - other.step_deg).abs() < 1e-9 && self.max_shift == other.max_shift
    }
}

/// Likelihood of heading changes: readings compared with the predictions of neighbouring beams,
/// from the rightmost to the leftmost shift.
#[derive(Debug, Default)]
pub(super) struct HeadingLikelihood(ShiftLikelihoods);

impl HeadingLikelihood {
    pub(super) fn add(&mut self, shifts: &BeamShifts, beams: &[ClassifiedPing<'_>]) {
        let count = beams.len();
        for (at, (sum, explained)) in self.0.iter_mut(2 * shifts.max_shift + 1) {
            for beam in shifts.compared.clone() {
                let predicted = beams[(beam + count + at - shifts.max_shift) % count].ping;
                let Some((log, is_explained)) = log_likelihood_of(beams[beam].ping, predicted)
                else {
                    continue;
                };
                *sum += log;
                *explained += u32::from(is_explained);
            }
        }
    }

    pub(super) fn explanation(&self, step_deg: f64) -> Option<Explanation> {
        self.0.explanation("heading", ChangedQuantity::HeadingDeg, step_deg)
    }
}

/// Log-likelihood of a reading given the prediction of another beam, and whether it is explained.
fn log_likelihood_of(measured: &Ping, predicted: &Ping) -> Option<(f64, bool)> {
    let is_measured = has_echo(measured.status)?;
    let sim = predicted.sim.as_ref()?;
    match (is_measured, has_echo(sim.status)?) {
        (true, true) => {
            let residual_m = measured.range_m? - sim.range_m?;
            Some((echo_log_likelihood(residual_m), is_near(residual_m)))
        }
        (false, false) => Some(((1.0 - P_MISMATCH).ln(), true)),
        _ => Some((mismatch_log_likelihood(), false)),
    }
}

/// Log-likelihood of an echo that was predicted.
pub(super) fn echo_log_likelihood(residual_m: f64) -> f64 {
    (1.0 - P_MISMATCH).ln() + log_likelihood(residual_m)
}

/// Log-likelihood of an echo that was not predicted, or of a predicted echo that is missing.
pub(super) fn mismatch_log_likelihood() -> f64 {
    P_MISMATCH.ln() + log_likelihood(f64::INFINITY)
}

/// Peak of the parabola through three equidistant values, in spacings from the middle one, and the
/// standard deviation of a Gaussian likelihood of that curvature, at least 0.1.
pub(super) fn parabola([before, at, after]: [f64; 3]) -> (f64, f64) {
    let curvature = (2.0 * at - before - after).max(f64::MIN_POSITIVE);
    ((0.5 * (after - before) / curvature).clamp(-0.5, 0.5), curvature.sqrt().recip().max(0.1))
}

/// Maximum threshold change on either side, decibels.
const MAX_THRESHOLD_DB: f64 = 24.0;
const STEP_DB: f64 = 0.5;
/// Standard deviation of a predicted margin, decibels.
const MARGIN_SIGMA_DB: f64 = 3.0;
/// Margins of larger magnitude carry no information on the threshold.
const MAX_MARGIN_DB: f64 = 40.0;

/// Likelihood of threshold changes, from predicted margins of echoes and missing echoes.
#[derive(Debug, Default)]
pub(super) struct ThresholdLikelihood {
    shifts: ShiftLikelihoods,
    /// Number of echoes and of missing echoes.
    counts: [u32; 2],
}

impl ThresholdLikelihood {
    pub(super) fn add(&mut self, ping: &Ping) {
        let margin_db = ping.sim.as_ref().and_then(|sim| sim.margin_db);
        let (Some(is_echo), Some(margin_db)) = (has_echo(ping.status), margin_db) else { return };
        if !margin_db.is_finite() || margin_db.abs() > MAX_MARGIN_DB {
            return;
        }
        self.counts[usize::from(!is_echo)] += 1;
        let count = (2.0 * MAX_THRESHOLD_DB / STEP_DB) as usize + 1;
        for (at, (sum, explained)) in self.shifts.iter_mut(count) {
            let over_db = margin_db - (STEP_DB * at as f64 - MAX_THRESHOLD_DB);
            let detection = logistic(over_db / MARGIN_SIGMA_DB);
            let probability = P_MISMATCH + (1.0 - 2.0 * P_MISMATCH) * detection;
            *sum += if is_echo { probability } else { 1.0 - probability }.ln();
            *explained += u32::from(is_echo == (over_db > 0.0));
        }
    }

    pub(super) fn explanation(&self) -> Option<Explanation> {
        // Without missing echoes the detection limit is undetermined.
        if self.counts.contains(&0) {
            return None;
        }
        self.shifts.explanation("threshold", ChangedQuantity::ThresholdDb, STEP_DB)
    }
}

/// Logistic approximation of the normal cumulative distribution function.
fn logistic(at: f64) -> f64 {
    (1.0 + (-1.702 * at).exp()).recip()
}

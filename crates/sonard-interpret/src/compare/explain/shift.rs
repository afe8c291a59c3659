//! Changes that move no path, but where it is heard: heading and threshold.

use std::ops::Range;

use sonard_records::{Ping, ScanPlan};

use super::{
    found::{Estimate, Explanation, Quantity},
    likelihood::{is_heard, is_near, log_likelihood},
};
use crate::compare::Judged;

/// Headings that are tried: to so many degrees on both sides.
const MOST_DEG: f64 = 12.0;
/// And so many beams.
const MOST_BEAMS: usize = 40;
/// Share of readings that are heard against a prediction, or silent.
const LAPSES: f64 = 0.05;

/// Log-likelihoods and explained readings for a row of shifts that are evenly apart, none in the middle.
#[derive(Debug, Default)]
struct Shifts(Vec<(f64, u32)>);

impl Shifts {
    /// The same row, or as many shifts if there is none yet.
    fn of(&mut self, count: usize) -> impl Iterator<Item = (usize, &mut (f64, u32))> {
        self.0.resize(count, (0.0, 0));
        self.0.iter_mut().enumerate()
    }

    /// The shift that explains most, if it is another than none, and none at an end. `step` is from one to the next.
    fn explanation(&self, change: &str, name: Quantity, step: f64) -> Option<Explanation> {
        let (middle, likelihood) = (self.0.len() / 2, |at: usize| self.0[at].0);
        let best = (0..self.0.len())
            .max_by(|&one, &other| likelihood(one).total_cmp(&likelihood(other)))?;
        if best == 0 || best + 1 >= self.0.len() || best == middle {
            return None;
        }
        let (peak, sigma) =
            parabola([likelihood(best - 1), likelihood(best), likelihood(best + 1)]);
        let value = (best as f64 - middle as f64 + peak) * step;
        Some(Explanation {
            change: change.to_owned(),
            estimates: vec![Estimate { name, value, sigma: sigma * step }],
            gain: likelihood(best) - likelihood(middle),
            explains: self.0[best].1.saturating_sub(self.0[middle].1),
        })
    }
}

/// How a scan can be turned against its predictions, by whole beams.
#[derive(Debug, Clone)]
pub(super) struct Turns {
    /// From beam to beam, degrees.
    pub(super) step_deg: f64,
    /// To how many beams on both sides.
    pub(super) most: usize,
    /// Readings that are asked at every turn: of a part of a turn, those that have a neighbour then.
    pub(super) asked: Range<usize>,
}

impl Turns {
    /// `None` of a scan whose beams are not all there, in order and evenly apart.
    pub(super) fn of(plan: &ScanPlan, beams: &[Judged<'_>]) -> Option<Self> {
        let (count, step_deg) = (beams.len(), plan.step_deg);
        let is_whole = plan.pings_per_stop == 1 && plan.beams() as usize == count && count >= 8;
        let in_order = beams.iter().zip(0..).all(|(beam, index)| beam.ping.index == index);
        if !is_whole || !in_order {
            return None;
        }
        let most = ((MOST_DEG / step_deg) as usize).clamp(1, MOST_BEAMS).min(count / 3);
        let is_turn = (plan.to_deg - plan.from_deg - 360.0).abs() < step_deg / 2.0;
        Some(Self { step_deg, most, asked: if is_turn { 0..count } else { most..count - most } })
    }

    /// Whether the shifts of both are the same, so that they can be added up.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        (self.step_deg - other.step_deg).abs() < 1e-9 && self.most == other.most
    }
}

/// The likelihood of other headings: readings beside the predictions of beams to the left and right, from the
/// most to the right to the most to the left.
#[derive(Debug, Default)]
pub(super) struct Headings(Shifts);

impl Headings {
    pub(super) fn add(&mut self, turns: &Turns, beams: &[Judged<'_>]) {
        let count = beams.len();
        for (at, (sum, explained)) in self.0.of(2 * turns.most + 1) {
            for beam in turns.asked.clone() {
                let predicted = beams[(beam + count + at - turns.most) % count].ping;
                let Some((log, is_explained)) = beside(beams[beam].ping, predicted) else {
                    continue;
                };
                *sum += log;
                *explained += u32::from(is_explained);
            }
        }
    }

    pub(super) fn explanation(&self, step_deg: f64) -> Option<Explanation> {
        self.0.explanation("heading", Quantity::HeadingDeg, step_deg)
    }
}

/// Log-likelihood of a reading beside the prediction of another, and whether that explains it.
fn beside(measured: &Ping, predicted: &Ping) -> Option<(f64, bool)> {
    let heard = is_heard(measured.status)?;
    let sim = predicted.sim.as_ref()?;
    match (heard, is_heard(sim.status)?) {
        (true, true) => {
            let residual_m = measured.range_m? - sim.range_m?;
            Some((of_pair(residual_m), is_near(residual_m)))
        }
        (false, false) => Some(((1.0 - LAPSES).ln(), true)),
        _ => Some((of_lapse(), false)),
    }
}

/// Log-likelihood of an echo that was predicted.
pub(super) fn of_pair(residual_m: f64) -> f64 {
    (1.0 - LAPSES).ln() + log_likelihood(residual_m)
}

/// The same of one that was not, or of a silence where an echo was predicted.
pub(super) fn of_lapse() -> f64 {
    LAPSES.ln() + log_likelihood(f64::INFINITY)
}

/// Where a parabola through three values, one apart, has its peak, from the middle one; and the standard deviation of
/// a Gaussian likelihood of that curvature, at least a tenth.
pub(super) fn parabola([before, at, after]: [f64; 3]) -> (f64, f64) {
    let curvature = (2.0 * at - before - after).max(f64::MIN_POSITIVE);
    ((0.5 * (after - before) / curvature).clamp(-0.5, 0.5), curvature.sqrt().recip().max(0.1))
}

/// Thresholds that are tried: to so many decibels on both sides.
const MOST_DB: f64 = 24.0;
const STEP_DB: f64 = 0.5;
/// How far a margin may be off, decibels.
const MARGIN_SIGMA_DB: f64 = 3.0;
/// Margins beyond this say nothing of a threshold.
const FAR_DB: f64 = 40.0;

/// The likelihood of other thresholds: margins of predictions beside what was heard and what was not.
#[derive(Debug, Default)]
pub(super) struct Thresholds {
    shifts: Shifts,
    /// Echoes and silences.
    heard: [u32; 2],
}

impl Thresholds {
    pub(super) fn add(&mut self, ping: &Ping) {
        let margin_db = ping.sim.as_ref().and_then(|sim| sim.margin_db);
        let (Some(heard), Some(margin_db)) = (is_heard(ping.status), margin_db) else { return };
        if !margin_db.is_finite() || margin_db.abs() > FAR_DB {
            return;
        }
        self.heard[usize::from(!heard)] += 1;
        let count = (2.0 * MOST_DB / STEP_DB) as usize + 1;
        for (at, (sum, explained)) in self.shifts.of(count) {
            let over_db = margin_db - (STEP_DB * at as f64 - MOST_DB);
            let share = LAPSES + (1.0 - 2.0 * LAPSES) * logistic(over_db / MARGIN_SIGMA_DB);
            *sum += if heard { share } else { 1.0 - share }.ln();
            *explained += u32::from(heard == (over_db > 0.0));
        }
    }

    pub(super) fn explanation(&self) -> Option<Explanation> {
        // Without silences nothing says where hearing ends.
        if self.heard.contains(&0) {
            return None;
        }
        self.shifts.explanation("threshold", Quantity::ThresholdDb, STEP_DB)
    }
}

/// The logistic function that is nearest to the normal distribution's.
fn logistic(at: f64) -> f64 {
    (1.0 + (-1.702 * at).exp()).recip()
}

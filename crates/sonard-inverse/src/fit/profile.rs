//! Profile likelihood along ridges of the posterior.
//!
//! Where a wall, the pose and the speed of sound compensate each other, the likelihood is nearly
//! constant along a ridge; only the phases of arrivals determine the position on it. A fit started
//! off the ridge slides along it before phases take effect. So the ridge is followed in steps with
//! the combination held constant and everything else fitted. The best of these points are then
//! released.

use nalgebra::DVector;

use super::{
    FitError, Fitter, Optimum,
    checkpoint::{SearchResult, listed},
    one_of_many,
    perturbation::{CLOSE, ROUGH, StartPoint, keep_likelier, widened},
    refine::FAR_BELOW,
};
use crate::{
    candidates::Phases, likelihood::ErrorModel, parameter::Parameter, progress::FitProgress,
    time_walk::WELL_KNOWN,
};

/// Steps to each side, and their length in standard deviations of the rough information.
const STEPS: (usize, f64) = (8, 0.35);
/// Error model of a step with phases.
const WITH_PHASES: (f64, f64, f64) = (0.002, 1.0, 0.01);
/// Number of peaks followed, and of their optima refined.
const FOLLOWED: usize = 4;
const POLISHED: usize = 2;
/// Maximum number of rounds, each from a better optimum elsewhere.
const ROUNDS: usize = 3;

/// Direction in the parameters' units, with its standard deviation.
type Direction = (DVector<f64>, f64);

impl Fitter<'_> {
    /// Best optimum over the peaks along the ridges through an optimum, including itself. If ranges
    /// are too uncertain for phases, that one.
    pub(super) fn along_ridges(&mut self, mut best: Optimum) -> Result<Optimum, FitError> {
        if self.missed_wavelengths(&best.errors) > WELL_KNOWN {
            return Ok(best);
        }
        for _ in 0..ROUNDS {
            let (before, value) = (best.values.clone(), best.value);
            for end in self.ends_of_peaks(&best)? {
                if end.value > value - FAR_BELOW {
                    keep_likelier(&mut best, one_of_many(self.polished(end))?);
                }
            }
            if !self.is_apart(&best.values, &before) {
                break;
            }
        }
        Ok(best)
    }

    /// Optima reached from peaks, likeliest first: from each directly, and by closer error models
    /// with nothing held.
    fn ends_of_peaks(&mut self, best: &Optimum) -> Result<Vec<Optimum>, FitError> {
        let mut ends: Vec<Optimum> = Vec::new();
        for peak in self.peaks(best)? {
            ends.extend(self.end_with_phases(peak.values.clone(), &best.errors)?);
            (self.values, self.phases) = (peak.values, Phases::Known);
            ends.extend(one_of_many(self.settled(best.errors))?);
        }
        ends.sort_by(|a, b| b.value.total_cmp(&a.value));
        ends.truncate(POLISHED);
        Ok(ends)
    }

    /// Optimum with phases reached from a start by successively narrower error models; `None` if
    /// the ranges there are too uncertain for phases.
    pub(super) fn end_with_phases(
        &mut self,
        start: DVector<f64>,
        errors: &ErrorModel,
    ) -> Result<Option<Optimum>, FitError> {
        let looks = [CLOSE, WITH_PHASES].map(|by| (Phases::Known, spread_by(errors, by)));
        let Some(place) = self.place_by(|fitter| fitter.looked(start, looks))? else {
            return Ok(None);
        };
        (self.values, self.phases) = (place.values, Phases::Known);
        let end = one_of_many(self.settled(looks[1].1))?;
        Ok(end.filter(|end| !self.is_beyond_phases(&end.errors)))
    }

    /// Local maxima of the profiles along the ridges, likeliest first.
    fn peaks(&mut self, best: &Optimum) -> Result<Vec<StartPoint>, FitError> {
        let ridges = self.ridges(best)?;
        let of = ridges.len() * 2 * STEPS.0;
        let mut peaks: Vec<StartPoint> = Vec::new();
        for (number, ridge) in ridges.iter().enumerate() {
            let steps = self.profile(best, ridge, (number * 2 * STEPS.0, of))?;
            let values: Vec<f64> = steps.iter().map(|step| step.value).collect();
            let value = |at: Option<usize>| {
                at.and_then(|at| values.get(at)).copied().unwrap_or(f64::NEG_INFINITY)
            };
            let is_peak = |&(at, ref step): &(usize, StartPoint)| {
                step.value >= value(at.checked_sub(1)).max(value(Some(at + 1)))
            };
            peaks.extend(steps.into_iter().enumerate().filter(is_peak).map(|(_, step)| step));
        }
        peaks.sort_by(|a, b| b.value.total_cmp(&a.value));
        peaks.truncate(FOLLOWED);
        Ok(peaks)
    }

    /// Weakly constrained directions, and the threshold: an optimum with a threshold off by many
    /// decibels and an equally wide error model is a trap that no other direction leaves.
    fn ridges(&mut self, best: &Optimum) -> Result<Vec<Direction>, FitError> {
        let rough = widened(&best.errors, ROUGH);
        let mut ridges = self.weak_directions(&best.values, &rough, Phases::Unknown)?;
        if let Some(at) = self.parameters.iter().position(|of| **of == Parameter::Threshold) {
            let mut threshold = self.still();
            threshold[at] = self.fit.priors[at].sigma;
            ridges.push((threshold, 1.0));
        }
        Ok(ridges)
    }

    /// Profile along a ridge from one side to the other, without the middle; `number` steps precede
    /// it.
    fn profile(
        &mut self,
        best: &Optimum,
        (direction, sigma): &Direction,
        (number, of): (usize, usize),
    ) -> Result<Vec<StartPoint>, FitError> {
        let looks = [
            (Phases::Unknown, widened(&best.errors, CLOSE)),
            (Phases::Known, spread_by(&best.errors, WITH_PHASES)),
        ];
        let (steps, apart) = STEPS;
        let mut sides: [Vec<StartPoint>; 2] = Default::default();
        for (side, (places, sign)) in sides.iter_mut().zip([-1.0, 1.0]).enumerate() {
            let mut from = best.values.clone();
            for step in 1..=steps {
                let start = self.limited(from + sign * apart * *sigma * direction);
                let place = number + side * steps + step;
                let found = self.place_by(|fitter| {
                    fitter.watch.progress(FitProgress::Restart { start: place, of });
                    fitter.held = Some(fitter.along(direction));
                    let looked = fitter.looked(start, looks);
                    fitter.held = None;
                    looked
                })?;
                let Some(found) = found else { break };
                from = found.values.clone();
                places.push(found);
            }
        }
        let [before, behind] = sides;
        Ok(before.into_iter().rev().chain(behind).collect())
    }

    /// Linear functional that measures the position along a direction, in prior standard
    /// deviations.
    fn along(&self, direction: &DVector<f64>) -> DVector<f64> {
        let sigmas = self.prior_sigmas();
        direction.component_div(&sigmas).component_div(&sigmas)
    }

    /// Improves a start with two error models; the log-posterior uses the observed scatter.
    fn looked(
        &mut self,
        start: DVector<f64>,
        looks: [(Phases, ErrorModel); 2],
    ) -> Result<SearchResult, FitError> {
        self.values = start;
        for (phases, errors) in &looks {
            self.phases = *phases;
            let linear = self.linear()?;
            self.improve(&linear, errors)?;
        }
        let linear = self.linear()?;
        let errors = self.spread(&linear, &looks[1].1);
        let log_posterior = self.value(&linear, &errors);
        Ok(SearchResult::Place { values: listed(&self.values), log_posterior })
    }
}

fn spread_by(errors: &ErrorModel, (sigma_m, sigma_db, clutter): (f64, f64, f64)) -> ErrorModel {
    ErrorModel { sigma_m, sigma_db, outlier_share: clutter, ..*errors }
}

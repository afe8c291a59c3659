//! Ridges: places that readings hardly tell apart, one behind the other.
//!
//! Where a wall, the pose and the speed of sound make up for each other, readings are about as likely all along a ridge,
//! and only how arrivals meet in phase tells where on it they were taken. A fit that begins beside slides back along the
//! ridge before it has seen anything of that. So the ridge is gone along in steps that are held, everything else is fitted at
//! each of them, and from the best of them fits go on to where they end.

use nalgebra::DVector;

use super::{
    FitError, Settled, State,
    journal::{Found, listed},
    one_of_many,
    polish::FAR_BELOW,
    restart::{CLOSE, Place, ROUGH, keep_likelier, widened},
};
use crate::{
    candidates::Phases, likelihood::ErrorModel, parameter::Parameter, walk::WELL_KNOWN,
    watch::Progress,
};

/// Steps to each side, and how long each is, in standard deviations of what a rough look leaves in doubt.
const STEPS: (usize, f64) = (8, 0.35);
/// Spreads by which a step is fitted where phases are known.
const WITH_PHASES: (f64, f64, f64) = (0.002, 1.0, 0.01);
/// Peaks that are followed to their ends, and how many of these are polished.
const FOLLOWED: usize = 4;
const POLISHED: usize = 2;
/// How often ridges are gone along, from a better end elsewhere each time.
const ROUNDS: usize = 3;

/// A direction in the parameters' units, and how far values may be off along it, in standard deviations.
type Direction = (DVector<f64>, f64);

impl State<'_> {
    /// The likeliest end of those from peaks along the ridges through an end, or that one itself; and where ranges hardly tell
    /// phases, always that one.
    pub(super) fn along_ridges(&mut self, mut best: Settled) -> Result<Settled, FitError> {
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

    /// Where fits end that begin at peaks, the likeliest first: from each as it is, and from where closer looks lead once
    /// nothing is held.
    fn ends_of_peaks(&mut self, best: &Settled) -> Result<Vec<Settled>, FitError> {
        let mut ends: Vec<Settled> = Vec::new();
        for peak in self.peaks(best)? {
            ends.extend(self.end_with_phases(peak.values.clone(), &best.errors)?);
            (self.values, self.phases) = (peak.values, Phases::Known);
            ends.extend(one_of_many(self.settled(best.errors))?);
        }
        ends.sort_by(|one, other| other.value.total_cmp(&one.value));
        ends.truncate(POLISHED);
        Ok(ends)
    }

    /// Where a fit with phases ends that begins there, by closer and closer looks, whatever readings spread by elsewhere;
    /// nowhere if ranges are missed there by so much that they tell no phases.
    pub(super) fn end_with_phases(
        &mut self,
        start: DVector<f64>,
        errors: &ErrorModel,
    ) -> Result<Option<Settled>, FitError> {
        let looks = [CLOSE, WITH_PHASES].map(|by| (Phases::Known, spread_by(errors, by)));
        let Some(place) = self.place_by(|state| state.looked(start, looks))? else {
            return Ok(None);
        };
        (self.values, self.phases) = (place.values, Phases::Known);
        let end = one_of_many(self.settled(looks[1].1))?;
        Ok(end.filter(|end| !self.is_beyond_phases(&end.errors)))
    }

    /// Steps along the ridges that are likelier than both beside them, the likeliest first.
    fn peaks(&mut self, best: &Settled) -> Result<Vec<Place>, FitError> {
        let ridges = self.ridges(best)?;
        let of = ridges.len() * 2 * STEPS.0;
        let mut peaks: Vec<Place> = Vec::new();
        for (number, ridge) in ridges.iter().enumerate() {
            let steps = self.profile(best, ridge, (number * 2 * STEPS.0, of))?;
            let values: Vec<f64> = steps.iter().map(|step| step.value).collect();
            let value = |at: Option<usize>| {
                at.and_then(|at| values.get(at)).copied().unwrap_or(f64::NEG_INFINITY)
            };
            let is_peak = |&(at, ref step): &(usize, Place)| {
                step.value >= value(at.checked_sub(1)).max(value(Some(at + 1)))
            };
            peaks.extend(steps.into_iter().enumerate().filter(is_peak).map(|(_, step)| step));
        }
        peaks.sort_by(|one, other| other.value.total_cmp(&one.value));
        peaks.truncate(FOLLOWED);
        Ok(peaks)
    }

    /// The directions that are held least, and the threshold: one that is off by many decibels, with a spread as wide,
    /// is an end from which no other direction leads away.
    fn ridges(&mut self, best: &Settled) -> Result<Vec<Direction>, FitError> {
        let rough = widened(&best.errors, ROUGH);
        let mut ridges = self.doubtful(&best.values, &rough, Phases::Unknown)?;
        if let Some(at) = self.parameters.iter().position(|of| **of == Parameter::Threshold) {
            let mut threshold = self.still();
            threshold[at] = self.fit.priors[at].sigma;
            ridges.push((threshold, 1.0));
        }
        Ok(ridges)
    }

    /// Steps along a ridge from one side to the other, without the middle; `number` of all steps were made before.
    fn profile(
        &mut self,
        best: &Settled,
        (direction, sigma): &Direction,
        (number, of): (usize, usize),
    ) -> Result<Vec<Place>, FitError> {
        let looks = [
            (Phases::Unknown, widened(&best.errors, CLOSE)),
            (Phases::Known, spread_by(&best.errors, WITH_PHASES)),
        ];
        let (steps, apart) = STEPS;
        let mut sides: [Vec<Place>; 2] = Default::default();
        for (side, (places, sign)) in sides.iter_mut().zip([-1.0, 1.0]).enumerate() {
            let mut from = best.values.clone();
            for step in 1..=steps {
                let start = self.limited(from + sign * apart * *sigma * direction);
                let place = number + side * steps + step;
                let found = self.place_by(|state| {
                    state.watch.progress(Progress::Searching { place, of });
                    state.held = Some(state.along(direction));
                    let looked = state.looked(start, looks);
                    state.held = None;
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

    /// What tells how far values are along a direction, in standard deviations of what was believed.
    fn along(&self, direction: &DVector<f64>) -> DVector<f64> {
        let sigmas = self.prior_sigmas();
        direction.component_div(&sigmas).component_div(&sigmas)
    }

    /// Where it goes from a start by two looks, and how likely it is there with the spreads that readings have.
    fn looked(
        &mut self,
        start: DVector<f64>,
        looks: [(Phases, ErrorModel); 2],
    ) -> Result<Found, FitError> {
        self.values = start;
        for (phases, errors) in &looks {
            self.phases = *phases;
            let linear = self.linear()?;
            self.improve(&linear, errors)?;
        }
        let linear = self.linear()?;
        let errors = self.spread(&linear, &looks[1].1);
        let log_posterior = self.value(&linear, &errors);
        Ok(Found::Place { values: listed(&self.values), log_posterior })
    }
}

fn spread_by(errors: &ErrorModel, (sigma_m, sigma_db, clutter): (f64, f64, f64)) -> ErrorModel {
    ErrorModel { sigma_m, sigma_db, clutter, ..*errors }
}

//! Restarts by perturbation: a fit ends in a local optimum, which need not be the global one.
//!
//! Along weakly constrained directions a fit may pass the answer, and converge where other arrivals
//! explain the readings about as well: a delayed weak echo as one of a shorter path, a wall as its
//! neighbour. So these directions are searched about the optimum. Likelier points are followed, and
//! nearly as likely ones widen the intervals.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::{
    FitError, Fitter, Optimum, Search,
    checkpoint::{SearchResult, listed},
    continuation::STAGES,
    one_of_many,
    refine::FAR_BELOW,
};
use crate::{
    candidates::Phases,
    likelihood::{ErrorModel, READINGS_PER_ARC},
    progress::FitProgress,
};

/// Number of directions searched.
const DIRECTIONS: usize = 2;
/// Points on each side, and their distance in standard deviations of the rough information.
const PLACES: (i32, f64) = (6, 0.5);
/// Rough error model: standard deviation of ranges, metres, of the threshold, decibels, and
/// clutter.
pub(super) const ROUGH: (f64, f64, f64) = (0.03, 3.0, 0.05);
/// Error model for the comparison of points.
pub(super) const CLOSE: (f64, f64, f64) = (0.005, 1.5, 0.03);
/// Fraction of the prior standard deviation below which a direction counts as constrained.
const MIN_SHARE: f64 = 0.1;
/// Number of points followed to their optima, and their first stage.
const FOLLOWED: usize = 2;
const STAGE: usize = STAGES.len() - 1;
/// Number of points followed by a thorough fit, of those also followed from that stage, and of
/// optima refined.
const ENDS: usize = 8;
const STAGED: usize = 2;
const POLISHED: usize = 3;
/// Number of multi-start optima refined for a sweep with few echoes.
const POLISHED_OPEN: usize = 6;

/// Point near an optimum.
pub(super) struct StartPoint {
    pub(super) values: DVector<f64>,
    /// Log-posterior with the error model for comparison.
    pub(super) value: f64,
}

impl Optimum {
    fn place(&self) -> StartPoint {
        StartPoint { values: self.values.clone(), value: self.value }
    }
}

impl Fitter<'_> {
    /// Best optimum over all starts, and the additional variances due to the others. If prediction
    /// fails, as within a wall, there is no other start.
    pub(super) fn likeliest(&mut self) -> Result<(Optimum, DVector<f64>), FitError> {
        let mut best = self.attempt(self.still(), 0)?;
        let mut seen: Vec<StartPoint> = vec![best.place()];
        if self.is_astray(&best) || self.has_few_echoes() {
            let mut ends = self.ends_from_elsewhere()?;
            ends.sort_by(|a, b| b.value.total_cmp(&a.value));
            for (number, end) in ends.into_iter().enumerate() {
                seen.push(end.place());
                if number < POLISHED_OPEN && self.has_few_echoes() {
                    keep_likelier(&mut best, one_of_many(self.polished(end))?);
                } else {
                    keep_likelier(&mut best, Some(end));
                }
            }
        }
        if self.fit.search == Search::Quick {
            let places = self.places(&best)?;
            for place in places.iter().take(FOLLOWED) {
                keep_likelier(&mut best, one_of_many(self.attempt(place.values.clone(), STAGE))?);
            }
            let variances = self.variances_of_others(&best, &places)?;
            return Ok((best, variances));
        }
        best = self.polished(best)?;
        let places = self.places(&best)?;
        for end in self.ends(&best, &places)? {
            if end.value > best.value - FAR_BELOW {
                seen.push(end.place());
                keep_likelier(&mut best, one_of_many(self.polished(end))?);
            }
        }
        best = self.along_ridges(best)?;
        let variances = self.variances_of_all(&best, &places, &seen)?;
        Ok((best, variances))
    }

    /// Distinct optima reached from some points, likeliest first.
    fn ends(&mut self, best: &Optimum, places: &[StartPoint]) -> Result<Vec<Optimum>, FitError> {
        let close = widened(&best.errors, CLOSE);
        let mut tried: Vec<Optimum> = Vec::new();
        for (number, place) in places.iter().take(ENDS).enumerate() {
            (self.values, self.phases) = (place.values.clone(), Phases::Unknown);
            let end = self.settled(close).and_then(|end| self.with_phases(end));
            tried.extend(one_of_many(end)?);
            if number < STAGED {
                tried.extend(one_of_many(self.attempt(place.values.clone(), STAGE))?);
            }
        }
        tried.sort_by(|a, b| b.value.total_cmp(&a.value));
        let mut ends: Vec<Optimum> = Vec::new();
        for end in tried {
            let is_apart = |other: &Optimum| self.is_apart(&end.values, &other.values);
            if ends.iter().chain([best]).all(is_apart) {
                ends.push(end);
            }
        }
        ends.truncate(POLISHED);
        Ok(ends)
    }

    /// Optimum reached from a start, by continuation from a given stage.
    pub(super) fn attempt(
        &mut self,
        start: DVector<f64>,
        stage: usize,
    ) -> Result<Optimum, FitError> {
        (self.values, self.phases) = (start, Phases::Unknown);
        let mut errors = self.rough_errors();
        errors.sigma_m *= STAGES[stage].0;
        self.approach(&mut errors, stage..STAGES.len())?;
        self.settle(errors)
    }

    /// Distinct points along the weakly constrained directions about an optimum, each improved;
    /// likeliest first.
    fn places(&mut self, end: &Optimum) -> Result<Vec<StartPoint>, FitError> {
        let close = widened(&end.errors, CLOSE);
        let (places, apart) = PLACES;
        let mut tried: Vec<StartPoint> = Vec::new();
        let weak =
            self.weak_directions(&end.values, &widened(&end.errors, ROUGH), Phases::Unknown)?;
        let (mut number, of) = (0, weak.len() * 2 * places as usize);
        for (direction, sigma) in weak {
            for place in (-places..=places).filter(|place| *place != 0) {
                number += 1;
                let by = f64::from(place) * apart * sigma;
                let start = self.limited(&end.values + by * &direction);
                tried.extend(self.place(start, &close, (number, of))?);
            }
        }
        Ok(self.distinct(tried, &[&end.values]))
    }

    /// Improves a start and reports progress; `None` if prediction fails.
    pub(super) fn place(
        &mut self,
        start: DVector<f64>,
        errors: &ErrorModel,
        (place, of): (usize, usize),
    ) -> Result<Option<StartPoint>, FitError> {
        self.place_by(|fitter| {
            fitter.watch.progress(FitProgress::Restart { start: place, of });
            fitter.improved(start, errors)
        })
    }

    /// Point found by a search; `None` if prediction fails.
    pub(super) fn place_by(
        &mut self,
        search: impl FnOnce(&mut Self) -> Result<SearchResult, FitError>,
    ) -> Result<Option<StartPoint>, FitError> {
        match one_of_many(self.found(search))? {
            None => Ok(None),
            Some(SearchResult::Place { values, log_posterior: value }) => {
                Ok(Some(StartPoint { values: DVector::from_vec(values), value }))
            }
            Some(_) => Err(FitError::OtherFit),
        }
    }

    /// Points distinct from each other and from known ones, likeliest first.
    pub(super) fn distinct(
        &self,
        mut tried: Vec<StartPoint>,
        known: &[&DVector<f64>],
    ) -> Vec<StartPoint> {
        tried.sort_by(|a, b| b.value.total_cmp(&a.value));
        let mut places: Vec<StartPoint> = Vec::new();
        for place in tried {
            let known = places.iter().map(|other| &other.values).chain(known.iter().copied());
            if known.into_iter().all(|other| self.is_apart(&place.values, other)) {
                places.push(place);
            }
        }
        places
    }

    /// Improves a start by two sets of steps.
    fn improved(
        &mut self,
        start: DVector<f64>,
        errors: &ErrorModel,
    ) -> Result<SearchResult, FitError> {
        self.values = start;
        for _ in 0..2 {
            let linear = self.linear()?;
            self.improve(&linear, errors)?;
        }
        let linear = self.linear()?;
        let log_posterior = self.value(&linear, errors);
        Ok(SearchResult::Place { values: listed(&self.values), log_posterior })
    }

    /// Additional variances due to other points that explain the readings nearly as well.
    fn variances_of_others(
        &mut self,
        best: &Optimum,
        places: &[StartPoint],
    ) -> Result<DVector<f64>, FitError> {
        (self.values, self.phases) = (best.values.clone(), Phases::Unknown);
        let linear = self.linear()?;
        let of_best = self.value(&linear, &widened(&best.errors, CLOSE));
        let others = places.iter().map(|place| (&place.values, odds(place.value, of_best)));
        Ok(self.spread_of(best, others.collect()))
    }

    /// Additional variances of a thorough fit: distinct points and other optima.
    fn variances_of_all(
        &mut self,
        best: &Optimum,
        places: &[StartPoint],
        ends: &[StartPoint],
    ) -> Result<DVector<f64>, FitError> {
        (self.values, self.phases) = (best.values.clone(), Phases::Unknown);
        let close = widened(&best.errors, CLOSE);
        let linear = self.linear()?;
        let of_best = self.value(&linear, &close);
        // The optimum differs slightly with a wider error model; points near either are the same.
        let home = match one_of_many(self.improved(best.values.clone(), &close))? {
            Some(SearchResult::Place { values, log_posterior }) if log_posterior > of_best => {
                StartPoint { values: DVector::from_vec(values), value: log_posterior }
            }
            _ => StartPoint { values: best.values.clone(), value: of_best },
        };
        let places = places.iter().map(|place| (place, home.value));
        let ends = ends.iter().map(|end| (end, best.value));
        let mut others: Vec<(&DVector<f64>, f64)> = Vec::new();
        for (place, of) in places.chain(ends) {
            let known = others.iter().map(|(values, _)| *values);
            let mut known = known.chain([&home.values, &best.values]);
            if known.all(|known| self.is_apart(&place.values, known)) {
                others.push((&place.values, odds(place.value, of)));
            }
        }
        Ok(self.spread_of(best, others))
    }

    /// Variances about the best values of other values weighted by their odds.
    fn spread_of(&self, best: &Optimum, others: Vec<(&DVector<f64>, f64)>) -> DVector<f64> {
        let all: f64 = 1.0 + others.iter().map(|(_, odds)| odds).sum::<f64>();
        let mut variances = self.still();
        for (values, odds) in others {
            let away = values - &best.values;
            variances += away.component_mul(&away) * (odds / all);
        }
        variances
    }

    /// Weakly constrained directions, in the parameters' units, with their standard deviations: the
    /// largest eigenvalues of the posterior covariance relative to the prior.
    pub(super) fn weak_directions(
        &mut self,
        about: &DVector<f64>,
        errors: &ErrorModel,
        phases: Phases,
    ) -> Result<Vec<(DVector<f64>, f64)>, FitError> {
        (self.values, self.phases) = (about.clone(), phases);
        let curve = self.linear()?.curve(&self.still(), errors);
        let covariance = self.covariance(curve.information).ok_or(FitError::Degenerate)?;
        let sigmas = self.prior_sigmas();
        let prior = DMatrix::from_diagonal(&sigmas.map(f64::recip));
        let of = SymmetricEigen::new(&prior * covariance * &prior);
        let mut order: Vec<usize> = (0..sigmas.len()).collect();
        order.sort_by(|a, b| of.eigenvalues[*b].total_cmp(&of.eigenvalues[*a]));
        order.retain(|&at| of.eigenvalues[at] > MIN_SHARE * MIN_SHARE);
        let direction = |at: usize| {
            (of.eigenvectors.column(at).component_mul(&sigmas), of.eigenvalues[at].sqrt())
        };
        Ok(order.into_iter().take(DIRECTIONS).map(direction).collect())
    }

    pub(super) fn prior_sigmas(&self) -> DVector<f64> {
        DVector::from_iterator(
            self.fit.priors.len(),
            self.fit.priors.iter().map(|prior| prior.sigma),
        )
    }

    pub(super) fn limited(&self, mut values: DVector<f64>) -> DVector<f64> {
        for (value, parameter) in values.iter_mut().zip(&self.parameters) {
            let (min, max) = self.start.limits(parameter);
            *value = value.clamp(min, max);
        }
        values
    }

    /// Returns `true` if fits from two points would probably end in different optima.
    pub(super) fn is_apart(&self, a: &DVector<f64>, b: &DVector<f64>) -> bool {
        (a - b).component_div(&self.prior_sigmas()).amax() > 0.5 * MIN_SHARE
    }
}

/// Odds of a point relative to another one, at most one.
fn odds(value: f64, of: f64) -> f64 {
    ((value - of) / READINGS_PER_ARC).min(0.0).exp()
}

pub(super) fn widened(
    errors: &ErrorModel,
    (sigma_m, sigma_db, clutter): (f64, f64, f64),
) -> ErrorModel {
    ErrorModel {
        sigma_m: errors.sigma_m.max(sigma_m),
        sigma_db: errors.sigma_db.max(sigma_db),
        outlier_share: errors.outlier_share.max(clutter),
        ..*errors
    }
}

pub(super) fn keep_likelier(best: &mut Optimum, end: Option<Optimum>) {
    if let Some(end) = end
        && end.value > best.value
    {
        *best = end;
    }
}

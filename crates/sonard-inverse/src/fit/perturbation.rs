//! Restarts by perturbation: a fit ends in a local optimum, which need not be the global one.
//!
//! Along weakly constrained directions a fit may pass the answer, and converge where other arrivals
//! explain the readings about as well: a delayed weak echo as one of a shorter path, a wall as its
//! neighbour. So these directions are searched about the optimum. Likelier points are followed, and
//! nearly as likely ones widen the intervals.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::{
    FitError, Fitter, Optimum, Point, Problem, Search,
    checkpoint::{SearchResult, listed},
    continuation::STAGES,
    lm_step::Improved,
    one_of_many,
    refine::FAR_BELOW,
};
use crate::{
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
    fn start_point(&self) -> StartPoint {
        StartPoint { values: self.point.values.clone(), value: self.value }
    }
}

impl Fitter<'_> {
    /// Best optimum over all starts, and the additional variances due to the others. If prediction
    /// fails, as within a wall, there is no other start.
    pub(super) fn find_optimum(&self) -> Result<(Optimum, DVector<f64>), FitError> {
        let problem = &self.problem;
        let mut best = self.fit_from_stage(problem.zero(), 0)?;
        let mut seen: Vec<StartPoint> = vec![best.start_point()];
        if self.is_failed(&best) || problem.has_few_echoes() {
            let mut optima = self.restart_elsewhere()?;
            optima.sort_by(|a, b| b.value.total_cmp(&a.value));
            for (number, optimum) in optima.into_iter().enumerate() {
                seen.push(optimum.start_point());
                if number < POLISHED_OPEN && problem.has_few_echoes() {
                    keep_likelier(&mut best, one_of_many(self.refine(optimum))?);
                } else {
                    keep_likelier(&mut best, Some(optimum));
                }
            }
        }
        if problem.options.search == Search::Quick {
            let starts = self.perturb(&best)?;
            for start in starts.iter().take(FOLLOWED) {
                let optimum = self.fit_from_stage(start.values.clone(), STAGE);
                keep_likelier(&mut best, one_of_many(optimum)?);
            }
            let variances = self.variances_of_starts(&best, &starts)?;
            return Ok((best, variances));
        }
        best = self.refine(best)?;
        let starts = self.perturb(&best)?;
        for optimum in self.follow(&best, &starts)? {
            if optimum.value > best.value - FAR_BELOW {
                seen.push(optimum.start_point());
                keep_likelier(&mut best, one_of_many(self.refine(optimum))?);
            }
        }
        best = self.search_ridges(best)?;
        let variances = self.variances_of_all(&best, &starts, &seen)?;
        Ok((best, variances))
    }

    /// Distinct optima reached from some starts, likeliest first.
    fn follow(&self, best: &Optimum, starts: &[StartPoint]) -> Result<Vec<Optimum>, FitError> {
        let close = widened(&best.errors, CLOSE);
        let mut tried: Vec<Optimum> = Vec::new();
        for (number, start) in starts.iter().take(ENDS).enumerate() {
            let optimum = self.settle(&Point::incoherent(start.values.clone()), close);
            tried.extend(one_of_many(optimum)?);
            if number < STAGED {
                tried.extend(one_of_many(self.fit_from_stage(start.values.clone(), STAGE))?);
            }
        }
        tried.sort_by(|a, b| b.value.total_cmp(&a.value));
        let mut optima: Vec<Optimum> = Vec::new();
        for optimum in tried {
            let is_apart =
                |other: &Optimum| self.problem.is_apart(&optimum.point.values, &other.point.values);
            if optima.iter().chain([best]).all(is_apart) {
                optima.push(optimum);
            }
        }
        optima.truncate(POLISHED);
        Ok(optima)
    }

    /// Optimum reached from a start, by continuation from a given stage.
    pub(super) fn fit_from_stage(
        &self,
        start: DVector<f64>,
        stage: usize,
    ) -> Result<Optimum, FitError> {
        let mut errors = self.problem.rough_errors();
        errors.sigma_m *= STAGES[stage].0;
        let stages = stage..STAGES.len();
        let (point, errors) = self.run_continuation(Point::incoherent(start), errors, stages)?;
        self.settle(&point, errors)
    }

    /// Distinct points along the weakly constrained directions about an optimum, each improved;
    /// likeliest first.
    fn perturb(&self, optimum: &Optimum) -> Result<Vec<StartPoint>, FitError> {
        let about = Point::incoherent(optimum.point.values.clone());
        let close = widened(&optimum.errors, CLOSE);
        let (places, apart) = PLACES;
        let mut tried: Vec<StartPoint> = Vec::new();
        let weak = self.weak_directions(&about, &widened(&optimum.errors, ROUGH))?;
        let (mut number, of) = (0, weak.len() * 2 * places as usize);
        for (direction, sigma) in weak {
            for place in (-places..=places).filter(|place| *place != 0) {
                number += 1;
                let by = f64::from(place) * apart * sigma;
                let start = about.moved_to(self.problem.limited(&about.values + by * &direction));
                tried.extend(self.improve_start(&start, &close, (number, of))?);
            }
        }
        Ok(self.problem.distinct(tried, &[&about.values]))
    }

    /// Improves a start by two sets of steps and reports progress; `None` if prediction fails.
    pub(super) fn improve_start(
        &self,
        start: &Point,
        errors: &ErrorModel,
        (number, of): (usize, usize),
    ) -> Result<Option<StartPoint>, FitError> {
        self.run_start(|| {
            self.observer.progress(FitProgress::Restart { start: number, of });
            self.improve_twice(start, errors)
        })
    }

    /// Point found by a search; `None` if prediction fails.
    pub(super) fn run_start(
        &self,
        search: impl FnOnce() -> Result<SearchResult, FitError>,
    ) -> Result<Option<StartPoint>, FitError> {
        match one_of_many(self.run_or_replay(search))? {
            None => Ok(None),
            Some(SearchResult::Place { values, log_posterior: value }) => {
                Ok(Some(StartPoint { values: DVector::from_vec(values), value }))
            }
            Some(_) => Err(FitError::OtherFit),
        }
    }

    fn improve_twice(&self, start: &Point, errors: &ErrorModel) -> Result<SearchResult, FitError> {
        let mut point = start.clone();
        for _ in 0..2 {
            let linear = self.linearize(&point)?;
            Improved { point, .. } = self.improve(&linear, &point, errors, None)?;
        }
        let linear = self.linearize(&point)?;
        let log_posterior = self.log_posterior(&linear, &point, errors);
        Ok(SearchResult::Place { values: listed(&point.values), log_posterior })
    }

    /// Additional variances due to other points that explain the readings nearly as well.
    fn variances_of_starts(
        &self,
        best: &Optimum,
        starts: &[StartPoint],
    ) -> Result<DVector<f64>, FitError> {
        let point = Point::incoherent(best.point.values.clone());
        let linear = self.linearize(&point)?;
        let of_best = self.log_posterior(&linear, &point, &widened(&best.errors, CLOSE));
        let others = starts.iter().map(|start| (&start.values, odds(start.value, of_best)));
        Ok(self.problem.variances_about(&point.values, others.collect()))
    }

    /// Additional variances of a thorough fit: distinct points and other optima.
    fn variances_of_all(
        &self,
        best: &Optimum,
        starts: &[StartPoint],
        optima: &[StartPoint],
    ) -> Result<DVector<f64>, FitError> {
        let (problem, values) = (&self.problem, &best.point.values);
        let point = Point::incoherent(values.clone());
        let close = widened(&best.errors, CLOSE);
        let linear = self.linearize(&point)?;
        let of_best = self.log_posterior(&linear, &point, &close);
        // The optimum differs slightly with a wider error model; points near either are the same.
        let home = match one_of_many(self.improve_twice(&point, &close))? {
            Some(SearchResult::Place { values, log_posterior }) if log_posterior > of_best => {
                StartPoint { values: DVector::from_vec(values), value: log_posterior }
            }
            _ => StartPoint { values: values.clone(), value: of_best },
        };
        let starts = starts.iter().map(|start| (start, home.value));
        let optima = optima.iter().map(|optimum| (optimum, best.value));
        let mut others: Vec<(&DVector<f64>, f64)> = Vec::new();
        for (other, of) in starts.chain(optima) {
            let known = others.iter().map(|(values, _)| *values);
            let mut known = known.chain([&home.values, values]);
            if known.all(|known| problem.is_apart(&other.values, known)) {
                others.push((&other.values, odds(other.value, of)));
            }
        }
        Ok(problem.variances_about(values, others))
    }

    /// Weakly constrained directions about a point, in the parameters' units, with their standard
    /// deviations: the largest eigenvalues of the posterior covariance relative to the prior.
    pub(super) fn weak_directions(
        &self,
        about: &Point,
        errors: &ErrorModel,
    ) -> Result<Vec<(DVector<f64>, f64)>, FitError> {
        let problem = &self.problem;
        let curve = self.linearize(about)?.curve(&problem.zero(), errors);
        let covariance = problem.covariance(curve.information)?;
        let sigmas = problem.prior_sigmas();
        let prior = DMatrix::from_diagonal(&sigmas.map(f64::recip));
        let eigen = SymmetricEigen::new(&prior * covariance * &prior);
        let mut order: Vec<usize> = (0..sigmas.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        order.retain(|&at| eigen.eigenvalues[at] > MIN_SHARE * MIN_SHARE);
        let direction = |at: usize| {
            (eigen.eigenvectors.column(at).component_mul(&sigmas), eigen.eigenvalues[at].sqrt())
        };
        Ok(order.into_iter().take(DIRECTIONS).map(direction).collect())
    }
}

impl Problem<'_> {
    /// Returns `true` if fits from two points would probably end in different optima.
    pub(super) fn is_apart(&self, a: &DVector<f64>, b: &DVector<f64>) -> bool {
        (a - b).component_div(&self.prior_sigmas()).amax() > 0.5 * MIN_SHARE
    }

    /// Points distinct from each other and from known ones, likeliest first.
    pub(super) fn distinct(
        &self,
        mut tried: Vec<StartPoint>,
        known: &[&DVector<f64>],
    ) -> Vec<StartPoint> {
        tried.sort_by(|a, b| b.value.total_cmp(&a.value));
        let mut starts: Vec<StartPoint> = Vec::new();
        for start in tried {
            let known = starts.iter().map(|other| &other.values).chain(known.iter().copied());
            if known.into_iter().all(|other| self.is_apart(&start.values, other)) {
                starts.push(start);
            }
        }
        starts
    }

    /// Variances about the best values of other values weighted by their odds.
    fn variances_about(
        &self,
        best: &DVector<f64>,
        others: Vec<(&DVector<f64>, f64)>,
    ) -> DVector<f64> {
        let all: f64 = 1.0 + others.iter().map(|(_, odds)| odds).sum::<f64>();
        let mut variances = self.zero();
        for (values, odds) in others {
            let away = values - best;
            variances += away.component_mul(&away) * (odds / all);
        }
        variances
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

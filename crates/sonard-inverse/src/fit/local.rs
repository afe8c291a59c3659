//! Local fits with reduced search.

use std::slice;

use nalgebra::DVector;
use sonard_model::geometry::Pose;

use super::{FitError, FitOptions, FitResult, Fitter, Point, Problem, continuation::STAGES};
use crate::{
    likelihood::ErrorModel,
    progress::{FitObserver, NoObserver},
    sweep::FitSweep,
    world::{SimulatorSet, World},
};

/// Stages of a fit started near its optimum.
const NEAR: [usize; 3] = [0, 2, 4];

/// Rough pose of a single sweep.
pub(crate) struct RoughFit {
    pub(crate) pose: Pose,
    pub(crate) log_posterior: f64,
    pub(crate) sigma_m: f64,
}

/// Fits from given initial values, one change for each parameter, with known phases and without
/// restarts. For simulations with known truth: separates failures of the search from readings that
/// are likelier elsewhere.
///
/// # Errors
/// As [`fit`](super::fit).
///
/// # Panics
/// If the number of values differs from that of the parameters.
pub fn fit_from(
    world: &World,
    sweeps: &[FitSweep],
    fit: &FitOptions,
    start: &[f64],
    errors: &ErrorModel,
) -> Result<FitResult, FitError> {
    assert_eq!(start.len(), fit.priors.len(), "one value for each parameter");
    let simulators = SimulatorSet::new(&world.with_face_on_axis())?;
    let fitter = Fitter::new(Problem::new(world, sweeps, fit)?, simulators, &NoObserver);
    let optimum = fitter.converge(&Point::coherent(DVector::from_row_slice(start)), *errors)?;
    fitter.report(fitter.refine(optimum)?, &fitter.problem.zero())
}

/// Fits a single sweep roughly, by every other stage.
pub(crate) fn approach(
    simulators: SimulatorSet,
    world: &World,
    sweep: &FitSweep,
    fit: &FitOptions,
    observer: &dyn FitObserver,
) -> Result<RoughFit, FitError> {
    let problem = Problem::new(world, slice::from_ref(sweep), fit)?;
    let fitter = Fitter::new(problem, simulators, observer);
    Ok(fitter.approach_roughly((0..STAGES.len()).step_by(2))?.0)
}

/// Fits a single sweep from a nearby start, unless its rough log-posterior is below `least`.
/// Returns that log-posterior as well.
pub(crate) fn fit_near(
    simulators: SimulatorSet,
    world: &World,
    sweep: &FitSweep,
    fit: &FitOptions,
    least: f64,
    observer: &dyn FitObserver,
) -> Result<Option<(FitResult, f64)>, FitError> {
    let problem = Problem::new(world, slice::from_ref(sweep), fit)?;
    let fitter = Fitter::new(problem, simulators, observer);
    let (RoughFit { log_posterior, .. }, point, errors) =
        fitter.approach_roughly(NEAR.into_iter())?;
    if log_posterior < least {
        return Ok(None);
    }
    let optimum = fitter.settle(&point, errors)?;
    Ok(Some((fitter.report(optimum, &fitter.problem.zero())?, log_posterior)))
}

impl Fitter<'_> {
    /// Runs some stages of the continuation from the prior mean, without outlier arcs.
    fn approach_roughly(
        &self,
        stages: impl Iterator<Item = usize>,
    ) -> Result<(RoughFit, Point, ErrorModel), FitError> {
        let (problem, errors) = (&self.problem, self.problem.rough_errors().without_arcs());
        let (point, errors) =
            self.run_continuation(Point::incoherent(problem.zero()), errors, stages)?;
        let linear = self.linearize(&point)?;
        let scatter = self.estimate_errors(&linear, &errors);
        let found = RoughFit {
            pose: problem.poses(&point.values)[0],
            log_posterior: self.log_posterior(&linear, &point, &scatter),
            sigma_m: scatter.sigma_m,
        };
        Ok((found, point, errors))
    }
}

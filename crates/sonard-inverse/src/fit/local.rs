//! Local fits with reduced search.

use std::slice;

use nalgebra::DVector;
use sonard_model::geometry::Pose;

use super::{FitError, FitOptions, FitResult, Fitter, continuation::STAGES};
use crate::{
    candidates::Phases,
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
    let models = SimulatorSet::new(&world.with_face_on_axis())?;
    let mut fitter = Fitter::new(models, world, sweeps, fit, &NoObserver)?;
    fitter.values = DVector::from_row_slice(start);
    fitter.phases = Phases::Known;
    let end = fitter.settled(*errors)?;
    let end = fitter.polished(end)?;
    let beside = fitter.still();
    fitter.end(end, &beside)
}

/// Fits a single sweep roughly, by every other stage.
pub(crate) fn approach(
    models: SimulatorSet,
    world: &World,
    sweep: &FitSweep,
    fit: &FitOptions,
    watch: &dyn FitObserver,
) -> Result<RoughFit, FitError> {
    let mut fitter = Fitter::new(models, world, slice::from_ref(sweep), fit, watch)?;
    Ok(fitter.approached((0..STAGES.len()).step_by(2))?.0)
}

/// Fits a single sweep from a nearby start, unless its rough log-posterior is below `least`.
/// Returns that log-posterior as well.
pub(crate) fn fit_near(
    models: SimulatorSet,
    world: &World,
    sweep: &FitSweep,
    fit: &FitOptions,
    least: f64,
    watch: &dyn FitObserver,
) -> Result<Option<(FitResult, f64)>, FitError> {
    let mut fitter = Fitter::new(models, world, slice::from_ref(sweep), fit, watch)?;
    let (RoughFit { log_posterior, .. }, errors) = fitter.approached(NEAR.into_iter())?;
    if log_posterior < least {
        return Ok(None);
    }
    let end = fitter.settle(errors)?;
    let beside = fitter.still();
    Ok(Some((fitter.end(end, &beside)?, log_posterior)))
}

impl Fitter<'_> {
    fn approached(
        &mut self,
        stages: impl Iterator<Item = usize>,
    ) -> Result<(RoughFit, ErrorModel), FitError> {
        let mut errors = self.rough_errors().without_arcs();
        self.approach(&mut errors, stages)?;
        let linear = self.linear()?;
        let spread = self.spread(&linear, &errors);
        let log_posterior = self.value(&linear, &spread);
        let found = RoughFit { pose: self.poses()[0], log_posterior, sigma_m: spread.sigma_m };
        Ok((found, errors))
    }
}

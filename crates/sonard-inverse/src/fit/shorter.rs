//! Fits that leave something out of the search.

use std::slice;

use nalgebra::DVector;
use sonard_model::geometry::Pose;

use super::{Fit, FitError, Fitted, State};
use crate::{
    candidates::Phases,
    likelihood::ErrorModel,
    sweep::Sweep,
    watch::{Unwatched, Watch},
    world::{Models, World},
};

/// Where a single sweep was taken, roughly.
pub(crate) struct Approached {
    pub(crate) pose: Pose,
    pub(crate) log_posterior: f64,
    pub(crate) sigma_m: f64,
}

/// Where a fit ends that begins at other values than those believed: `start`, one change of each parameter. Arrivals meet with
/// the phases that the model tells, and nothing is searched beside it. For simulations, where the truth is known: whether a fit that ended elsewhere was led astray by
/// its search, or by readings that are likelier there.
///
/// # Errors
/// As [`fit`].
///
/// # Panics
/// If there are not as many values as parameters.
pub fn fit_from(
    world: &World,
    sweeps: &[Sweep],
    fit: &Fit,
    start: &[f64],
    errors: &ErrorModel,
) -> Result<Fitted, FitError> {
    assert_eq!(start.len(), fit.priors.len(), "one value for each parameter");
    let models = Models::of(&world.with_face_on_axis())?;
    let mut state = State::new(models, world, sweeps, fit, &Unwatched)?;
    state.values = DVector::from_row_slice(start);
    state.phases = Phases::Known;
    let end = state.settled(*errors)?;
    let end = state.polished(end)?;
    let beside = state.still();
    state.end(end, &beside)
}

/// The same with models of the world with the transducer on its axis, which it may have in common with other fits.
pub(crate) fn fit_with(
    models: Models,
    world: &World,
    sweeps: &[Sweep],
    fit: &Fit,
    watch: &dyn Watch,
) -> Result<Fitted, FitError> {
    let mut state = State::new(models, world, sweeps, fit, watch)?;
    let end = state.attempt(state.still(), 0)?;
    let beside = state.still();
    state.end(end, &beside)
}

/// Goes near to where a fit would end, with a single sweep.
pub(crate) fn approach(
    models: Models,
    world: &World,
    sweep: &Sweep,
    fit: &Fit,
    watch: &dyn Watch,
) -> Result<Approached, FitError> {
    let sweeps = slice::from_ref(sweep);
    let mut state = State::new(models, world, sweeps, fit, watch)?;
    let mut errors = state.rough_errors();
    state.approach(&mut errors, 0)?;
    let linear = state.linear()?;
    let errors = state.spread(&linear, &errors);
    let log_posterior = state.value(&linear, &errors);
    Ok(Approached { pose: state.poses()[0], log_posterior, sigma_m: errors.sigma_m })
}

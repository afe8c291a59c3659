//! Fits that search less than usual.

use std::slice;

use nalgebra::DVector;
use sonard_model::geometry::Pose;

use super::{Fit, FitError, Fitted, State, settle::STAGES};
use crate::{
    candidates::Phases,
    likelihood::ErrorModel,
    sweep::Sweep,
    watch::{Unwatched, Watch},
    world::{Models, World},
};

/// Stages of a fit that begins near where it ends.
const NEAR: [usize; 3] = [0, 2, 4];

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
/// As [`fit`](super::fit).
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

/// Goes near to where a fit of a single sweep would end, by every other spread.
pub(crate) fn approach(
    models: Models,
    world: &World,
    sweep: &Sweep,
    fit: &Fit,
    watch: &dyn Watch,
) -> Result<Approached, FitError> {
    let mut state = State::new(models, world, slice::from_ref(sweep), fit, watch)?;
    Ok(state.approached((0..STAGES.len()).step_by(2))?.0)
}

/// Fits a single sweep that begins near where it ends, unless it turns out to be less likely than `least`. Gives how likely
/// it was before it settled, too.
pub(crate) fn fit_near(
    models: Models,
    world: &World,
    sweep: &Sweep,
    fit: &Fit,
    least: f64,
    watch: &dyn Watch,
) -> Result<Option<(Fitted, f64)>, FitError> {
    let mut state = State::new(models, world, slice::from_ref(sweep), fit, watch)?;
    let (Approached { log_posterior, .. }, errors) = state.approached(NEAR.into_iter())?;
    if log_posterior < least {
        return Ok(None);
    }
    let end = state.settle(errors)?;
    let beside = state.still();
    Ok(Some((state.end(end, &beside)?, log_posterior)))
}

impl State<'_> {
    fn approached(
        &mut self,
        stages: impl Iterator<Item = usize>,
    ) -> Result<(Approached, ErrorModel), FitError> {
        let mut errors = self.rough_errors().without_arcs();
        self.approach(&mut errors, stages)?;
        let linear = self.linear()?;
        let spread = self.spread(&linear, &errors);
        let log_posterior = self.value(&linear, &spread);
        let found = Approached { pose: self.poses()[0], log_posterior, sigma_m: spread.sigma_m };
        Ok((found, errors))
    }
}

//! Problem of a fit, and points at which its posterior is evaluated.

use nalgebra::{Cholesky, DMatrix, DVector};
use sonard_model::geometry::{Pose, wrap_180};

use super::{FitError, FitOptions, Search, continuation};
use crate::{
    candidates::Phases,
    likelihood::ErrorModel,
    parameter::Parameter,
    sweep::FitSweep,
    world::{World, WorldError},
};

/// Range error in wavelengths above which phases carry no information.
const MAX_PHASE_ERROR: f64 = 0.5;

/// World, sweeps, parameters and options of a fit: the immutable input of its stages.
pub(super) struct Problem<'a> {
    /// World at the prior mean.
    pub(super) start: &'a World,
    pub(super) sweeps: &'a [FitSweep],
    pub(super) options: &'a FitOptions,
    pub(super) parameters: Vec<&'a Parameter>,
}

/// Point in the space of the parameters, with the assumptions of its predictions.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    /// Changes from the prior mean, each in its parameter's unit.
    pub(super) values: DVector<f64>,
    /// Knowledge of the arrivals' relative phases.
    pub(super) phases: Phases,
    /// Predictions use the actual transducer position instead of the axis.
    pub(super) is_exact: bool,
}

impl Point {
    /// Point with unknown phases and the transducer on the axis.
    pub(super) const fn incoherent(values: DVector<f64>) -> Self {
        Self { values, phases: Phases::Unknown, is_exact: false }
    }

    /// Point with known phases and the transducer on the axis.
    pub(super) const fn coherent(values: DVector<f64>) -> Self {
        Self { values, phases: Phases::Known, is_exact: false }
    }

    /// Point elsewhere with the same assumptions.
    pub(super) const fn moved_to(&self, values: DVector<f64>) -> Self {
        Self { values, ..*self }
    }

    /// Same point with other knowledge of the phases.
    pub(super) fn with_phases(&self, phases: Phases) -> Self {
        Self { phases, ..self.clone() }
    }
}

impl<'a> Problem<'a> {
    /// # Errors
    /// [`FitError::Nothing`] without parameters or sweeps.
    pub(super) fn new(
        start: &'a World,
        sweeps: &'a [FitSweep],
        options: &'a FitOptions,
    ) -> Result<Self, FitError> {
        if options.priors.is_empty() || sweeps.is_empty() {
            return Err(FitError::Nothing);
        }
        let parameters = options.priors.iter().map(|prior| &prior.parameter).collect();
        Ok(Self { start, sweeps, options, parameters })
    }

    /// Vector of zeros, one for each parameter: the prior mean, or no change.
    pub(super) fn zero(&self) -> DVector<f64> {
        DVector::zeros(self.parameters.len())
    }

    /// Index of a parameter, if it is fitted.
    pub(super) fn index_of(&self, parameter: &Parameter) -> Option<usize> {
        self.parameters.iter().position(|of| **of == *parameter)
    }

    /// World with the parameters changed.
    pub(super) fn world(&self, values: &DVector<f64>) -> Result<World, WorldError> {
        let changes: Vec<(&Parameter, f64)> =
            self.parameters.iter().copied().zip(values.iter().copied()).collect();
        self.start.changed(&changes)
    }

    /// Poses of the sweeps with the parameters changed.
    pub(super) fn poses(&self, values: &DVector<f64>) -> Vec<Pose> {
        let mut poses: Vec<Pose> = self.sweeps.iter().map(|sweep| sweep.pose).collect();
        for (parameter, &by) in self.parameters.iter().zip(values) {
            match parameter {
                Parameter::X(sweep) => poses[*sweep].x_m += by,
                Parameter::Y(sweep) => poses[*sweep].y_m += by,
                Parameter::Heading(sweep) => {
                    poses[*sweep].heading_deg = wrap_180(poses[*sweep].heading_deg + by);
                }
                _ => {}
            }
        }
        poses
    }

    /// Precision of a parameter's prior.
    pub(super) fn precision(&self, at: usize) -> f64 {
        self.options.priors[at].sigma.powi(-2)
    }

    /// Standard deviations of the priors.
    pub(super) fn prior_sigmas(&self) -> DVector<f64> {
        let priors = &self.options.priors;
        DVector::from_iterator(priors.len(), priors.iter().map(|prior| prior.sigma))
    }

    /// Log-density of the prior, up to a constant.
    pub(super) fn log_prior(&self, values: &DVector<f64>) -> f64 {
        let of = |(at, value): (usize, &f64)| -0.5 * self.precision(at) * value * value;
        values.iter().enumerate().map(of).sum()
    }

    /// Covariance of the Laplace approximation: inverse of the readings' information plus that of
    /// the priors.
    ///
    /// # Errors
    /// [`FitError::Degenerate`] for a singular information matrix.
    pub(super) fn covariance(
        &self,
        mut information: DMatrix<f64>,
    ) -> Result<DMatrix<f64>, FitError> {
        for at in 0..self.parameters.len() {
            information[(at, at)] += self.precision(at);
        }
        Ok(Cholesky::new(information).ok_or(FitError::Degenerate)?.inverse())
    }

    /// Values clamped to the bounds of their parameters.
    pub(super) fn limited(&self, mut values: DVector<f64>) -> DVector<f64> {
        for (value, parameter) in values.iter_mut().zip(&self.parameters) {
            let (min, max) = self.start.limits(parameter);
            *value = value.clamp(min, max);
        }
        values
    }

    /// Bounds on the change of a parameter from a value.
    pub(super) fn limits_of_change(&self, values: &DVector<f64>, at: usize) -> (f64, f64) {
        let (min, max) = self.start.limits(self.parameters[at]);
        (min - values[at], max - values[at])
    }

    /// Error model at the start of the continuation.
    pub(super) fn rough_errors(&self) -> ErrorModel {
        let World { options, sensor, .. } = self.start;
        let reach_m = options.max_range_m.unwrap_or(sensor.max_range_m);
        let errors =
            ErrorModel::rough(self.options.initial_sigma_m, continuation::STAGES[0].1, reach_m);
        if self.options.search == Search::Furnished { errors } else { errors.without_arcs() }
    }

    /// Minimum standard deviation of ranges, metres; at least that of their quantization.
    pub(super) fn min_sigma_m(&self) -> f64 {
        self.options.min_sigma_m.max(self.start.sensor.range_step_m / 12f64.sqrt())
    }

    /// Range error in wavelengths.
    pub(super) fn range_error_wavelengths(&self, errors: &ErrorModel) -> f64 {
        errors.sigma_m * self.start.sensor.frequency_hz / self.start.air.sound_speed_m_s()
    }

    /// Returns `true` if ranges are too uncertain for phases, as in a room measured with a tape.
    pub(super) fn is_beyond_phases(&self, errors: &ErrorModel) -> bool {
        self.range_error_wavelengths(errors) > MAX_PHASE_ERROR
    }

    /// Returns `true` if a single sweep with few echoes is fitted, which fits many poses.
    pub(super) fn has_few_echoes(&self) -> bool {
        let is_quick = self.options.search == Search::Quick;
        matches!(self.sweeps, [sweep] if sweep.has_few_echoes()) && !is_quick
    }
}

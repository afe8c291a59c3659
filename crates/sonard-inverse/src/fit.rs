//! Maximum a posteriori estimation of parameters, with uncertainties.

mod checkpoint;
mod continuation;
mod lm_step;
mod local;
mod multistart;
mod perturbation;
mod profile;
mod refine;
mod scale;

use std::{rc::Rc, slice};

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};
use sonard_model::geometry::{Pose, wrap_180};
use thiserror::Error;

use crate::{
    candidates::Phases,
    jacobian::JacobianBuilder,
    likelihood::ErrorModel,
    linear::LinearizedModel,
    parameter::Parameter,
    progress::{FitObserver, NoObserver},
    sweep::FitSweep,
    world::{SimulatorSet, World, WorldError},
};
pub use checkpoint::SearchResult;
pub use local::fit_from;
pub(crate) use local::{RoughFit, approach, fit_near};

/// Parameter to fit, with its prior.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Parameter to be fitted.
    pub parameter: Parameter,
    /// Prior standard deviation about the initial value, in the parameter's unit.
    pub sigma: f64,
}

/// Settings of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitOptions {
    /// Parameters with their priors.
    pub priors: Vec<Prior>,
    /// Initial standard deviation of ranges, metres: the maximum error of predictions.
    pub initial_sigma_m: f64,
    /// Maximum initial error of headings, degrees.
    pub max_turn_deg: f64,
    /// Minimum standard deviation of ranges, metres.
    pub min_sigma_m: f64,
    /// Minimum standard deviation of the threshold, decibels.
    pub min_sigma_db: f64,
    /// Search effort and outlier model.
    pub search: Search,
}

/// Search effort, and outlier model. A quick search of simulated sweeps ends in a less likely
/// optimum in one case of ten. Outlier arcs are not the default: they explain too much where the
/// model errs by centimetres on a wall, or where the edge of a beam is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Search {
    /// Few restarts near the optimum: four to ten times as fast
    Quick,
    /// Many restarts, each refined
    #[default]
    Thorough,
    /// Many restarts, with objects missing in the scene that return or hide many beams in a row
    Furnished,
}

/// Estimate of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterEstimate {
    /// Change of the parameter from its initial value, in its unit.
    pub change: f64,
    /// Standard deviation, including other optima that explain the readings nearly as well.
    pub sigma: f64,
    /// Whether the readings constrain the parameter to less than half its prior standard deviation.
    pub identified: bool,
}

/// Result of a fit.
#[derive(Debug, Clone)]
pub struct FitResult {
    /// Estimates in the order of the parameters.
    pub estimates: Vec<ParameterEstimate>,
    /// Covariance of the changes about this optimum alone, in the order of the parameters.
    pub covariance: DMatrix<f64>,
    /// World with all changes applied.
    pub world: World,
    /// Poses of the sweeps.
    pub poses: Vec<Pose>,
    /// Error model at the optimum.
    pub errors: ErrorModel,
    /// Log-likelihood of all readings.
    pub log_likelihood: f64,
    /// Number of readings in the fit.
    pub readings: usize,
    /// Log-likelihood plus log-prior at the optimum.
    pub log_posterior: f64,
}

/// Failure of a fit.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FitError {
    /// Invalid world or pose.
    #[error(transparent)]
    World(#[from] WorldError),
    /// No parameters or no sweeps.
    #[error("there is no parameter to fit, or no sweep to fit it to")]
    Nothing,
    /// Singular information matrix: some parameters are unconstrained.
    #[error("the readings don't constrain the parameters: the information matrix is singular")]
    Degenerate,
    /// Cancelled by the observer.
    #[error("stopped on request")]
    Stopped,
    /// Checkpoint of a different fit.
    #[error("the saved progress belongs to another fit")]
    OtherFit,
}

impl FitError {
    /// Returns `true` if the error ends the whole fit, not only one start among several.
    pub(crate) const fn ends_all(&self) -> bool {
        matches!(self, Self::Stopped | Self::OtherFit)
    }
}

/// Ignores failures of one start among several.
///
/// # Errors
/// Errors that end the whole fit.
pub(crate) fn one_of_many<T>(result: Result<T, FitError>) -> Result<Option<T>, FitError> {
    match result {
        Ok(found) => Ok(Some(found)),
        Err(error) if error.ends_all() => Err(error),
        Err(_) => Ok(None),
    }
}

/// State of a running fit.
struct Fitter<'a> {
    fit: &'a FitOptions,
    watch: &'a dyn FitObserver,
    /// Recorded results of the next searches, when resumed.
    known: slice::Iter<'a, SearchResult>,
    start: &'a World,
    sweeps: &'a [FitSweep],
    parameters: Vec<&'a Parameter>,
    /// Changes since the start.
    values: DVector<f64>,
    /// Simulators of the current world, with the transducer on the axis.
    models: SimulatorSet,
    phases: Phases,
    /// Whether predictions use the actual transducer position instead of the axis.
    is_exact: bool,
    /// Linear combination of the parameters held constant by steps.
    held: Option<DVector<f64>>,
    /// Most recent linearization and its point.
    last: Option<(DVector<f64>, Phases, Rc<LinearizedModel>)>,
}

/// Optimum of a fit, with known or unknown phases.
struct Optimum {
    /// Log-posterior.
    value: f64,
    /// Changes since the start.
    values: DVector<f64>,
    errors: ErrorModel,
    phases: Phases,
}

/// Standard deviation of a threshold that is not fitted, decibels.
const NOT_FITTED_DB: f64 = 0.5;

/// Fits parameters to sweeps, from an initial world.
///
/// Maximizes the posterior by Levenberg-Marquardt steps on a linearization of all candidate
/// readings, with new predictions after each set of steps. The error model is annealed from
/// `widest_m` to the observed scatter. Arrivals first add by power, because a pose error of a tenth
/// of a wavelength changes the phases; at the end coherently, if that is likelier.
///
/// # Errors
/// Invalid world, or readings that don't constrain the parameters.
pub fn fit(world: &World, sweeps: &[FitSweep], fit: &FitOptions) -> Result<FitResult, FitError> {
    fit_observed(world, sweeps, fit, &[], &NoObserver)
}

/// Fits like [`fit`], reports progress and intermediate results to `watch`, and resumes from
/// `known`: the results of an earlier, stopped run of the same fit, in order.
///
/// # Errors
/// As [`fit`]; [`FitError::Stopped`] if cancelled, [`FitError::OtherFit`] if `known` does not
/// match.
pub fn fit_observed(
    world: &World,
    sweeps: &[FitSweep],
    fit: &FitOptions,
    known: &[SearchResult],
    watch: &dyn FitObserver,
) -> Result<FitResult, FitError> {
    let models = SimulatorSet::new(&world.with_face_on_axis())?;
    let mut fitter = Fitter::new(models, world, sweeps, fit, watch)?;
    fitter.known = known.iter();
    let (best, beside) = fitter.likeliest()?;
    fitter.end(best, &beside)
}

/// Cramer-Rao bounds on the standard deviations of unbiased estimates, including the priors.
/// `world` and the sweeps' poses are the truth, and readings scatter as given by `errors`.
///
/// # Errors
/// As [`fit`].
pub fn cramer_rao_bound(
    world: &World,
    sweeps: &[FitSweep],
    fit: &FitOptions,
    errors: &ErrorModel,
) -> Result<Vec<f64>, FitError> {
    let models = SimulatorSet::new(&world.with_face_on_axis())?;
    let mut fitter = Fitter::new(models, world, sweeps, fit, &NoObserver)?;
    fitter.phases = Phases::Known;
    fitter.be_exact();
    let curve = fitter.linear()?.curve(&fitter.still(), errors);
    let covariance = fitter.covariance(curve.information).ok_or(FitError::Degenerate)?;
    Ok((0..fit.priors.len()).map(|at| covariance[(at, at)].sqrt()).collect())
}

impl<'a> Fitter<'a> {
    fn new(
        models: SimulatorSet,
        start: &'a World,
        sweeps: &'a [FitSweep],
        fit: &'a FitOptions,
        watch: &'a dyn FitObserver,
    ) -> Result<Self, FitError> {
        if fit.priors.is_empty() || sweeps.is_empty() {
            return Err(FitError::Nothing);
        }
        let parameters = fit.priors.iter().map(|prior| &prior.parameter).collect();
        let values = DVector::zeros(fit.priors.len());
        Ok(Self {
            fit,
            watch,
            known: [].iter(),
            start,
            sweeps,
            parameters,
            values,
            models,
            phases: Phases::Unknown,
            is_exact: false,
            held: None,
            last: None,
        })
    }

    fn rough_errors(&self) -> ErrorModel {
        let World { options, sensor, .. } = self.start;
        let reach_m = options.max_range_m.unwrap_or(sensor.max_range_m);
        let errors =
            ErrorModel::rough(self.fit.initial_sigma_m, continuation::STAGES[0].1, reach_m);
        if self.fit.search == Search::Furnished { errors } else { errors.without_arcs() }
    }

    /// Minimum standard deviation of ranges, metres; at least that of their quantization.
    fn least_sigma_m(&self) -> f64 {
        self.fit.min_sigma_m.max(self.start.sensor.range_step_m / 12f64.sqrt())
    }

    fn covariance(&self, mut information: DMatrix<f64>) -> Option<DMatrix<f64>> {
        for at in 0..self.parameters.len() {
            information[(at, at)] += self.precision(at);
        }
        Some(Cholesky::new(information)?.inverse())
    }

    fn still(&self) -> DVector<f64> {
        DVector::zeros(self.parameters.len())
    }

    fn changes(&self, values: &DVector<f64>) -> Vec<(&Parameter, f64)> {
        self.parameters.iter().copied().zip(values.iter().copied()).collect()
    }

    fn poses(&self) -> Vec<Pose> {
        let mut poses: Vec<Pose> = self.sweeps.iter().map(|sweep| sweep.pose).collect();
        for (parameter, &by) in self.parameters.iter().zip(&self.values) {
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

    fn world(&self) -> Result<World, WorldError> {
        self.start.changed(&self.changes(&self.values))
    }

    /// Linearization at the current values, with the transducer on the axis unless exact.
    fn linear(&mut self) -> Result<Rc<LinearizedModel>, FitError> {
        if let Some((values, phases, linear)) = &self.last
            && (values, *phases) == (&self.values, self.phases)
        {
            return Ok(Rc::clone(linear));
        }
        let world = self.moved_world()?;
        let linear = if self.is_exact {
            self.about(&self.models.changed_to(&world)?, &world)?
        } else {
            self.about(&self.models, &world)?
        };
        let linear = Rc::new(linear);
        self.last = Some((self.values.clone(), self.phases, Rc::clone(&linear)));
        Ok(linear)
    }

    /// Switches to predictions with the actual transducer position.
    fn be_exact(&mut self) {
        (self.is_exact, self.last) = (true, None);
    }

    fn about(&self, models: &SimulatorSet, world: &World) -> Result<LinearizedModel, FitError> {
        let reference_m_s = self.start.air.sound_speed_m_s();
        let rates = JacobianBuilder::new(world, &self.parameters, reference_m_s, self.phases);
        Ok(LinearizedModel::about(models, &rates, self.sweeps, &self.poses())?)
    }

    /// World at the current values, with updated simulators; called before each prediction.
    fn moved_world(&mut self) -> Result<World, FitError> {
        if self.watch.is_cancelled() {
            return Err(FitError::Stopped);
        }
        let world = self.world()?;
        self.models = self.models.changed_to(&world.with_face_on_axis())?;
        Ok(world)
    }

    fn precision(&self, at: usize) -> f64 {
        self.fit.priors[at].sigma.powi(-2)
    }

    fn log_prior(&self, values: &DVector<f64>) -> f64 {
        let of = |(at, value): (usize, &f64)| -0.5 * self.precision(at) * value * value;
        values.iter().enumerate().map(of).sum()
    }

    /// Result at an optimum; other optima add `beside` to the variances.
    fn end(mut self, best: Optimum, beside: &DVector<f64>) -> Result<FitResult, FitError> {
        let Optimum { values, phases, errors, .. } = self.exactly(best)?;
        (self.values, self.phases) = (values, phases);
        let linear = self.linear()?;
        let curve = linear.curve(&self.still(), &errors.for_information());
        let mut covariance =
            self.covariance(curve.information.clone()).ok_or(FitError::Degenerate)?;
        let log_likelihood = linear.log_likelihood(&self.still(), &errors);
        // Ranges depend on the threshold by time walk; if not in the Jacobian, its uncertainty is
        // added.
        let threshold = self.parameters.iter().position(|of| **of == Parameter::Threshold);
        let is_in_rates = threshold.is_some() && linear.is_walk_believed(&errors);
        if !is_in_rates {
            let sigma_db = threshold.map_or(NOT_FITTED_DB, |at| covariance[(at, at)].sqrt());
            let moved = &covariance * &curve.walk * sigma_db;
            covariance += &moved * moved.transpose();
        }
        let estimates = self.values.iter().enumerate().map(|(at, &change)| {
            let sigma = (covariance[(at, at)] + beside[at]).max(0.0).sqrt();
            ParameterEstimate { change, sigma, identified: sigma < 0.5 * self.fit.priors[at].sigma }
        });
        Ok(FitResult {
            estimates: estimates.collect(),
            covariance,
            world: self.world()?,
            poses: self.poses(),
            errors,
            log_likelihood,
            readings: linear.len(),
            log_posterior: log_likelihood + self.log_prior(&self.values),
        })
    }
}

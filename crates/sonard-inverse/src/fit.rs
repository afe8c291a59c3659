//! Maximum a posteriori estimation of parameters, with uncertainties.

mod checkpoint;
mod continuation;
mod lm_step;
mod local;
mod multistart;
mod perturbation;
mod problem;
mod profile;
mod refine;
mod scale;
#[cfg(test)]
mod tests;

use std::{cell::RefCell, rc::Rc, slice};

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use sonard_model::geometry::Pose;
use thiserror::Error;

use crate::{
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
use problem::{Point, Problem};

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

/// Evaluation of a problem's posterior, whose stages each map values to values.
struct Fitter<'a> {
    problem: Problem<'a>,
    observer: &'a dyn FitObserver,
    /// Recorded results of the next searches, when resumed.
    recorded: RefCell<slice::Iter<'a, SearchResult>>,
    /// Simulators of the last world, with the transducer on the axis: those that the next one does
    /// not change are reused.
    simulators: RefCell<SimulatorSet>,
    /// Most recent linearization and its point.
    last: RefCell<Option<(Point, Rc<LinearizedModel>)>>,
}

/// Optimum of a fit, with known or unknown phases.
struct Optimum {
    /// Log-posterior.
    value: f64,
    point: Point,
    errors: ErrorModel,
}

/// Standard deviation of a threshold that is not fitted, decibels.
const NOT_FITTED_DB: f64 = 0.5;

/// Fits parameters to sweeps, from an initial world.
///
/// Maximizes the posterior by Levenberg-Marquardt steps on a linearization of all candidate
/// readings, with new predictions after each set of steps. The error model is annealed from
/// `initial_sigma_m` to the observed scatter. Arrivals first add by power, because a pose error of a tenth
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
    let simulators = SimulatorSet::new(&world.with_face_on_axis())?;
    let problem = Problem::new(world, sweeps, fit)?;
    let fitter = Fitter::new(problem, simulators, watch).resume(known);
    let (best, other_variances) = fitter.find_optimum()?;
    fitter.report(best, &other_variances)
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
    let simulators = SimulatorSet::new(&world.with_face_on_axis())?;
    let fitter = Fitter::new(Problem::new(world, sweeps, fit)?, simulators, &NoObserver);
    let point = Point { is_exact: true, ..Point::coherent(fitter.problem.zero()) };
    let curve = fitter.linearize(&point)?.curve(&fitter.problem.zero(), errors);
    let covariance = fitter.problem.covariance(curve.information)?;
    Ok((0..fit.priors.len()).map(|at| covariance[(at, at)].sqrt()).collect())
}

impl<'a> Fitter<'a> {
    fn new(problem: Problem<'a>, simulators: SimulatorSet, observer: &'a dyn FitObserver) -> Self {
        Self {
            problem,
            observer,
            recorded: RefCell::new([].iter()),
            simulators: RefCell::new(simulators),
            last: RefCell::new(None),
        }
    }

    /// Replays recorded results before new searches.
    fn resume(self, recorded: &'a [SearchResult]) -> Self {
        Self { recorded: RefCell::new(recorded.iter()), ..self }
    }

    /// Linearization of all candidate readings about a point.
    ///
    /// # Errors
    /// Invalid world, or cancelled.
    fn linearize(&self, point: &Point) -> Result<Rc<LinearizedModel>, FitError> {
        if let Some((at, linear)) = &*self.last.borrow()
            && at == point
        {
            return Ok(Rc::clone(linear));
        }
        let world = self.move_world(&point.values)?;
        let linear = if point.is_exact {
            let simulators = self.simulators.borrow().changed_to(&world)?;
            self.linearize_with(&simulators, &world, point)?
        } else {
            self.linearize_with(&self.simulators.borrow(), &world, point)?
        };
        let linear = Rc::new(linear);
        self.last.replace(Some((point.clone(), Rc::clone(&linear))));
        Ok(linear)
    }

    fn linearize_with(
        &self,
        simulators: &SimulatorSet,
        world: &World,
        point: &Point,
    ) -> Result<LinearizedModel, FitError> {
        let Problem { start, parameters, sweeps, .. } = &self.problem;
        let reference_m_s = start.air.sound_speed_m_s();
        let jacobian = JacobianBuilder::new(world, parameters, reference_m_s, point.phases);
        let poses = self.problem.poses(&point.values);
        Ok(LinearizedModel::about(simulators, &jacobian, sweeps, &poses)?)
    }

    /// World with the parameters changed, for which the simulators are updated.
    ///
    /// # Errors
    /// Invalid world, or cancelled.
    fn move_world(&self, values: &DVector<f64>) -> Result<World, FitError> {
        if self.observer.is_cancelled() {
            return Err(FitError::Stopped);
        }
        let world = self.problem.world(values)?;
        let simulators = self.simulators.borrow().changed_to(&world.with_face_on_axis())?;
        self.simulators.replace(simulators);
        Ok(world)
    }

    /// Log-posterior at the point of a linearization.
    fn log_posterior(&self, linear: &LinearizedModel, point: &Point, errors: &ErrorModel) -> f64 {
        linear.log_likelihood(&self.problem.zero(), errors) + self.problem.log_prior(&point.values)
    }

    /// Result at an optimum, by the Laplace approximation; other optima add `other_variances`.
    fn report(&self, best: Optimum, other_variances: &DVector<f64>) -> Result<FitResult, FitError> {
        let Optimum { point, errors, .. } = self.predict_exactly(best)?;
        let (problem, zero) = (&self.problem, self.problem.zero());
        let linear = self.linearize(&point)?;
        let curve = linear.curve(&zero, &errors.for_information());
        let mut covariance = problem.covariance(curve.information.clone())?;
        let log_likelihood = linear.log_likelihood(&zero, &errors);
        // Ranges depend on the threshold by time walk; if not in the Jacobian, its uncertainty is
        // added.
        let threshold = problem.index_of(&Parameter::Threshold);
        let is_in_jacobian = threshold.is_some() && linear.is_walk_believed(&errors);
        if !is_in_jacobian {
            let sigma_db = threshold.map_or(NOT_FITTED_DB, |at| covariance[(at, at)].sqrt());
            let moved = &covariance * &curve.walk * sigma_db;
            covariance += &moved * moved.transpose();
        }
        let estimates = point.values.iter().enumerate().map(|(at, &change)| {
            let sigma = (covariance[(at, at)] + other_variances[at]).max(0.0).sqrt();
            let identified = sigma < 0.5 * problem.options.priors[at].sigma;
            ParameterEstimate { change, sigma, identified }
        });
        Ok(FitResult {
            estimates: estimates.collect(),
            covariance,
            world: problem.world(&point.values)?,
            poses: problem.poses(&point.values),
            errors,
            log_likelihood,
            readings: linear.len(),
            log_posterior: log_likelihood + problem.log_prior(&point.values),
        })
    }
}

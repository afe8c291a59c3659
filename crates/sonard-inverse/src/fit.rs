//! The most likely values of parameters, and how sure they are.

mod elsewhere;
mod journal;
mod polish;
mod restart;
mod ridge;
mod settle;
mod shorter;
mod spread;
mod step;

use std::{rc::Rc, slice};

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};
use sonard_model::geometry::{Pose, wrap_180};
use thiserror::Error;

use crate::{
    candidates::Phases,
    likelihood::ErrorModel,
    linear::Linear,
    parameter::Parameter,
    rates::RateFinder,
    sweep::Sweep,
    watch::{Unwatched, Watch},
    world::{Models, World, WorldError},
};
pub use journal::Found;
pub use shorter::fit_from;
pub(crate) use shorter::{Approached, approach, fit_near};

/// A parameter to fit, with its prior.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Which.
    pub parameter: Parameter,
    /// Standard deviation of what is believed, about the value that is started from; in its unit.
    pub sigma: f64,
}

/// What to fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Parameters with their priors.
    pub priors: Vec<Prior>,
    /// Spread of ranges to begin with, metres: as far off as predictions may be.
    pub widest_m: f64,
    /// As far off as headings may be, degrees.
    pub widest_turn_deg: f64,
    /// Least spread of ranges that is believed, metres.
    pub least_sigma_m: f64,
    /// Least spread of the threshold that is believed, decibels.
    pub least_sigma_db: f64,
    /// How much is searched.
    pub search: Search,
}

/// How much is searched, and for what. A quick search of simulated sweeps ends somewhere less likely in one case of ten. Things
/// that the scene lacks are no default, because they explain too much where the model misses by centimetres what one wall answers,
/// or where a beam's edge is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Search {
    /// A few places beside the likeliest one: four to ten times as fast
    Quick,
    /// Many places, and each to its end
    #[default]
    Thorough,
    /// As thoroughly, and things that the scene lacks may answer or hide many beams in a row
    Furnished,
}

/// A value found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// What the parameter is to be changed by, in its unit.
    pub change: f64,
    /// Standard deviation of it, with other values that explain the readings nearly as well.
    pub sigma: f64,
    /// Whether the readings say more about it than was believed beforehand.
    pub identified: bool,
}

/// What came of a fit.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// In the order of the parameters.
    pub estimates: Vec<Estimate>,
    /// Covariance of the changes, in their order, about this explanation of the readings alone.
    pub covariance: DMatrix<f64>,
    /// The world with all changes made.
    pub world: World,
    /// The poses of the sweeps.
    pub poses: Vec<Pose>,
    /// How readings spread about it.
    pub errors: ErrorModel,
    /// Log-likelihood of all readings, and how many there are.
    pub log_likelihood: f64,
    /// How many readings there are.
    pub readings: usize,
    /// Log-likelihood with the priors.
    pub log_posterior: f64,
}

/// Why a fit failed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FitError {
    /// There is nothing to predict with.
    #[error(transparent)]
    World(#[from] WorldError),
    /// Nothing to fit.
    #[error("there is no parameter to fit, or no sweep to fit it to")]
    Nothing,
    /// The numbers don't hold.
    #[error("the readings don't hold the parameters: their information can't be inverted")]
    Degenerate,
    /// Whoever watches it wants it no longer.
    #[error("stopped on request")]
    Stopped,
    /// What was given as known is of another fit.
    #[error("what is known of this fit was found by another one")]
    OtherFit,
}

impl FitError {
    /// Whether it is about all that is searched, and not only about one beginning among others.
    pub(crate) const fn ends_all(&self) -> bool {
        matches!(self, Self::Stopped | Self::OtherFit)
    }
}

/// What came of one beginning among others, which may have come to nothing.
///
/// # Errors
/// What is about all of them.
pub(crate) fn one_of_many<T>(result: Result<T, FitError>) -> Result<Option<T>, FitError> {
    match result {
        Ok(found) => Ok(Some(found)),
        Err(error) if error.ends_all() => Err(error),
        Err(_) => Ok(None),
    }
}

/// Where a fit stands.
struct State<'a> {
    fit: &'a Fit,
    watch: &'a dyn Watch,
    /// What the next searches came to, if it goes on from there.
    known: slice::Iter<'a, Found>,
    start: &'a World,
    sweeps: &'a [Sweep],
    parameters: Vec<&'a Parameter>,
    /// Changes since the start.
    values: DVector<f64>,
    /// Of the world as it was last asked for, with the transducer on the axis.
    models: Models,
    phases: Phases,
    /// Whether predictions are made with the transducer where it is, and not on the axis.
    is_exact: bool,
    /// A combination of the parameters that steps leave as it is.
    held: Option<DVector<f64>>,
    /// The predictions that were made last, and where.
    last: Option<(DVector<f64>, Phases, Rc<Linear>)>,
}

/// Where a fit is likeliest, by predictions with phases that are known or not.
struct Settled {
    /// Log-likelihood of all readings with the priors.
    value: f64,
    /// Changes since the start.
    values: DVector<f64>,
    errors: ErrorModel,
    phases: Phases,
}

/// Doubt of a threshold that is not fitted, decibels.
const NOT_FITTED_DB: f64 = 0.5;

/// Fits parameters to sweeps, from a world that is believed.
///
/// Maximises the likelihood of all readings times the priors: Levenberg's and Marquardt's steps on a linearisation of
/// all that each reading could have been, and new predictions after each set of them, with spreads that shrink from
/// `widest_m` to what the readings have. On the way arrivals add up by their powers, because a pose that is a tenth of
/// a wavelength off has other phases; at the end with their phases, if readings are likelier so.
///
/// # Errors
/// When the world can't be predicted in, or the readings don't hold the parameters.
pub fn fit(world: &World, sweeps: &[Sweep], fit: &Fit) -> Result<Fitted, FitError> {
    fit_watched(world, sweeps, fit, &[], &Unwatched)
}

/// The same, and tells `watch` how far it has come and what it found. Goes on from what is `known`: what the same fit
/// found when it was stopped, in that order.
///
/// # Errors
/// As [`fit`]; [`FitError::Stopped`] if `watch` wants it, [`FitError::OtherFit`] if what is known does not go with it.
pub fn fit_watched(
    world: &World,
    sweeps: &[Sweep],
    fit: &Fit,
    known: &[Found],
    watch: &dyn Watch,
) -> Result<Fitted, FitError> {
    let models = Models::of(&world.with_face_on_axis())?;
    let mut state = State::new(models, world, sweeps, fit, watch)?;
    state.known = known.iter();
    let (best, beside) = state.likeliest()?;
    state.end(best, &beside)
}

/// Standard deviations that no unbiased estimate from such readings can fall below (Cramer and Rao), where `world` and
/// the sweeps' poses are the truth and readings spread as `errors` says; with what is known beforehand.
///
/// # Errors
/// As [`fit`].
pub fn bound(
    world: &World,
    sweeps: &[Sweep],
    fit: &Fit,
    errors: &ErrorModel,
) -> Result<Vec<f64>, FitError> {
    let models = Models::of(&world.with_face_on_axis())?;
    let mut state = State::new(models, world, sweeps, fit, &Unwatched)?;
    state.phases = Phases::Known;
    state.be_exact();
    let curve = state.linear()?.curve(&state.still(), errors);
    let covariance = state.covariance(curve.information).ok_or(FitError::Degenerate)?;
    Ok((0..fit.priors.len()).map(|at| covariance[(at, at)].sqrt()).collect())
}

impl<'a> State<'a> {
    fn new(
        models: Models,
        start: &'a World,
        sweeps: &'a [Sweep],
        fit: &'a Fit,
        watch: &'a dyn Watch,
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
        let errors = ErrorModel::rough(self.fit.widest_m, settle::STAGES[0].1, reach_m);
        if self.fit.search == Search::Furnished { errors } else { errors.without_arcs() }
    }

    /// Least spread of ranges that is believed, metres: that of steps in which they are told is theirs at least.
    fn least_sigma_m(&self) -> f64 {
        self.fit.least_sigma_m.max(self.start.sensor.range_step_m / 12f64.sqrt())
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

    /// Predictions where it stands, with the transducer on the axis unless exact ones are wanted.
    fn linear(&mut self) -> Result<Rc<Linear>, FitError> {
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

    /// Has predictions made with the transducer where it is from here on.
    fn be_exact(&mut self) {
        (self.is_exact, self.last) = (true, None);
    }

    fn about(&self, models: &Models, world: &World) -> Result<Linear, FitError> {
        let reference_m_s = self.start.air.sound_speed_m_s();
        let rates = RateFinder::new(world, &self.parameters, reference_m_s, self.phases);
        Ok(Linear::about(models, &rates, self.sweeps, &self.poses())?)
    }

    /// The world where it stands, with its models; before each prediction.
    fn moved_world(&mut self) -> Result<World, FitError> {
        if self.watch.stops() {
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

    /// What came of it, where it settled; other places add so much to the variances.
    fn end(mut self, best: Settled, beside: &DVector<f64>) -> Result<Fitted, FitError> {
        let Settled { values, phases, errors, .. } = self.exactly(best)?;
        (self.values, self.phases) = (values, phases);
        let linear = self.linear()?;
        let curve = linear.curve(&self.still(), &errors.for_information());
        let mut covariance =
            self.covariance(curve.information.clone()).ok_or(FitError::Degenerate)?;
        let log_likelihood = linear.log_likelihood(&self.still(), &errors);
        // Ranges depend on the threshold, too, by their time walk; where no rate says so its doubt comes on top.
        let threshold = self.parameters.iter().position(|of| **of == Parameter::Threshold);
        let is_in_rates = threshold.is_some() && linear.is_walk_believed(&errors);
        if !is_in_rates {
            let sigma_db = threshold.map_or(NOT_FITTED_DB, |at| covariance[(at, at)].sqrt());
            let moved = &covariance * &curve.walk * sigma_db;
            covariance += &moved * moved.transpose();
        }
        let estimates = self.values.iter().enumerate().map(|(at, &change)| {
            let sigma = (covariance[(at, at)] + beside[at]).max(0.0).sqrt();
            Estimate { change, sigma, identified: sigma < 0.5 * self.fit.priors[at].sigma }
        });
        Ok(Fitted {
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

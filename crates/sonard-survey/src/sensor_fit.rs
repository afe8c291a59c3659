//! Sensor and air, fitted together with plan and poses.

use std::hash::{DefaultHasher, Hash, Hasher};

use nalgebra::{DMatrix, DVector};
use sonard_inverse::{
    Parameter, ParameterEstimate, ParameterGroup, ParameterReport, Prior, World, calibrated_sensor,
    priors, strongly_correlated,
};

use crate::{
    error::SurveyError,
    normal::NormalEquations,
    options::SurveyOptions,
    result::{FittedNumber, MATERIAL, SensorFit},
    room::empty_scene_of,
};

/// Groups of numbers that a survey can fit. Poses, walls and posts are always estimated; a common
/// turn of all azimuths is a turn of the frame.
static GROUPS: [ParameterGroup; 10] = [
    ParameterGroup::Threshold,
    ParameterGroup::Rise,
    ParameterGroup::Materials,
    ParameterGroup::Air,
    ParameterGroup::Delay,
    ParameterGroup::Beam,
    ParameterGroup::Skirts,
    ParameterGroup::Pulse,
    ParameterGroup::Mounting,
    ParameterGroup::Gear,
];
/// Number of the last groups that describe a stepper; positions and directions of an array's
/// transducers are given.
const OF_STEPPER: usize = 2;
/// Change, as a share of the prior standard deviation, up to which the plan is not searched again.
const SETTLED_SHARE: f64 = 0.02;

/// Numbers of sensor and air that are free in an estimate, as changes of a world.
#[derive(Debug, Clone)]
pub(crate) struct FreeNumbers {
    priors: Vec<Prior>,
    /// Change of the search's world from the initial one, in each number's unit.
    base: DVector<f64>,
    /// Change from the search's world.
    pub(crate) values: DVector<f64>,
}

impl FreeNumbers {
    /// No free number.
    pub(crate) fn none() -> Self {
        Self { priors: Vec::new(), base: DVector::zeros(0), values: DVector::zeros(0) }
    }

    /// Number of free numbers.
    pub(crate) fn count(&self) -> usize {
        self.priors.len()
    }

    /// Free numbers as parameters.
    pub(crate) fn parameters(&self) -> impl Iterator<Item = Parameter> + '_ {
        self.priors.iter().map(|prior| prior.parameter.clone())
    }

    /// World with the numbers changed.
    pub(crate) fn changed(&self, world: &World) -> Option<World> {
        world.changed(&changes(&self.priors, &self.values)).ok()
    }

    /// Numbers after a step, within their limits in a world.
    pub(crate) fn moved(&self, step: &[f64], world: &World) -> Self {
        let mut moved = self.clone();
        for ((value, by), prior) in moved.values.iter_mut().zip(step).zip(&self.priors) {
            let (min, max) = world.limits(&prior.parameter);
            *value = (*value + by).clamp(min, max);
        }
        moved
    }

    /// Adds the priors to normal equations from a column on; returns the loss, nats.
    pub(crate) fn add_priors(&self, normal: &mut NormalEquations, first: usize) -> f64 {
        /// Priors are not robust.
        const NORMAL: f64 = 1e3;
        let before = normal.loss();
        for (at, prior) in self.priors.iter().enumerate() {
            let off = self.base[at] + self.values[at];
            normal.add(&[(first + at, 1.0)], -off, prior.sigma, NORMAL);
        }
        normal.loss() - before
    }
}

fn changes<'a>(priors: &'a [Prior], values: &DVector<f64>) -> Vec<(&'a Parameter, f64)> {
    priors.iter().map(|prior| &prior.parameter).zip(values.iter().copied()).collect()
}

/// Fit of sensor and air over the rounds of a survey.
pub(crate) struct SensorFitter {
    /// World of the caller with the material of the walls.
    initial: World,
    priors: Vec<Prior>,
    /// Change of the current world from the initial one.
    total: DVector<f64>,
    covariance: Option<DMatrix<f64>>,
}

impl SensorFitter {
    /// Fit of the groups of the options, at the values of a world, to sweeps of a stepper or rounds
    /// of an array.
    ///
    /// # Errors
    /// A group that a survey can't fit, or that does not apply to the sensor.
    pub(crate) fn new(
        world: &World,
        options: &SurveyOptions,
        is_array: bool,
    ) -> Result<Self, SurveyError> {
        let fittable = if is_array { &GROUPS[..GROUPS.len() - OF_STEPPER] } else { &GROUPS[..] };
        if let Some(group) = options.fit.iter().find(|group| !fittable.contains(group)) {
            return Err(SurveyError::NotFittable { group: *group, fittable });
        }
        let initial = empty_scene_of(world, options.reflectance);
        let priors = priors(&options.fit, &[], &initial, 0)?;
        let total = DVector::zeros(priors.len());
        Ok(Self { initial, priors, total, covariance: None })
    }

    /// Returns `true` without numbers to fit.
    pub(crate) fn is_empty(&self) -> bool {
        self.priors.is_empty()
    }

    /// World with the current estimates, and the reflectance of all surfaces in it.
    ///
    /// # Errors
    /// Air outside the valid ranges.
    pub(crate) fn world(&self) -> Result<(World, f64), SurveyError> {
        let world = self.initial.changed(&changes(&self.priors, &self.total))?;
        let reflectance = world.scene.materials.get(MATERIAL).map_or(1.0, |of| of.reflectance);
        Ok((world, reflectance))
    }

    /// Digest of the current estimates; scores of plans hold for one.
    pub(crate) fn digest(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.total.iter().for_each(|value| value.to_bits().hash(&mut hasher));
        hasher.finish()
    }

    /// Free numbers at the current estimates.
    pub(crate) fn numbers(&self) -> FreeNumbers {
        let base = self.total.clone();
        FreeNumbers { priors: self.priors.clone(), values: DVector::zeros(base.len()), base }
    }

    /// Takes over an estimate with its covariance; returns `true` if the world changed enough for
    /// another search.
    pub(crate) fn update(
        &mut self,
        numbers: &FreeNumbers,
        covariance: Option<DMatrix<f64>>,
    ) -> bool {
        let total = &numbers.base + &numbers.values;
        let by = &total - &self.total;
        let is_large = |(prior, by): (&Prior, &f64)| by.abs() > SETTLED_SHARE * prior.sigma;
        let changed = self.priors.iter().zip(&by).any(is_large);
        self.total = total;
        self.covariance = covariance;
        changed
    }

    /// Estimates with their intervals; `None` without numbers to fit.
    ///
    /// # Errors
    /// Air outside the valid ranges.
    pub(crate) fn report(&self) -> Result<Option<SensorFit>, SurveyError> {
        if self.is_empty() {
            return Ok(None);
        }
        let (world, _) = self.world()?;
        let by_prior = DMatrix::from_diagonal(&DVector::from_iterator(
            self.priors.len(),
            self.priors.iter().map(|prior| prior.sigma * prior.sigma),
        ));
        let covariance = self.covariance.as_ref().unwrap_or(&by_prior);
        let sigma = |at: usize| covariance[(at, at)].max(0.0).sqrt();
        let reports: Vec<ParameterReport> = self
            .priors
            .iter()
            .enumerate()
            .map(|(at, prior)| {
                let sigma = sigma(at);
                let identified = sigma < 0.5 * prior.sigma;
                let estimate = ParameterEstimate { change: self.total[at], sigma, identified };
                ParameterReport::new(&self.initial, &[], prior, &estimate)
            })
            .collect();
        let coupled = strongly_correlated(covariance);
        let coupled_with = |at: usize| {
            let is_coupled = |other: &usize| {
                let pair = [at.min(*other), at.max(*other)];
                coupled.iter().any(|&(column, row, _)| [column, row] == pair)
            };
            let others = (0..reports.len()).filter(is_coupled);
            others.map(|other| reports[other].name.clone()).collect()
        };
        let numbers = reports.iter().enumerate().map(|(at, of)| FittedNumber {
            name: of.name.clone(),
            value: of.value,
            sigma: of.sigma,
            interval: [of.low, of.high],
            assumed: of.prior,
            assumed_sigma: of.prior_sigma,
            is_determined: of.identified && !of.at_limit,
            coupled_with: coupled_with(at),
        });
        Ok(Some(SensorFit {
            numbers: numbers.collect(),
            sensor: calibrated_sensor(&world.sensor, &self.initial.sensor, "sonard survey"),
            sound_speed_m_s: world.air.sound_speed_m_s(),
            delay_m: world.delay_m,
        }))
    }
}

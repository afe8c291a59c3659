//! How likely readings are under one hypothesis, for samplers and optimisers of one's own.

use nalgebra::{DMatrix, DVector};
use sonard_model::geometry::Pose;

use crate::{
    candidates::Phases,
    likelihood::ErrorModel,
    linear::Linear,
    parameter::Parameter,
    rates::RateFinder,
    sweep::Sweep,
    world::{Models, World, WorldError},
};

/// A world that is asked how likely sweeps are from poses in it. What poses have in common (scene and beam pattern) is
/// prepared once.
///
/// Arrivals meet with the phases that the model tells. A transducer beside its axis has its paths found from the axis
/// and made longer to first order, as [`fit`](crate::fit) has them on its way.
pub struct Hypotheses {
    world: World,
    parameters: Vec<Parameter>,
    models: Models,
}

/// The log-likelihood of readings, and how it changes with the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct LogLikelihood {
    /// Of the readings.
    pub value: f64,
    /// Its derivative by each parameter.
    pub gradient: DVector<f64>,
    /// Fisher's information about the parameters.
    pub information: DMatrix<f64>,
}

impl Hypotheses {
    /// A world, and the parameters that derivatives are by. Those of single sweeps are of sweep 0.
    ///
    /// # Errors
    /// When sensor, air or options make no sense.
    pub fn new(world: World, parameters: Vec<Parameter>) -> Result<Self, WorldError> {
        let models = Models::of(&world.with_face_on_axis())?;
        Ok(Self { world, parameters, models })
    }

    /// How likely a sweep is from a pose, whatever pose it says itself.
    ///
    /// # Errors
    /// When there are more paths than can be found.
    pub fn log_likelihood(
        &self,
        sweep: &Sweep,
        pose: &Pose,
        errors: &ErrorModel,
    ) -> Result<LogLikelihood, WorldError> {
        let parameters: Vec<&Parameter> = self.parameters.iter().collect();
        let reference_m_s = self.world.air.sound_speed_m_s();
        let rates = RateFinder::new(&self.world, &parameters, reference_m_s, Phases::Known)
            .with_threshold_spread(errors.sigma_db);
        let linear = Linear::about(
            &self.models,
            &rates,
            std::slice::from_ref(sweep),
            std::slice::from_ref(pose),
        )?;
        let curve = linear.curve(&DVector::zeros(parameters.len()), errors);
        let (value, gradient, information) = (curve.value, curve.gradient, curve.information);
        Ok(LogLikelihood { value, gradient, information })
    }
}

//! Log-likelihood of readings under one hypothesis, for external samplers and optimizers.

use nalgebra::{DMatrix, DVector};
use sonard_model::geometry::Pose;

use crate::{
    candidates::Phases,
    jacobian::JacobianBuilder,
    likelihood::ErrorModel,
    linear::LinearizedModel,
    parameter::Parameter,
    sweep::FitSweep,
    world::{SimulatorSet, World, WorldError},
};

/// Evaluator of the log-likelihood of sweeps from poses in a world. Scene and beam pattern are
/// prepared once for all poses.
///
/// Arrivals add coherently. For a transducer off its axis, paths are found from the axis and
/// corrected to first order, as in the first stages of [`fit`](crate::fit).
pub struct Hypotheses {
    world: World,
    parameters: Vec<Parameter>,
    models: SimulatorSet,
}

/// Log-likelihood of readings with its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct LogLikelihood {
    /// Log-likelihood of the sweeps, nats.
    pub value: f64,
    /// Gradient with respect to the parameters.
    pub gradient: DVector<f64>,
    /// Fisher information matrix of the parameters.
    pub information: DMatrix<f64>,
}

impl Hypotheses {
    /// Evaluator for a world and the parameters of the derivatives. Sweep parameters refer to sweep
    /// 0.
    ///
    /// # Errors
    /// Invalid sensor, air or options.
    pub fn new(world: World, parameters: Vec<Parameter>) -> Result<Self, WorldError> {
        let models = SimulatorSet::new(&world.with_face_on_axis())?;
        Ok(Self { world, parameters, models })
    }

    /// Log-likelihood of a sweep from a pose; the pose of the sweep itself is ignored.
    ///
    /// # Errors
    /// More paths than can be found.
    pub fn log_likelihood(
        &self,
        sweep: &FitSweep,
        pose: &Pose,
        errors: &ErrorModel,
    ) -> Result<LogLikelihood, WorldError> {
        let parameters: Vec<&Parameter> = self.parameters.iter().collect();
        let reference_m_s = self.world.air.sound_speed_m_s();
        let rates = JacobianBuilder::new(&self.world, &parameters, reference_m_s, Phases::Known)
            .with_threshold_spread(errors.sigma_db);
        let linear = LinearizedModel::about(
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

//! Errors of a survey.

use sonard_inverse::WorldError;
use sonard_model::scene::SceneError;
use thiserror::Error;

/// Reason why no survey is possible.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SurveyError {
    /// Fewer sweeps than needed.
    #[error("too few sweeps ({0}): a survey needs at least 2, from different places")]
    TooFewSweeps(usize),
    /// No arc in a sweep, so that its pose is unknown.
    #[error("scan {0} has no arc of equal ranges, by which it could be located")]
    NoArcs(uuid::Uuid),
    /// Invalid sensor, air or options.
    #[error(transparent)]
    World(#[from] WorldError),
    /// Invalid scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Invalid assumption.
    #[error("{name} is {value}: it must be {expected}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Value of the option.
        value: f64,
        /// Valid range, in words.
        expected: &'static str,
    },
}

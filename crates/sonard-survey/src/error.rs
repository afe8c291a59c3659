//! Errors of a survey.

use sonard_inverse::{GroupError, ParameterGroup, WorldError};
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
    /// Group of numbers that does not apply to the sensor.
    #[error(transparent)]
    Group(#[from] GroupError),
    /// Group of numbers that a survey can't fit.
    #[error("{} can't be fitted by a survey: {}", group.name(), names(fittable))]
    NotFittable {
        /// Group that was requested.
        group: ParameterGroup,
        /// Groups that can be fitted.
        fittable: &'static [ParameterGroup],
    },
    /// Group of numbers to fit for an array.
    #[error("numbers of the ranger can't be fitted to rounds of an array")]
    FitOfArray,
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

/// Advice for a group that can't be fitted.
fn names(fittable: &[ParameterGroup]) -> String {
    let names: Vec<&str> = fittable.iter().map(|group| group.name()).collect();
    format!("it fits {}", names.join(", "))
}

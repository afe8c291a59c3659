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
    #[error("{} can't be fitted by a survey of these readings: {}", group.name(), names(fittable))]
    NotFittable {
        /// Group that was requested.
        group: ParameterGroup,
        /// Groups that can be fitted.
        fittable: &'static [ParameterGroup],
    },
    /// Scans of an array and of a ranger on a stepper together.
    #[error("scans of an array and of a ranger on a stepper can't be surveyed together")]
    MixedCourse,
    /// More rounds of an array than a survey takes: its time is proportional to their number.
    #[error("{rounds} rounds of the array: a survey takes {max} at most")]
    TooManyRounds {
        /// Rounds that were given.
        rounds: usize,
        /// Largest number of rounds.
        max: usize,
    },
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

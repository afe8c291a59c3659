//! Readings that a survey is made from.

use std::borrow::Cow;

use sonard_inverse::{ArrayFiring, ArrayRound, FitSweep};
use sonard_model::geometry::DVec2;

/// Readings of a course, in its order.
#[derive(Debug, Clone, Copy)]
pub enum SurveyInput<'a> {
    /// Sweeps of a ranger on a stepper, from one place each.
    Sweeps(&'a [FitSweep]),
    /// Rounds of an array on a moving robot.
    Rounds(&'a [ArrayRound]),
}

impl<'a> From<&'a [FitSweep]> for SurveyInput<'a> {
    fn from(sweeps: &'a [FitSweep]) -> Self {
        Self::Sweeps(sweeps)
    }
}

impl<'a> From<&'a Vec<FitSweep>> for SurveyInput<'a> {
    fn from(sweeps: &'a Vec<FitSweep>) -> Self {
        Self::Sweeps(sweeps)
    }
}

impl<'a> From<&'a [ArrayRound]> for SurveyInput<'a> {
    fn from(rounds: &'a [ArrayRound]) -> Self {
        Self::Rounds(rounds)
    }
}

impl<'a> From<&'a Vec<ArrayRound>> for SurveyInput<'a> {
    fn from(rounds: &'a Vec<ArrayRound>) -> Self {
        Self::Rounds(rounds)
    }
}

impl<'a> SurveyInput<'a> {
    /// Readings by pose, without the positions of transducers.
    pub(crate) fn sweeps(self) -> Cow<'a, [FitSweep]> {
        match self {
            Self::Sweeps(sweeps) => Cow::Borrowed(sweeps),
            Self::Rounds(rounds) => rounds.iter().map(ArrayRound::at_pose).collect(),
        }
    }

    /// Positions of the transducers of a sweep in the frame of its pose, in the order of its beams,
    /// metres; `None` on a stepper, where the sensor's mounting states it.
    pub(crate) fn faces(self, sweep: usize) -> Option<Vec<DVec2>> {
        let face = |firing: &ArrayFiring| firing.position;
        match self {
            Self::Sweeps(_) => None,
            Self::Rounds(rounds) => Some(rounds[sweep].firings.iter().map(face).collect()),
        }
    }

    /// Returns `true` for rounds of an array.
    pub(crate) const fn is_array(self) -> bool {
        matches!(self, Self::Rounds(_))
    }
}

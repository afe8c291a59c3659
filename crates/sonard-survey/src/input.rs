//! Readings that a survey is made from.

use std::borrow::Cow;

use sonard_inverse::{ArrayFiring, ArrayRound, FitSweep, FitSweepError, SweepFiring};
use sonard_model::geometry::{DVec2, Pose, wrap_180};
use sonard_records::ScanView;

use crate::{error::SurveyError, viewpoint::Viewpoint};

/// Maximum number of rounds of an array.
pub(crate) const MAX_ARRAY_ROUNDS: usize = 200;

/// Readings of a course, in its order.
#[derive(Debug, Clone, Copy)]
pub enum SurveyInput<'a> {
    /// Sweeps of a ranger on a stepper, from one place each.
    Sweeps(&'a [FitSweep]),
    /// Rounds of an array on a moving robot.
    Rounds(&'a [ArrayRound]),
}

/// Readings of logged scans in the order of a course.
#[derive(Debug, Clone, PartialEq)]
pub enum SurveyCourse {
    /// Sweeps of a ranger on a stepper, from one place each.
    Sweeps(Vec<FitSweep>),
    /// Rounds of an array on a moving robot.
    Rounds(Vec<ArrayRound>),
}

impl SurveyCourse {
    /// Distance between rounds of an array that suffices for a survey, metres.
    pub const ROUND_SPACING_M: f64 = 0.1;

    /// Readings of a scan: a sweep of a ranger on a stepper, or the rounds of an array.
    ///
    /// # Errors
    /// Scan without start or session.
    pub fn from_scan(scan: &ScanView) -> Result<Self, FitSweepError> {
        match FitSweep::from_scan(scan) {
            Err(FitSweepError::OfArray(_)) => ArrayRound::from_scan(scan).map(Self::Rounds),
            sweep => sweep.map(|sweep| Self::Sweeps(vec![sweep])),
        }
    }

    /// Appends readings of the same kind.
    ///
    /// # Errors
    /// [`SurveyError::MixedCourse`] for those of the other.
    pub fn extend(&mut self, more: Self) -> Result<(), SurveyError> {
        match (self, more) {
            (Self::Sweeps(sweeps), Self::Sweeps(more)) => sweeps.extend(more),
            (Self::Rounds(rounds), Self::Rounds(more)) => rounds.extend(more),
            _ => return Err(SurveyError::MixedCourse),
        }
        Ok(())
    }

    /// Drops rounds that begin nearer than `spacing_m` and at less than 5 degrees from the last one
    /// kept.
    pub fn thin(&mut self, spacing_m: f64) {
        const TURN_DEG: f64 = 5.0;
        let Self::Rounds(rounds) = self else { return };
        let mut last: Option<Pose> = None;
        rounds.retain(|round| {
            let is_kept = last.is_none_or(|last| {
                last.position().distance(round.pose.position()) >= spacing_m
                    || wrap_180(last.heading_deg - round.pose.heading_deg).abs() >= TURN_DEG
            });
            last = if is_kept { Some(round.pose) } else { last };
            is_kept
        });
    }
}

impl<'a> From<&'a SurveyCourse> for SurveyInput<'a> {
    fn from(course: &'a SurveyCourse) -> Self {
        match course {
            SurveyCourse::Sweeps(sweeps) => sweeps.into(),
            SurveyCourse::Rounds(rounds) => rounds.into(),
        }
    }
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

    /// Beams by the position that they are fired from, in the order of the sweeps; `sweeps` are
    /// those of [`Self::sweeps`].
    pub(crate) fn viewpoints(self, sweeps: &'a [FitSweep]) -> Vec<Viewpoint<'a>> {
        let numbered = sweeps.iter().enumerate();
        match self {
            Self::Sweeps(_) => numbered
                .map(|(sweep, beams)| Viewpoint {
                    sweep,
                    face: DVec2::ZERO,
                    beams: Cow::Borrowed(beams),
                })
                .collect(),
            Self::Rounds(rounds) => {
                let of_round = |(sweep, beams): (usize, &FitSweep)| {
                    let firings = rounds[sweep].firings.iter().zip(beams.beams.clone());
                    let of_firing = |(firing, beam): (&ArrayFiring, SweepFiring)| Viewpoint {
                        sweep,
                        face: firing.position,
                        beams: Cow::Owned(FitSweep { beams: vec![beam], ..*beams }),
                    };
                    firings.map(of_firing).collect::<Vec<_>>()
                };
                numbered.flat_map(of_round).collect()
            }
        }
    }

    /// Returns `true` for rounds of an array.
    pub(crate) const fn is_array(self) -> bool {
        matches!(self, Self::Rounds(_))
    }
}

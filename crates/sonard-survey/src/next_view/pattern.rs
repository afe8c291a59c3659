//! Beams that are fired at a view.

use sonard_model::{
    geometry::{Pose, wrap_180},
    model::Simulator,
};

use crate::{
    judge::{Judge, outcome_of},
    options::SurveyOptions,
    readings::Outcome,
};

/// Angle between predicted beams of a full turn, degrees: half of an arc.
const STEP_DEG: f64 = 3.6;
/// Angle between the headings at which the round of an array is predicted, degrees.
const HEADING_STEP_DEG: f64 = 30.0;

/// Beams that are fired at a view.
pub(super) enum ViewPattern<'a> {
    /// Full turn of a stepper, whose heading is irrelevant.
    Turn {
        /// Number of neighbouring predicted beams that count as one.
        beams_per_arc: f64,
    },
    /// Round of an array with the firings of a round of the course.
    Round { judge: &'a Judge<'a>, round: usize },
}

impl<'a> ViewPattern<'a> {
    /// Beams as in the readings of a course; of an array, those of the round that has most.
    pub(super) fn new(judge: &'a Judge<'a>, options: &SurveyOptions) -> Self {
        if judge.workspace.is_array {
            let rounds = 0..judge.readings().len();
            let round = rounds.max_by_key(|of| judge.readings()[*of].beams.len()).unwrap_or(0);
            return Self::Round { judge, round };
        }
        Self::Turn { beams_per_arc: (options.arc_deg / STEP_DEG).max(1.0) }
    }

    /// Number of neighbouring beams that count as one.
    pub(super) fn beams_per_arc(&self) -> f64 {
        match *self {
            Self::Turn { beams_per_arc } => beams_per_arc,
            Self::Round { judge, round } => judge.readings()[round].beams_per_arc,
        }
    }

    /// Number of beams that are predicted for each place.
    pub(super) fn beams_per_place(&self) -> usize {
        match *self {
            Self::Turn { .. } => (360.0 / STEP_DEG) as usize,
            Self::Round { judge, round } => headings() * judge.readings()[round].beams.len(),
        }
    }

    /// Poses to compare at the place of a pose.
    pub(super) fn poses_at(&self, pose: Option<Pose>) -> Vec<Pose> {
        let count = if matches!(self, Self::Turn { .. }) { 1 } else { headings() };
        let turned = |pose: Pose| {
            (0..count).map(move |at| Pose {
                heading_deg: wrap_180(pose.heading_deg + HEADING_STEP_DEG * at as f64),
                ..pose
            })
        };
        pose.into_iter().flat_map(turned).collect()
    }

    /// Predicted outcomes from a pose; `None` if the scene has more paths than the model follows.
    pub(super) fn predict(&self, simulator: &Simulator, pose: &Pose) -> Option<Vec<Outcome>> {
        match *self {
            Self::Turn { .. } => {
                let point = simulator.at(pose.position());
                let direction_rad = |at: usize| (STEP_DEG * at as f64).to_radians();
                let ping = |at: usize| point.ping(direction_rad(at)).ok();
                (0..self.beams_per_place()).map(|at| ping(at).map(|of| outcome_of(&of))).collect()
            }
            Self::Round { judge, round } => {
                let predicted = judge.predict(simulator, round, pose)?;
                Some(predicted.iter().map(outcome_of).collect())
            }
        }
    }
}

const fn headings() -> usize {
    (360.0 / HEADING_STEP_DEG) as usize
}

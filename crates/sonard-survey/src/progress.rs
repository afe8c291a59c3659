//! Progress and cancellation of a survey.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Stage of a survey.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "stage")]
pub enum SurveyStage {
    /// Poses and virtual features from arcs.
    Course,
    /// Round of the search for walls, from 1.
    Walls {
        /// Number of the round, from 1.
        round: usize,
    },
    /// Alternatives, status and covariance of the plan found.
    Alternatives,
}

/// Progress of a survey.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurveyProgress {
    /// Current stage.
    #[serde(flatten)]
    pub stage: SurveyStage,
    /// Number of different scenes scored so far.
    pub scored_scenes: usize,
    /// Score of the best plan so far, nats.
    pub score: Option<f64>,
    /// Number of walls of that plan.
    pub walls: usize,
}

/// Observer of a survey; see [`NoObserver`] for none.
pub trait SurveyObserver: Sync {
    /// Reports progress, from one thread.
    fn progress(&self, _progress: SurveyProgress) {}

    /// Returns `true` to end the survey early with the best plan so far; must remain `true` once
    /// set.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Observer that does nothing and never cancels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct NoObserver;

impl SurveyObserver for NoObserver {}

//! Surveys: the floor plan of an unknown room, and all poses, from sweeps of a ranger.
//!
//! [`survey`] turns sweeps taken at a few places into walls with their uncertainty:
//!
//! 1. Arcs of equal range are found in each sweep, and poses are estimated with the map of
//!    [`VirtualFeature`]s: a mirror image of a wall is a line and a mirror image of a corner is a
//!    point, so multiple reflections are landmarks without an interpretation of their paths.
//! 2. Lines through these features are cut at each other. Which pieces are walls is decided by the
//!    likelihood of all readings under the exact model of `sonard_model`, less a price for walls.
//! 3. Poses and lines are refined together with the paths of all explained arcs, and lines, posts
//!    and boxes are added where arcs remain unexplained.
//!
//! Finally the place is found from which one more sweep resolves most of what is open, the
//! [`NextView`].
//!
//! [`map_course`] does the first step alone, for courses without a scene.

mod alternatives;
mod arc;
mod arrangement;
mod boxes;
mod bundle;
mod candidates;
mod course;
mod covariance;
mod error;
mod faces;
mod feature;
mod input;
mod judge;
mod line;
mod moves;
mod next_view;
mod normal;
mod odometry;
mod options;
mod polish;
mod pose_climb;
mod pose_grid;
mod posed;
mod post;
mod posts;
mod progress;
mod range_errors;
mod ranking;
mod readings;
mod refine;
mod relocate;
mod report;
mod result;
mod room;
mod rows;
mod scores;
mod search;
mod sensor_fit;
mod slam;
mod spots;
mod square;
mod survey;
mod symmetry;
#[cfg(test)]
mod tests;
mod trace;
pub mod trial;
mod viewpoint;
mod workspace;

pub use course::{CourseMap, map_course};
pub use error::SurveyError;
pub use feature::VirtualFeature;
pub use input::{SurveyCourse, SurveyInput};
pub use odometry::OdometrySigma;
pub use options::SurveyOptions;
pub use post::PostShape;
pub use progress::{NoObserver, SurveyObserver, SurveyProgress, SurveyStage};
pub use result::{
    AlternativePlan, FittedNumber, NextView, OpenPart, PieceStatus, ReadingCause, ResolvedPart,
    SearchEnd, SensorFit, Survey, SurveyedEnd, SurveyedPose, SurveyedPost, SurveyedWall,
    UnexplainedArc, WallPiece,
};
pub use room::unknown_room;
pub use scores::PlanScores;
pub use survey::{resume_survey, score_plan, score_refined_plan, survey};

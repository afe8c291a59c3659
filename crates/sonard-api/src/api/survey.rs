//! Surveys: floor plan and poses from scans of an unknown room.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sonard_inverse::ParameterGroup;
use sonard_model::geometry::Pose;
use sonard_records::FloorPlan;
use sonard_survey::{OdometrySigma, Survey, SurveyCourse, SurveyOptions, SurveyProgress};
use uuid::Uuid;

/// Maximum number of sweeps of a survey.
pub const MAX_SURVEYED_SWEEPS: usize = 40;
/// Maximum number of readings of an uploaded sweep.
pub const MAX_UPLOADED_BEAMS: usize = 4000;
/// Maximum number of groups of numbers that a survey fits.
const MAX_FITTED_GROUPS: usize = 10;
/// Maximum budget of a survey, scored floor plans.
pub const MAX_SURVEY_SCENES: usize = 100_000;

/// Request body of `POST /v1/survey`: scans of the logs, or uploaded sweeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurveyRequest {
    /// Scans of one sensor in the order of the course, from `GET /v1/scans`, of a ranger on a stepper
    /// or of an array on a moving robot; their poses are odometry.
    #[serde(default)]
    #[schemars(length(max = MAX_SURVEYED_SWEEPS))]
    pub scans: Vec<Uuid>,
    /// Sweeps by the current sensor in the current air, in the order of the course, if there are no
    /// scans.
    #[serde(default)]
    #[schemars(length(max = MAX_SURVEYED_SWEEPS))]
    pub sweeps: Vec<UploadedSweep>,
    /// Standard deviations of the poses as odometry; 0.05 m and 5 degrees per metre if omitted.
    #[serde(default)]
    pub odometry: Option<OdometrySigma>,
    /// Ignores the poses.
    #[serde(default)]
    pub no_odometry: bool,
    /// Ties walls to right angles.
    #[serde(default)]
    pub square: bool,
    /// Keeps conjectured stretches of walls in the scene.
    #[serde(default)]
    pub closed: bool,
    /// Maximum range, metres; longer ranges count as no echo.
    #[serde(default = "default_max_range_m")]
    #[schemars(range(min = 0.3, max = 20))]
    pub max_range_m: f64,
    /// Amplitude reflection coefficient of all walls.
    #[serde(default = "default_reflectance")]
    #[schemars(range(min = 0.05, max = 1))]
    pub reflectance: f64,
    /// Numbers of sensor and air that are fitted together with the plan: threshold, rise, mounting,
    /// materials (the reflectance), air, delay, gear, beam, skirts or pulse.
    #[serde(default)]
    #[schemars(length(max = MAX_FITTED_GROUPS))]
    pub fit: Vec<ParameterGroup>,
    /// Minimum distance between rounds of an array that are used, metres, unless the robot turns by 5
    /// degrees.
    #[serde(default = "default_round_spacing_m")]
    #[schemars(range(min = 0, max = 5))]
    pub round_spacing_m: f64,
    /// Maximum distance of the next view from a stop, metres.
    #[serde(default = "default_view_reach_m")]
    #[schemars(range(min = 0, max = 20))]
    pub view_reach_m: f64,
    /// Maximum number of floor plans whose readings are predicted.
    #[serde(default = "default_max_scenes")]
    #[schemars(range(min = 100, max = MAX_SURVEY_SCENES))]
    pub max_scenes: usize,
}

/// Sweep of a ranger at one place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UploadedSweep {
    /// Pose by odometry.
    pub pose: Pose,
    /// Azimuths of the beams, degrees counter-clockwise from the heading.
    #[schemars(length(min = 8, max = MAX_UPLOADED_BEAMS))]
    pub azimuths_deg: Vec<f64>,
    /// Range of each beam, metres; `null` for no echo. Beams below the minimum range are left out.
    #[schemars(length(min = 8, max = MAX_UPLOADED_BEAMS))]
    pub ranges_m: Vec<Option<f64>>,
}

/// Line of the response to `POST /v1/survey`: the stages of the search, and finally its result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurveyEvent {
    /// Beginning of a stage.
    Progress(SurveyProgress),
    /// Result, the last line.
    Result(Box<SurveyReport>),
}

/// Result of a survey.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurveyReport {
    /// Poses, walls with their status, alternatives and unexplained arcs, as in `survey.json`.
    pub survey: Survey,
    /// Scene file of the plan, with the stops as poses; `null` if no wall was found.
    pub scene: Option<Value>,
    /// Floor plan of that scene.
    pub floor_plan: Option<FloorPlan>,
}

const fn default_max_range_m() -> f64 {
    5.0
}

fn default_reflectance() -> f64 {
    SurveyOptions::default().reflectance
}

const fn default_round_spacing_m() -> f64 {
    SurveyCourse::ROUND_SPACING_M
}

fn default_view_reach_m() -> f64 {
    SurveyOptions::default().view_reach_m
}

fn default_max_scenes() -> usize {
    SurveyOptions::default().max_scenes
}

//! Result of a survey.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sonard_model::{
    acoustics::Sensor,
    geometry::Pose,
    scene::{Scene, SceneBuilder},
};
use uuid::Uuid;

/// Material of all walls and posts.
pub(crate) const MATERIAL: &str = "wall";

/// Floor plan and poses that explain the readings of sweeps, with what they leave undetermined.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Survey {
    /// Walls of the best plan, in the frame of the first sweep's pose.
    pub walls: Vec<SurveyedWall>,
    /// Posts of the best plan, in the same frame.
    #[serde(default)]
    pub posts: Vec<SurveyedPost>,
    /// Poses of the sweeps, in their order.
    pub poses: Vec<SurveyedPose>,
    /// Score of the plan, nats: log-likelihood of the readings, those of an arc as one, less the
    /// price of walls and posts.
    pub score: f64,
    /// Part of that price for directions off right angles, nats; 0 without that assumption.
    pub oblique_nats: f64,
    /// Number of arcs in all sweeps.
    pub arcs: usize,
    /// Arcs that the plan does not explain.
    pub unexplained: Vec<UnexplainedArc>,
    /// Cause of each reading, by sweep in order of azimuth.
    pub causes: Vec<Vec<ReadingCause>>,
    /// Other plans within 10 nats, most probable first.
    pub alternatives: Vec<AlternativePlan>,
    /// Probability of the best plan among those listed, 0 to 1.
    pub probability: f64,
    /// Entropy of what the readings leave open, nats: of the plan, its alternatives, and the plan
    /// with a stretch, a post or a gap changed; 0 if no other is within 10 nats.
    #[serde(default)]
    pub open_nats: f64,
    /// Pose of a further sweep that resolves most of it; `None` if nothing is open, or no reachable
    /// place resolves anything.
    #[serde(default)]
    pub next_view: Option<NextView>,
    /// Reason why the search ended.
    pub end: SearchEnd,
    /// Number of different scenes scored.
    pub scored_scenes: usize,
    /// Amplitude reflection coefficient of all walls, assumed or fitted, 0 to 1.
    pub reflectance: f64,
    /// Numbers of sensor and air that were fitted; `None` if all are assumed.
    #[serde(default)]
    pub fitted: Option<SensorFit>,
}

/// Numbers of sensor and air, fitted together with plan and poses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SensorFit {
    /// Estimates.
    pub numbers: Vec<FittedNumber>,
    /// Sensor with the estimates.
    pub sensor: Sensor,
    /// Speed of sound with the estimates, m/s.
    pub sound_speed_m_s: f64,
    /// Offset of all ranges, metres.
    pub delay_m: f64,
}

/// Estimate of a number, in the unit of its name. Plan and poses are estimated with it, so the
/// interval includes their uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FittedNumber {
    /// Name, as of `sonard calibrate`.
    pub name: String,
    /// Estimate.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Ends of the 95 % interval.
    pub interval: [f64; 2],
    /// Assumed value, the mean of the prior.
    pub assumed: f64,
    /// Standard deviation of the prior.
    pub assumed_sigma: f64,
    /// The readings determine the number to less than half the standard deviation of its prior.
    pub is_determined: bool,
    /// Names of other numbers that can hardly be separated from it (correlation above 0.95).
    pub coupled_with: Vec<String>,
}

/// Wall of a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurveyedWall {
    /// Name in the scene.
    pub id: String,
    /// First end.
    pub from: SurveyedEnd,
    /// Second end.
    pub to: SurveyedEnd,
    /// Standard deviation of the direction, degrees.
    pub sigma_direction_deg: Option<f64>,
    /// Standard deviation of the position across the wall, at its middle, metres.
    pub sigma_across_m: Option<f64>,
    /// Loss of score without the wall, nats.
    pub evidence_nats: f64,
    /// Stretches by status, from the first end to the second.
    pub pieces: Vec<WallPiece>,
}

/// Post of a plan: an upright cylinder, such as a table leg.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurveyedPost {
    /// Name in the scene.
    pub id: String,
    /// Axis, metres.
    pub center_m: [f64; 2],
    /// Radius, metres.
    pub radius_m: f64,
    /// Standard deviations of x and y of the axis, metres.
    pub sigma_m: Option<[f64; 2]>,
    /// Standard deviation of the radius, metres.
    pub sigma_radius_m: Option<f64>,
    /// Loss of score without the post, nats.
    pub evidence_nats: f64,
    /// Number of sweeps with a direct echo of the post.
    pub sweeps: usize,
    /// Observed, or conjectured and not in the scene.
    pub status: PieceStatus,
}

/// End of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurveyedEnd {
    /// Position, metres.
    pub at_m: [f64; 2],
    /// Covariance of a corner, metres squared (xx, xy, yy); `None` for a free end.
    pub covariance_m2: Option<[f64; 3]>,
}

/// Stretch of a wall with one status.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WallPiece {
    /// First end, metres.
    pub from_m: [f64; 2],
    /// Second end, metres.
    pub to_m: [f64; 2],
    /// Knowledge of the stretch.
    pub status: PieceStatus,
}

/// Knowledge of a stretch of wall.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum PieceStatus {
    /// Inside the Fresnel zone of a mirror reflection by which an arc is explained, on a wall that
    /// echoes from two sweeps or more determine and no listed alternative lacks.
    Observed,
    /// Outside of such zones, but the plan without the stretch scores more than 3 nats worse.
    Implied,
    /// The readings hardly depend on it.
    Conjectured,
}

/// Pose of a sweep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurveyedPose {
    /// Scan of the sweep.
    pub scan: Uuid,
    /// Pose in the frame of the first sweep.
    pub pose: Pose,
    /// Standard deviations of x and y, metres; 0 for the first sweep.
    pub sigma_m: Option<[f64; 2]>,
    /// Standard deviation of the heading, degrees.
    pub sigma_heading_deg: Option<f64>,
    /// Other poses that explain the sweep as well, within 10 nats, because the room looks alike
    /// from them.
    pub equivalent: Vec<Pose>,
}

/// Arc that the plan does not explain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnexplainedArc {
    /// Index of the sweep.
    pub sweep: usize,
    /// Azimuth of the middle, degrees from the heading.
    pub azimuth_deg: f64,
    /// Range, metres.
    pub range_m: f64,
    /// Number of beams.
    pub beams: usize,
}

/// Cause of a reading in the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReadingCause {
    /// A single mirror reflection.
    First,
    /// Two or more mirror reflections.
    Multiple,
    /// Diffraction at an edge or a thin post.
    Edge,
    /// Predicted missing echo or target below the minimum range.
    NoRange,
    /// The prediction differs.
    Unexplained,
}

/// Plan that explains the readings nearly as well.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AlternativePlan {
    /// Walls as pairs of ends, metres.
    pub walls: Vec<[[f64; 2]; 2]>,
    /// Score relative to that of the best plan, nats.
    pub score_difference: f64,
    /// Probability among the plans listed, 0 to 1.
    pub probability: f64,
}

/// Pose of a full turn, or of a round of an array, that resolves most of what a survey leaves open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NextView {
    /// Place, reachable by a straight move from a stop, with the heading of the nearest stop; of an
    /// array, the heading that resolves most.
    pub pose: Pose,
    /// Expected decrease of the entropy by the readings there, nats; 0 for a view chosen because of
    /// unexplained arcs.
    pub gain_nats: f64,
    /// Open parts that they resolve, the largest share first.
    pub resolves: Vec<ResolvedPart>,
}

/// Open part of a plan that a view resolves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResolvedPart {
    /// Difference from the best plan.
    #[serde(flatten)]
    pub part: OpenPart,
    /// Probability of the plan with that difference, 0 to 1.
    pub probability: f64,
    /// Share of the gain, 0 to 1.
    pub share: f64,
}

/// Possible difference from the best plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum OpenPart {
    /// A stretch of wall that may be absent.
    Wall {
        /// Name of the wall.
        wall: String,
        /// First end, metres.
        from_m: [f64; 2],
        /// Second end, metres.
        to_m: [f64; 2],
    },
    /// Walls at free ends that may be present.
    Gap {
        /// Pairs of ends, metres.
        walls: Vec<[[f64; 2]; 2]>,
    },
    /// A post that may be absent.
    Post {
        /// Name of the post.
        post: String,
    },
    /// Another plan.
    Alternative {
        /// Number among the alternatives, from 1.
        number: usize,
    },
    /// A plan that was not found: arcs that none explains.
    UnexplainedArcs {
        /// Number of arcs.
        count: usize,
    },
}

/// Reason why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SearchEnd {
    /// All arcs are explained and no move gains.
    Complete,
    /// No move gains, but arcs remain unexplained: the room has parts that are no smooth walls, or
    /// the search missed walls.
    UnexplainedArcs,
    /// The budget of scored scenes is spent.
    Budget,
    /// The observer cancelled.
    Cancelled,
}

impl Survey {
    /// Scene of the best plan with the poses as `stop-1`, `stop-2`, ..., without conjectured
    /// stretches and posts unless `is_closed`.
    #[must_use]
    pub fn scene(&self, name: &str, is_closed: bool) -> SceneBuilder {
        let mut scene = Scene::builder(name).material(MATERIAL, self.reflectance);
        for wall in &self.walls {
            let kept = wall.stretches(is_closed);
            let is_single = kept.len() == 1;
            for (at, ends) in kept.into_iter().enumerate() {
                let id = if is_single { wall.id.clone() } else { format!("{}-{at}", wall.id) };
                scene = scene.walls(&id, &ends.map(|end| end.map(rounded)), MATERIAL);
            }
        }
        for post in &self.posts {
            if is_closed || post.status != PieceStatus::Conjectured {
                let (center_m, radius_m) = (post.center_m.map(rounded), rounded(post.radius_m));
                scene = scene.cylinder(&post.id, center_m, radius_m, MATERIAL);
            }
        }
        for (of, number) in self.poses.iter().zip(1..) {
            let Pose { x_m, y_m, heading_deg } = of.pose;
            let [x_m, y_m, heading_deg] = [x_m, y_m, heading_deg].map(rounded);
            scene = scene.pose(&format!("stop-{number}"), x_m, y_m, heading_deg);
        }
        scene
    }
}

/// Rounds to a hundredth of a millimetre.
fn rounded(metres: f64) -> f64 {
    (1e5 * metres).round() / 1e5 + 0.0
}

impl SurveyedWall {
    /// Longest stretches of the wall, with or without conjectured pieces.
    #[must_use]
    pub fn stretches(&self, with_conjectured: bool) -> Vec<[[f64; 2]; 2]> {
        let mut found: Vec<[[f64; 2]; 2]> = Vec::new();
        let mut is_joined = false;
        for piece in &self.pieces {
            let is_kept = with_conjectured || piece.status != PieceStatus::Conjectured;
            match found.last_mut().filter(|_| is_joined) {
                Some(last) if is_kept => last[1] = piece.to_m,
                None if is_kept => found.push([piece.from_m, piece.to_m]),
                _ => {}
            }
            is_joined = is_kept;
        }
        found
    }
}

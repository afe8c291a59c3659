//! Score of a plan: likelihood of all readings by the exact model, less the price of its walls and
//! posts.

use std::{
    collections::HashMap,
    f64::consts::TAU,
    hash::{DefaultHasher, Hash, Hasher},
    sync::{Arc, Mutex, PoisonError},
};

use sonard_model::{
    geometry::{DVec2, Pose, wrap_180, wrap_360},
    model::{Arrival, Prediction, Simulator},
    reading::PingStatus,
    scene::{Cylinder, Material, Scene, Wall},
};

use crate::{
    arrangement::{LineArrangement, PieceSet, Segment, free_ends},
    posed::PosedPlan,
    post::PostShape,
    readings::{Beam, Outcome, Readings},
    square::oblique_price,
    workspace::Workspace,
};

/// Probability of an outlier among readings.
const OUTLIER: f64 = 0.05;
/// Share and mean length, standard deviations, of the exponential tail of range errors.
const TAIL: (f64, f64) = (0.3, 3.0);
/// Price of a line, of a wall on it, and of an end that meets no other wall, nats.
const LINE_NATS: f64 = 4.0;
const WALL_NATS: f64 = 4.0;
const FREE_END_NATS: f64 = 2.0;
/// Price of the length of walls, nats per metre.
const LENGTH_NATS_PER_M: f64 = 0.5;
/// Price of a post, nats: that of a wall and, for each of its three numbers, half that of a line,
/// which has two. A single arc that it explains gains about as much.
const POST_NATS: f64 = 10.0;
/// Step of directions in which readings are predicted for all headings, degrees: at most half of
/// the step of a coarse ranger's beams.
const DIRECTION_STEP_DEG: f64 = 1.5;
/// Maximum turn to the likeliest heading, standard deviations of odometry and degrees.
const MAX_TURN_SIGMAS: f64 = 2.5;
const MAX_TURN_DEG: f64 = 20.0;
/// Score of a plan with more paths than the model follows.
const UNSCORED: f64 = -1e9;

/// Predicted readings of all sweeps.
pub(crate) type Predictions = Vec<Vec<Prediction>>;

/// Scores plans against readings from given poses.
pub(crate) struct Judge<'a> {
    pub(crate) workspace: &'a Workspace<'a>,
    pub(crate) poses: Vec<Pose>,
    /// Posts of all plans scored.
    pub(crate) posts: Vec<PostShape>,
    /// Standard deviation of ranges, metres.
    pub(crate) sigma_m: f64,
    /// Maximum log-likelihood of the readings of each sweep, nats.
    max_nats: Vec<f64>,
    /// Headings are chosen for each plan.
    are_headings_free: bool,
    known: Mutex<HashMap<PieceSet, KnownScore>>,
}

/// Score of walls, nats, or a bound that excluded them.
#[derive(Debug, Clone, Copy)]
enum KnownScore {
    Exact(f64),
    AtMost(f64),
}

impl<'a> Judge<'a> {
    /// Judge of the plans of one arrangement, from given poses and with a standard deviation of
    /// ranges in metres.
    pub(crate) fn new(workspace: &'a Workspace<'a>, poses: &[Pose], sigma_m: f64) -> Self {
        let of_sweep = |readings: &Readings| {
            let measured = readings.beams.iter().map(|beam| beam.outcome);
            sweep_nats(readings, measured, sigma_m, workspace.reach_m())
        };
        let max_nats = workspace.readings.iter().map(of_sweep).collect();
        let (poses, posts, known) = (poses.to_vec(), Vec::new(), Mutex::default());
        Self { workspace, poses, posts, sigma_m, max_nats, are_headings_free: false, known }
    }

    /// Judge of plans with the poses and posts of one.
    pub(crate) fn of(workspace: &'a Workspace<'a>, posed: &PosedPlan, sigma_m: f64) -> Self {
        Self { posts: posed.posts.clone(), ..Self::new(workspace, &posed.poses, sigma_m) }
    }

    /// Judge from the poses and with the posts of another plan.
    pub(crate) fn at(&self, posed: &PosedPlan) -> Self {
        Self::of(self.workspace, posed, self.sigma_m)
    }

    /// Judge with another standard deviation of ranges, metres.
    pub(crate) fn with_sigma(&self, sigma_m: f64) -> Self {
        let posts = self.posts.clone();
        Self { posts, ..Self::new(self.workspace, &self.poses, sigma_m) }
    }

    /// Judge of plans with other posts.
    pub(crate) fn with_posts(&self, posts: &[PostShape]) -> Self {
        let (poses, max_nats) = (self.poses.clone(), self.max_nats.clone());
        let (posts, known) = (posts.to_vec(), Mutex::default());
        Self { poses, posts, max_nats, known, ..*self }
    }

    /// Judge that scores each plan with the likeliest headings of all sweeps but the first.
    pub(crate) fn with_free_headings(self) -> Self {
        Self { are_headings_free: true, ..self }
    }

    /// Poses from which a plan is scored; `None` if the scene has more paths than the model follows.
    pub(crate) fn poses_of(&self, segments: &[Segment]) -> Option<Vec<Pose>> {
        if !self.are_headings_free {
            return Some(self.poses.clone());
        }
        let simulator = self.simulator_of(segments)?;
        let turned = |(sweep, pose): (usize, &Pose)| {
            let (_, by_deg) = self.likeliest_turn(&simulator, sweep, pose)?;
            Some(Pose { heading_deg: wrap_180(pose.heading_deg + by_deg), ..*pose })
        };
        self.poses.iter().enumerate().map(turned).collect()
    }

    /// Readings of all sweeps.
    pub(crate) fn readings(&self) -> &'a [Readings] {
        &self.workspace.readings
    }

    /// Scores the walls of an arrangement, nats.
    pub(crate) fn score(&self, plan: &LineArrangement, walls: &PieceSet) -> f64 {
        self.score_above(plan, walls, f64::NEG_INFINITY).unwrap_or(UNSCORED)
    }

    /// Scores the walls of an arrangement, nats; `None` as soon as the readings of some sweeps
    /// exclude a score above `floor`.
    pub(crate) fn score_above(
        &self,
        plan: &LineArrangement,
        walls: &PieceSet,
        floor: f64,
    ) -> Option<f64> {
        let known = self.lock().get(walls).copied();
        match known {
            Some(KnownScore::Exact(score)) => return Some(score),
            Some(KnownScore::AtMost(bound)) if bound <= floor => return None,
            _ => {}
        }
        let score = self.score_segments_above(&plan.segments(walls), floor);
        let known = score.map_or_else(KnownScore::AtMost, KnownScore::Exact);
        self.lock().insert(walls.clone(), known);
        score.ok()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<PieceSet, KnownScore>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Scores walls, nats.
    pub(crate) fn score_segments(&self, segments: &[Segment]) -> f64 {
        self.score_segments_above(segments, f64::NEG_INFINITY).unwrap_or(UNSCORED)
    }

    /// Score, or an upper bound of it that does not exceed `floor`, nats.
    pub(crate) fn score_segments_above(
        &self,
        segments: &[Segment],
        floor: f64,
    ) -> Result<f64, f64> {
        let price = price(segments) + POST_NATS * self.posts.len() as f64;
        let oblique = self.oblique_nats(segments);
        let priced = |nats: f64| nats - price - oblique;
        let nats = self.log_likelihood_above(segments, floor + price + oblique);
        nats.map(priced).map_err(priced)
    }

    /// Price of directions off right angles, nats; 0 without that assumption.
    pub(crate) fn oblique_nats(&self, segments: &[Segment]) -> f64 {
        self.workspace.square_rad.map_or(0.0, |sigma_rad| oblique_price(segments, sigma_rad))
    }

    /// Log-likelihood of all readings, with the readings of an arc as one, nats.
    pub(crate) fn log_likelihood(&self, segments: &[Segment]) -> f64 {
        self.log_likelihood_above(segments, f64::NEG_INFINITY).unwrap_or(UNSCORED)
    }

    /// Log-likelihood of all readings, with the readings of an arc as one, nats; an upper bound as
    /// soon as some sweeps give one below `floor`.
    pub(crate) fn log_likelihood_above(
        &self,
        segments: &[Segment],
        floor: f64,
    ) -> Result<f64, f64> {
        /// Rounding of sums in different orders, nats.
        const ROUNDING: f64 = 1e-6;
        let digest = self.digest(segments);
        self.workspace.count_scene(digest);
        let sum = || {
            let Some(simulator) = self.simulator_of(segments) else { return Ok(UNSCORED) };
            let mut sum = 0.0;
            let mut max_of_rest: f64 = self.max_nats.iter().sum();
            for (sweep, pose) in self.poses.iter().enumerate() {
                let nats = match self.are_headings_free {
                    true => self.likeliest_turn(&simulator, sweep, pose).map(|of| of.0),
                    false => self.log_likelihood_of(&simulator, sweep, pose),
                };
                let Some(nats) = nats else { return Ok(UNSCORED) };
                sum += nats;
                max_of_rest -= self.max_nats[sweep];
                if sum + max_of_rest < floor - ROUNDING {
                    return Err(sum + max_of_rest);
                }
            }
            Ok(sum)
        };
        self.workspace.scores.get_or(digest, sum)
    }

    /// Digest of walls, posts, poses, standard deviation of ranges, freedom of headings, and model.
    fn digest(&self, segments: &[Segment]) -> u64 {
        let mut hasher = DefaultHasher::new();
        segments.len().hash(&mut hasher);
        let ends = segments.iter().flat_map(|wall| [wall.a.to_array(), wall.b.to_array()]);
        let poses = self.poses.iter().flat_map(|pose| [pose.x_m, pose.y_m, pose.heading_deg]);
        let posts =
            self.posts.iter().flat_map(|post| [post.center.x, post.center.y, post.radius_m]);
        for value in ends.flatten().chain(poses).chain([self.sigma_m]).chain(posts) {
            value.to_bits().hash(&mut hasher);
        }
        self.are_headings_free.hash(&mut hasher);
        self.workspace.sensor.hash(&mut hasher);
        // Without posts and arrays both are equal.
        let is_equal = self.posts.is_empty() && !self.workspace.is_array;
        (self.workspace.is_simplified && !is_equal).hash(&mut hasher);
        hasher.finish()
    }

    /// Log-likelihood of the readings of a sweep and of its odometry at the likeliest heading, nats,
    /// and the turn to that heading, degrees; 0 for the first sweep, which is the frame.
    ///
    /// Readings are predicted once in all directions, in steps of 1.5 degrees; a heading selects
    /// among them.
    fn likeliest_turn(
        &self,
        simulator: &Simulator,
        sweep: usize,
        pose: &Pose,
    ) -> Option<(f64, f64)> {
        let sigma_deg = self.workspace.heading_sigma_deg(sweep).filter(|sigma| *sigma > 0.0);
        let Some(sigma_deg) = sigma_deg else {
            return Some((self.log_likelihood_of(simulator, sweep, pose)?, 0.0));
        };
        let predicted = predict_around(simulator, pose)?;
        let own = &self.readings()[sweep];
        let odometry_deg = own.odometry.heading_deg - self.readings()[0].odometry.heading_deg;
        let off_deg = wrap_180(pose.heading_deg - self.poses[0].heading_deg - odometry_deg);
        let max_deg = (MAX_TURN_SIGMAS * sigma_deg).min(MAX_TURN_DEG);
        let last = (max_deg / DIRECTION_STEP_DEG) as i32;
        let scored = (-last..=last).map(|at| {
            let by_deg = DIRECTION_STEP_DEG * f64::from(at);
            let outcomes = own.beams.iter().map(|beam| {
                let direction_deg = wrap_360(pose.heading_deg + by_deg + beam.azimuth_deg);
                let nearest = (direction_deg / DIRECTION_STEP_DEG).round() as usize;
                predicted[nearest % predicted.len()]
            });
            let nats = sweep_nats(own, outcomes, self.sigma_m, self.workspace.reach_m());
            let off = (off_deg + by_deg) / sigma_deg;
            (nats - 0.5 * off * off, by_deg)
        });
        scored.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Log-likelihood of the readings of one sweep from a pose, nats; `None` if the scene has more
    /// paths than the model follows.
    pub(crate) fn log_likelihood_of(
        &self,
        simulator: &Simulator,
        sweep: usize,
        pose: &Pose,
    ) -> Option<f64> {
        let readings = &self.readings()[sweep];
        let predicted = self.predict(simulator, sweep, pose)?;
        let predicted = predicted.iter().map(outcome_of);
        Some(sweep_nats(readings, predicted, self.sigma_m, self.workspace.reach_m()))
    }

    /// Scene with these walls and the posts, in their order.
    pub(crate) fn scene_of(&self, segments: &[Segment]) -> Scene {
        scene_of(self.workspace.simulator.scene(), segments, &self.posts)
    }

    /// Simulator of a scene with these walls.
    pub(crate) fn simulator_of(&self, segments: &[Segment]) -> Option<Simulator> {
        self.workspace.simulator.in_scene(Arc::new(self.scene_of(segments))).ok()
    }

    /// Predicted readings of all sweeps, and the simulator.
    pub(crate) fn predictions(&self, segments: &[Segment]) -> Option<(Simulator, Predictions)> {
        let simulator = self.simulator_of(segments)?;
        let of_sweep = |(sweep, pose)| self.predict(&simulator, sweep, pose);
        let all: Option<Predictions> = self.poses.iter().enumerate().map(of_sweep).collect();
        all.map(|all| (simulator, all))
    }

    /// Predicted readings of a sweep from a pose; `None` if the scene has more paths than the model
    /// follows.
    pub(crate) fn predict(
        &self,
        simulator: &Simulator,
        sweep: usize,
        pose: &Pose,
    ) -> Option<Vec<Prediction>> {
        let readings = &self.readings()[sweep];
        let point = simulator.at(pose.position());
        let of_beam = |beam: &Beam| {
            let direction_rad = pose.direction_rad(beam.azimuth_deg);
            if beam.face == DVec2::ZERO {
                return point.ping(direction_rad).ok();
            }
            let face = pose.rotate_to_world(beam.face);
            let prediction = match self.workspace.is_simplified {
                true => point.ping_beside(direction_rad, face),
                false => simulator.at(pose.position() + face).ping(direction_rad),
            };
            let mut prediction = prediction.ok()?;
            if prediction.range_m.is_some_and(|range_m| range_m > readings.max_range_m) {
                (prediction.status, prediction.range_m) = (PingStatus::NoEcho, None);
            }
            Some(prediction)
        };
        readings.beams.iter().map(of_beam).collect()
    }
}

/// Scene with walls and posts of the first material of a template; both keep their index.
fn scene_of(template: &Scene, segments: &[Segment], posts: &[PostShape]) -> Scene {
    let material = template.materials.values().next().copied().unwrap_or(Material::RIGID);
    let wall = |(at, segment): (usize, &Segment)| Wall {
        id: format!("wall-{at}").into(),
        a: segment.a,
        b: segment.b,
        material,
        z_m: None,
    };
    let mut scene = template.clone();
    scene.walls = segments.iter().enumerate().map(wall).collect();
    let post = |(at, post): (usize, &PostShape)| Cylinder {
        id: format!("post-{at}").into(),
        center: post.center,
        radius_m: post.radius_m,
        material,
        z_m: None,
    };
    scene.cylinders = posts.iter().enumerate().map(post).collect();
    scene
}

/// Mean of the directions in which an echo leaves and from which it returns: minus the derivative of
/// its range by the place.
pub(crate) fn mean_direction(arrival: &Arrival) -> DVec2 {
    0.5 * (DVec2::from_angle(arrival.departure_rad) + DVec2::from_angle(arrival.arrival_rad))
}

/// Predicted outcomes in all directions from a place, in steps of [`DIRECTION_STEP_DEG`].
fn predict_around(simulator: &Simulator, pose: &Pose) -> Option<Vec<Outcome>> {
    let point = simulator.at(pose.position());
    let count = (360.0 / DIRECTION_STEP_DEG) as usize;
    let direction_rad = |at: usize| (DIRECTION_STEP_DEG * at as f64).to_radians();
    let ping = |at: usize| point.ping(direction_rad(at)).ok().map(|of| outcome_of(&of));
    (0..count).map(ping).collect()
}

/// Predicted outcome of a beam.
pub(crate) fn outcome_of(prediction: &Prediction) -> Outcome {
    match (prediction.status, prediction.range_m) {
        (PingStatus::Echo, Some(range_m)) => Outcome::Echo(range_m),
        (PingStatus::MinRange, _) => Outcome::BelowMinRange,
        _ => Outcome::NoEcho,
    }
}

/// Log-likelihood of the readings of a sweep under predicted outcomes, nats.
fn sweep_nats(
    readings: &Readings,
    predicted: impl Iterator<Item = Outcome>,
    sigma_m: f64,
    max_range_m: f64,
) -> f64 {
    let pairs = readings.beams.iter().zip(predicted);
    let of_beam =
        |(beam, of): (&Beam, Outcome)| outcome_nats([beam.outcome, of], sigma_m, max_range_m);
    pairs.map(of_beam).sum::<f64>() / readings.beams_per_arc
}

/// Log-likelihood of a measured outcome under a predicted one, nats; largest where both are equal.
pub(crate) fn outcome_nats(outcomes: [Outcome; 2], sigma_m: f64, max_range_m: f64) -> f64 {
    match outcomes {
        [Outcome::Echo(range_m), Outcome::Echo(expected_m)] => {
            let density = range_density(range_m - expected_m, sigma_m);
            ((1.0 - OUTLIER) * density + OUTLIER / max_range_m).ln()
        }
        [Outcome::Echo(_), _] => (OUTLIER / max_range_m).ln(),
        [Outcome::NoEcho, Outcome::NoEcho] | [Outcome::BelowMinRange, Outcome::BelowMinRange] => {
            (1.0 - OUTLIER).ln()
        }
        _ => OUTLIER.ln(),
    }
}

/// Density of a range error, per metre: normal with a two-sided exponential tail.
fn range_density(error_m: f64, sigma_m: f64) -> f64 {
    let (share, length) = TAIL;
    let off = error_m / sigma_m;
    let normal = (-0.5 * off * off).exp() / (sigma_m * TAU.sqrt());
    let tail = (-off.abs() / length).exp() / (2.0 * length * sigma_m);
    (1.0 - share) * normal + share * tail
}

/// Price of walls, nats: the prior by description length.
pub(crate) fn price(segments: &[Segment]) -> f64 {
    let mut lines: Vec<usize> = segments.iter().map(|segment| segment.line).collect();
    lines.sort_unstable();
    lines.dedup();
    let length_m: f64 = segments.iter().map(|segment| segment.length_m()).sum();
    let free: usize = (0..segments.len()).map(|at| free_ends(segments, at)).sum();
    LINE_NATS * lines.len() as f64
        + WALL_NATS * segments.len() as f64
        + FREE_END_NATS * free as f64
        + LENGTH_NATS_PER_M * length_m
}

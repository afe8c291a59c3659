//! Score of a plan: likelihood of all readings by the exact model, less the price of its walls and
//! posts.

mod reference;
mod sweep_rays;

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

pub(crate) use reference::ReferencePlan;
use sweep_rays::{DIRECTION_STEP_DEG, KnownRays, Ray, SweepPredictor};

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
/// Maximum turn to the likeliest heading, standard deviations of odometry and degrees.
const MAX_TURN_SIGMAS: f64 = 2.5;
const MAX_TURN_DEG: f64 = 20.0;
/// Score of a plan with more paths than the model follows.
pub(crate) const UNSCORED: f64 = -1e9;
/// Rounding of sums in different orders, nats.
pub(crate) const ROUNDING: f64 = 1e-6;

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
    /// Maximum log-likelihood of each reading of each sweep, nats.
    max_nats: Vec<Vec<f64>>,
    /// Headings are chosen for each plan.
    are_headings_free: bool,
    known: Mutex<HashMap<PieceSet, KnownScore>>,
}

/// Purpose of a score: plans below a floor are of no interest, and those that differ little from a
/// reference are predicted by it.
#[derive(Clone, Copy)]
pub(crate) struct ScoreContext<'r> {
    /// Floor, nats.
    pub(crate) floor: f64,
    pub(crate) reference: Option<&'r ReferencePlan>,
}

impl Default for ScoreContext<'_> {
    fn default() -> Self {
        Self::above(f64::NEG_INFINITY)
    }
}

impl<'r> ScoreContext<'r> {
    /// Scores above a floor, nats, by new predictions.
    pub(crate) const fn above(floor: f64) -> Self {
        Self { floor, reference: None }
    }

    /// Scores by the predictions of a reference, if there is one.
    pub(crate) fn near(self, reference: Option<&'r ReferencePlan>) -> Self {
        Self { reference, ..self }
    }
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
        let reach_m = workspace.reach_m();
        let max = |beam: &Beam| outcome_nats([beam.outcome; 2], sigma_m, reach_m);
        let of_sweep = |readings: &Readings| readings.beams.iter().map(max).collect();
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
            let rays = SweepPredictor::new(self, &simulator, sweep, pose).rays()?;
            let (_, by_deg) = self.likeliest_turn(sweep, &rays);
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
        self.score_above(plan, walls, ScoreContext::default()).unwrap_or(UNSCORED)
    }

    /// Scores the walls of an arrangement, nats; `None` as soon as some readings exclude a score above
    /// the floor.
    pub(crate) fn score_above(
        &self,
        plan: &LineArrangement,
        walls: &PieceSet,
        context: ScoreContext,
    ) -> Option<f64> {
        let known = self.lock().get(walls).copied();
        match known {
            Some(KnownScore::Exact(score)) => return Some(score),
            Some(KnownScore::AtMost(bound)) if bound <= context.floor => return None,
            _ => {}
        }
        let score = self.score_segments_above(&plan.segments(walls), context);
        let known = score.map_or_else(KnownScore::AtMost, KnownScore::Exact);
        self.lock().insert(walls.clone(), known);
        score.ok()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<PieceSet, KnownScore>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Scores walls, nats.
    pub(crate) fn score_segments(&self, segments: &[Segment]) -> f64 {
        self.score_segments_above(segments, ScoreContext::default()).unwrap_or(UNSCORED)
    }

    /// Score, or an upper bound of it that does not exceed the floor, nats.
    pub(crate) fn score_segments_above(
        &self,
        segments: &[Segment],
        context: ScoreContext,
    ) -> Result<f64, f64> {
        let price = price(segments) + POST_NATS * self.posts.len() as f64;
        let oblique = self.oblique_nats(segments);
        let priced = |nats: f64| nats - price - oblique;
        let context = ScoreContext { floor: context.floor + price + oblique, ..context };
        self.log_likelihood_above(segments, context).map(priced).map_err(priced)
    }

    /// Price of directions off right angles, nats; 0 without that assumption.
    pub(crate) fn oblique_nats(&self, segments: &[Segment]) -> f64 {
        self.workspace.square_rad.map_or(0.0, |sigma_rad| oblique_price(segments, sigma_rad))
    }

    /// Log-likelihood of all readings, with the readings of an arc as one, nats.
    pub(crate) fn log_likelihood(&self, segments: &[Segment]) -> f64 {
        self.log_likelihood_above(segments, ScoreContext::default()).unwrap_or(UNSCORED)
    }

    /// Log-likelihood of all readings, with the readings of an arc as one, nats; an upper bound as
    /// soon as some readings give one below the floor.
    pub(crate) fn log_likelihood_above(
        &self,
        segments: &[Segment],
        context: ScoreContext,
    ) -> Result<f64, f64> {
        let digest = self.digest(segments);
        self.workspace.count_scene(digest);
        self.workspace.scores.get_or(digest, || self.predicted_nats(segments, context))
    }

    fn predicted_nats(
        &self,
        segments: &[Segment],
        ScoreContext { floor, reference }: ScoreContext,
    ) -> Result<f64, f64> {
        let change = reference.map(|of| (of, of.change_to(segments, &self.posts)));
        let known = |sweep: usize| {
            let (reference, change) = change.as_ref()?;
            Some(reference.known(change, sweep, self.poses[sweep].position()))
        };
        let mut sweeps: Vec<SweepBound> =
            (0..self.poses.len()).map(|sweep| self.bound(sweep, known(sweep))).collect();
        let mut nats: Vec<f64> = sweeps.iter().map(|of| of.max).collect();
        let mut bound: f64 = nats.iter().sum();
        let is_excluded = |bound: f64| bound < floor - ROUNDING;
        if is_excluded(bound) {
            return Err(bound);
        }
        sweeps.retain(|of| of.is_affected);
        if sweeps.is_empty() {
            return Ok(nats.iter().sum());
        }
        let Some(simulator) = self.simulator_of(segments) else { return Ok(UNSCORED) };
        // What may gain most bounds most.
        sweeps.sort_by(|a, b| b.may_gain.total_cmp(&a.may_gain).then(a.sweep.cmp(&b.sweep)));
        for SweepBound { sweep, known, max, .. } in sweeps {
            let predictor = SweepPredictor::new(self, &simulator, sweep, &self.poses[sweep]);
            let rays = match known {
                Some(known) => {
                    let Some(affected) = predictor.affected(&known) else { return Ok(UNSCORED) };
                    let bounded = self.bound_of(sweep, &known, &affected);
                    if is_excluded(bound + bounded.max - max) {
                        return Err(bound + bounded.max - max);
                    }
                    predictor.changed(&known, &affected)
                }
                None => predictor.rays(),
            };
            let Some(rays) = rays else { return Ok(UNSCORED) };
            nats[sweep] = self.sweep_nats(sweep, &rays);
            bound += nats[sweep] - max;
            if is_excluded(bound) {
                return Err(bound);
            }
        }
        Ok(nats.iter().sum())
    }

    /// Bound of the log-likelihood of a sweep's readings before any prediction.
    fn bound<'r>(&self, sweep: usize, known: Option<KnownRays<'r>>) -> SweepBound<'r> {
        match known {
            Some(known) => self.bound_of(sweep, &known, &known.affected()),
            None => SweepBound {
                sweep,
                known,
                max: self.max_of(sweep),
                may_gain: 0.0,
                is_affected: true,
            },
        }
    }

    /// Bound of the log-likelihood of a sweep's readings where some rays differ from known ones.
    fn bound_of<'r>(
        &self,
        sweep: usize,
        known: &KnownRays<'r>,
        affected: &[usize],
    ) -> SweepBound<'r> {
        let rays = &known.of.rays;
        let is_affected = !affected.is_empty();
        let (own, known) = (self.sweep_nats(sweep, rays), Some(*known));
        if is_affected && self.is_turned(sweep) {
            let max = self.max_of(sweep);
            return SweepBound { sweep, known, max, may_gain: max - own, is_affected };
        }
        let gain = |at: &usize| self.max_nats[sweep][*at] - rays[*at].nats;
        let may_gain =
            affected.iter().map(gain).sum::<f64>() / self.readings()[sweep].beams_per_arc;
        SweepBound { sweep, known, max: own + may_gain, may_gain, is_affected }
    }

    /// Maximum log-likelihood of a sweep's readings, nats.
    fn max_of(&self, sweep: usize) -> f64 {
        self.max_nats[sweep].iter().sum::<f64>() / self.readings()[sweep].beams_per_arc
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

    /// Returns `true` if the heading of a sweep is chosen for each plan: that of the first is the
    /// frame.
    pub(crate) fn is_turned(&self, sweep: usize) -> bool {
        let is_free = |sigma_deg: f64| sigma_deg > 0.0;
        self.are_headings_free && self.workspace.heading_sigma_deg(sweep).is_some_and(is_free)
    }

    /// Log-likelihood of the reading of a beam under a predicted outcome, nats.
    pub(crate) fn beam_nats(&self, beam: &Beam, predicted: Outcome) -> f64 {
        outcome_nats([beam.outcome, predicted], self.sigma_m, self.workspace.reach_m())
    }

    /// Log-likelihood of the readings of a sweep by its predicted outcomes, nats; with that of its
    /// odometry where its heading is free.
    fn sweep_nats(&self, sweep: usize, rays: &[Ray]) -> f64 {
        if self.is_turned(sweep) {
            return self.likeliest_turn(sweep, rays).0;
        }
        let sum: f64 = rays.iter().map(|ray| ray.nats).sum();
        sum / self.readings()[sweep].beams_per_arc
    }

    /// Log-likelihood of the readings of a sweep and of its odometry at the likeliest heading, nats,
    /// and the turn to that heading, degrees; 0 for a heading that is not free.
    ///
    /// A heading selects among the outcomes predicted in all directions.
    fn likeliest_turn(&self, sweep: usize, rays: &[Ray]) -> (f64, f64) {
        let sigma_deg = self.workspace.heading_sigma_deg(sweep);
        let Some(sigma_deg) = sigma_deg.filter(|_| self.is_turned(sweep)) else {
            return (self.sweep_nats(sweep, rays), 0.0);
        };
        let (own, pose) = (&self.readings()[sweep], &self.poses[sweep]);
        let odometry_deg = own.odometry.heading_deg - self.readings()[0].odometry.heading_deg;
        let off_deg = wrap_180(pose.heading_deg - self.poses[0].heading_deg - odometry_deg);
        let max_deg = (MAX_TURN_SIGMAS * sigma_deg).min(MAX_TURN_DEG);
        let last = (max_deg / DIRECTION_STEP_DEG) as i32;
        let scored = (-last..=last).map(|at| {
            let by_deg = DIRECTION_STEP_DEG * f64::from(at);
            let outcomes = own.beams.iter().map(|beam| {
                let direction_deg = wrap_360(pose.heading_deg + by_deg + beam.azimuth_deg);
                let nearest = (direction_deg / DIRECTION_STEP_DEG).round() as usize;
                rays[nearest % rays.len()].outcome
            });
            let nats = sweep_nats(own, outcomes, self.sigma_m, self.workspace.reach_m());
            let off = (off_deg + by_deg) / sigma_deg;
            (nats - 0.5 * off * off, by_deg)
        });
        scored.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((UNSCORED, 0.0))
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
        SweepPredictor::new(self, simulator, sweep, pose).predictions()
    }
}

/// Bound of the log-likelihood of a sweep's readings.
struct SweepBound<'r> {
    sweep: usize,
    known: Option<KnownRays<'r>>,
    /// Bound, nats; exact if the sweep is not affected.
    max: f64,
    /// Maximum gain over the known outcomes, nats.
    may_gain: f64,
    /// Some outcomes are unknown.
    is_affected: bool,
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

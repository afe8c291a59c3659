//! Comparison of a survey with the true room.

use sonard_model::{
    geometry::{DVec2, Pose, distance_to_segment, wrap_180},
    scene::Scene,
};

use crate::{
    post::PostShape,
    result::{PieceStatus, Survey},
};

/// Wall as a pair of ends, metres.
pub type Ends = [DVec2; 2];

/// Survey compared with the true room, in the true frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Motion from the frame of the survey to the true one.
    pub motion: RigidMotion,
    /// Walls found, without conjectured stretches.
    pub walls: Vec<Ends>,
    /// Share of the true walls that is found, within 2 cm and 2 degrees.
    pub recall: f64,
    /// Share of the walls found that is true.
    pub precision: f64,
    /// Distances of true corners to the nearest end of a wall found, metres.
    pub corners_m: Vec<f64>,
    /// Mean error of the positions of sweeps, metres.
    pub position_m: f64,
    /// Mean error of the headings of sweeps, degrees.
    pub heading_deg: f64,
    /// Number of true posts, of those that an observed one is near, and of other observed ones.
    pub posts: [usize; 3],
}

impl Comparison {
    /// Compares a survey with the true scene and the true poses of the sweeps.
    #[must_use]
    pub fn new(found: &Survey, scene: &Scene, poses: &[Pose]) -> Self {
        let truth: Vec<Ends> = scene.walls.iter().map(|wall| [wall.a, wall.b]).collect();
        let cylinders = scene.cylinders.iter();
        let posts: Vec<PostShape> =
            cylinders.map(|of| PostShape { center: of.center, radius_m: of.radius_m }).collect();
        let found_poses = nearest_poses(found, poses);
        let motion = RigidMotion::between(&found_poses, poses);
        let walls = walls(found, &motion);
        let [position_m, heading_deg] = motion.pose_errors(&found_poses, poses);
        Self {
            motion,
            recall: coverage(&truth, &walls, 0.02, 2.0),
            precision: coverage(&walls, &truth, 0.02, 2.0),
            corners_m: corner_errors_m(&truth, &walls),
            position_m,
            heading_deg,
            posts: count_posts(found, &motion, &posts),
            walls,
        }
    }
}

/// Rigid motion from the frame of a survey to the true one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidMotion {
    turn: DVec2,
    by: DVec2,
}

impl RigidMotion {
    /// Motion that lays places on the true ones (least squares).
    #[must_use]
    pub fn between(found: &[Pose], truth: &[Pose]) -> Self {
        let mean = |poses: &[Pose]| {
            poses.iter().map(Pose::position).sum::<DVec2>() / poses.len().max(1) as f64
        };
        let (from, to) = (mean(found), mean(truth));
        let (mut cosine, mut sine) = (0.0, 0.0);
        for (a, b) in found.iter().zip(truth) {
            let (a, b) = (a.position() - from, b.position() - to);
            cosine += a.dot(b);
            sine += a.perp_dot(b);
        }
        let turn = DVec2::new(cosine, sine).normalize_or(DVec2::X);
        Self { turn, by: to - turn.rotate(from) }
    }

    /// Place in the true frame.
    #[must_use]
    pub fn of(&self, point: DVec2) -> DVec2 {
        self.turn.rotate(point) + self.by
    }

    /// Pose in the frame of the survey.
    #[must_use]
    pub fn inverse_of(&self, pose: &Pose) -> Pose {
        let back = DVec2::new(self.turn.x, -self.turn.y);
        let at = back.rotate(pose.position() - self.by);
        let heading_deg = pose.heading_deg - self.turn.to_angle().to_degrees();
        Pose { x_m: at.x, y_m: at.y, heading_deg }
    }

    /// Mean errors of positions, metres, and headings, degrees.
    #[must_use]
    pub fn pose_errors(&self, found: &[Pose], truth: &[Pose]) -> [f64; 2] {
        let turn_deg = self.turn.to_angle().to_degrees();
        let (mut off_m, mut off_deg) = (0.0, 0.0);
        for (a, b) in found.iter().zip(truth) {
            off_m += self.of(a.position()).distance(b.position());
            off_deg += wrap_180(a.heading_deg + turn_deg - b.heading_deg).abs();
        }
        let count = found.len().max(1) as f64;
        [off_m / count, off_deg / count]
    }
}

/// Share of the length of walls that is within a distance, metres, and an angle, degrees, of
/// others.
#[must_use]
pub fn coverage(walls: &[Ends], others: &[Ends], off_m: f64, off_deg: f64) -> f64 {
    const STEP_M: f64 = 0.01;
    let (mut length_m, mut covered_m) = (0.0, 0.0);
    for [a, b] in walls {
        let own_m = a.distance(*b);
        let count = (own_m / STEP_M).ceil().max(2.0);
        let is_parallel = |[c, d]: &&Ends| {
            let sine = (b - a).normalize_or_zero().perp_dot((d - c).normalize_or_zero());
            sine.abs() < off_deg.to_radians().sin()
        };
        let near: Vec<&Ends> = others.iter().filter(is_parallel).collect();
        let is_covered = |at: &usize| {
            let point = a.lerp(*b, (*at as f64 + 0.5) / count);
            near.iter().any(|[c, d]| distance_to_segment(point, *c, *d) < off_m)
        };
        let covered = (0..count as usize).filter(is_covered).count();
        length_m += own_m;
        covered_m += own_m * covered as f64 / count;
    }
    if length_m > 0.0 { covered_m / length_m } else { 0.0 }
}

/// Distances of true corners to the nearest end of a wall, metres.
fn corner_errors_m(truth: &[Ends], walls: &[Ends]) -> Vec<f64> {
    let mut corners: Vec<DVec2> = truth.iter().flatten().copied().collect();
    corners.dedup_by(|a, b| a.distance(*b) < 1e-6);
    let nearest = |corner: DVec2| {
        let ends = walls.iter().flatten().map(|end| end.distance(corner));
        ends.fold(f64::INFINITY, f64::min)
    };
    corners.into_iter().map(nearest).collect()
}

/// Returns `true` if a place is within 2 cm of the axis of a post.
#[must_use]
pub fn is_post_at(at: DVec2, post: &PostShape) -> bool {
    at.distance(post.center) < 0.02
}

/// Numbers of [`Comparison::posts`].
fn count_posts(found: &Survey, motion: &RigidMotion, truth: &[PostShape]) -> [usize; 3] {
    let observed = found.posts.iter().filter(|post| post.status == PieceStatus::Observed);
    let centers: Vec<DVec2> = observed.map(|post| motion.of(post.center_m.into())).collect();
    let is_found = |post: &&PostShape| centers.iter().any(|at| is_post_at(*at, post));
    let is_wrong = |at: &&DVec2| !truth.iter().any(|post| is_post_at(**at, post));
    [truth.len(), truth.iter().filter(is_found).count(), centers.iter().filter(is_wrong).count()]
}

/// Poses found, of those that the survey lists as equivalent the ones nearest to the truth.
fn nearest_poses(found: &Survey, truth: &[Pose]) -> Vec<Pose> {
    /// Maximum number of combinations.
    const MAX_LISTED: usize = 4096;
    let mut all: Vec<Vec<Pose>> = vec![Vec::new()];
    for of in &found.poses {
        let choices = || [of.pose].into_iter().chain(of.equivalent.iter().copied());
        let is_full = all.len() * choices().count() > MAX_LISTED;
        let with = |known: &Vec<Pose>, next: Pose| [&known[..], &[next]].concat();
        let count = if is_full { 1 } else { usize::MAX };
        let longer =
            all.iter().flat_map(|known| choices().take(count).map(|next| with(known, next)));
        all = longer.collect();
    }
    let off_m = |poses: &Vec<Pose>| RigidMotion::between(poses, truth).pose_errors(poses, truth)[0];
    all.into_iter().min_by(|a, b| off_m(a).total_cmp(&off_m(b))).unwrap_or_default()
}

/// Walls without conjectured stretches, in the true frame.
fn walls(found: &Survey, motion: &RigidMotion) -> Vec<Ends> {
    let stretches = found.walls.iter().flat_map(|wall| wall.stretches(false));
    stretches.map(|ends| ends.map(|end| motion.of(DVec2::from(end)))).collect()
}

//! Posts: upright cylinders such as table legs, found from arcs that the walls leave unexplained.

use sonard_model::geometry::{Pose, wrap_pi};

use crate::{
    arc::Arc,
    arrangement::Segment,
    judge::{Judge, ReferencePlan, ScoreContext, UNSCORED},
    normal::NormalEquations,
    posed::PosedPlan,
    post::{CLEAR_M, PostShape},
    ranking::{climbed, ranked},
};

/// Posts that a round adds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PostKind {
    /// Posts whose radius distinguishes them from a corner or an edge: while walls are missing,
    /// the echoes of a corner are those of a post without a radius.
    Round,
    /// All posts.
    Any,
}

/// Mean and standard deviation of the prior of a candidate's radius, metres: legs and columns.
const RADIUS_PRIOR_M: [f64; 2] = [0.04, 0.04];
/// Maximum number of posts of a plan.
pub(crate) const MAX_POSTS: usize = 8;
/// Maximum number of candidates scored and, of these, refined by the likelihood.
const MAX_CANDIDATES: usize = 40;
const MAX_REFINED: usize = 3;
/// Minimum number of sweeps with arcs of a candidate: a single arc fits a post of any radius.
const MIN_SWEEPS: usize = 2;
/// Gates of an arc of a candidate: range in metres and bearing in radians, more for a cut one.
const GATE_M: f64 = 0.02;
const GATE_RAD: [f64; 2] = [0.09, 0.26];
/// Standard deviation of the range of an arc in the fit of a candidate, metres.
const SIGMA_M: f64 = 0.004;
/// Residuals beyond so many standard deviations count linearly.
const ROBUST: f64 = 2.0;
/// Minimum distance from the surface of a post to a pose, metres.
const CLEAR_OF_POSES_M: f64 = 0.05;
/// Distance of centres within which candidates are the same, metres.
const SAME_M: f64 = 0.02;
/// Standard deviation of ranges in the comparison of candidates, metres.
const ROUGH_SIGMA_M: f64 = 0.012;
/// Steps of the fine search, metres.
const FINE_M: [f64; 2] = [0.006, 0.002];
/// Maximum length of a wall that may be drawn at the echoes of posts, metres.
const SHORT_M: f64 = 1.0;
/// Minimum radius of a round post in its standard deviations.
const ROUND: f64 = 2.0;
/// Minimum gain of a post, nats.
const MIN_GAIN: f64 = 1.0;

/// Plan with posts at arcs that its long walls leave unexplained, if the likelihood gains.
///
/// Walls drawn at the echoes of posts hide them, so that short walls are removed first, and return
/// where they still gain.
pub(crate) fn with_new_posts<'a>(
    posed: &PosedPlan,
    judge: &Judge,
    kind: PostKind,
    left_by: impl Fn(&PosedPlan) -> Vec<&'a Arc>,
) -> Option<PosedPlan> {
    let score = |of: &PosedPlan| score_with_posts(of, judge);
    let before = score(posed);
    let mut grown = posed.without_short_walls(SHORT_M);
    while grown.posts.len() < MAX_POSTS {
        let posts = candidates(&grown, kind, &left_by(&grown));
        let Some(post) = best_post(&grown, &judge.with_posts(&grown.posts), posts) else { break };
        grown.posts.push(post);
    }
    if grown.posts.len() == posed.posts.len() {
        return None;
    }
    let mut best = score(&grown);
    let mut dropped = posed.plan.runs(&posed.walls);
    dropped.retain(|run| posed.plan.segment(run).length_m() < SHORT_M);
    dropped.sort_by(|a, b| {
        posed.plan.segment(b).length_m().total_cmp(&posed.plan.segment(a).length_m())
    });
    for run in dropped {
        let mut with = grown.clone();
        with.set_run(&run, true);
        let walls = [with.plan.segment(&run)];
        if with.posts.iter().all(|post| post.is_clear_of(&walls)) {
            let gained = score(&with);
            if gained > best {
                (grown, best) = (with, gained);
            }
        }
    }
    (best > before + MIN_GAIN).then_some(grown)
}

/// Post of several that adds most to the likelihood of a plan, if it pays.
fn best_post(posed: &PosedPlan, judge: &Judge, posts: Vec<PostShape>) -> Option<PostShape> {
    let walls = posed.plan.segments(&posed.walls);
    let before = judge.score_segments(&walls);
    let reference = ReferencePlan::new(judge, &walls)?;
    let rough = judge.with_sigma(judge.workspace.errors.sigma_m(ROUGH_SIGMA_M));
    let near = reference.rescored(&rough);
    let best = ranked(posts, |post| score_of(post, posed, (&rough, &near)));
    let best = best.into_iter().take(MAX_REFINED);
    let found = best.filter_map(|(_, post)| fine(post, posed, (judge, &reference)));
    let (score, post) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (score > before + MIN_GAIN).then_some(post)
}

/// Plan without the posts that do not gain their price; `None` if all of them do.
pub(crate) fn without_idle_posts(posed: &PosedPlan, judge: &Judge) -> Option<PosedPlan> {
    let mut kept = posed.clone();
    let mut score = score_with_posts(&kept, judge);
    for at in (0..posed.posts.len()).rev() {
        let fewer = without_post(&kept, at);
        let without = score_with_posts(&fewer, judge);
        if without > score - MIN_GAIN {
            (kept, score) = (fewer, without);
        }
    }
    (kept.posts.len() < posed.posts.len()).then_some(kept)
}

/// Loss of score without each post, others unchanged, nats.
pub(crate) fn evidence_nats(posed: &PosedPlan, judge: &Judge) -> Vec<f64> {
    let score = score_with_posts(posed, judge);
    let of = |at| score - score_with_posts(&without_post(posed, at), judge);
    (0..posed.posts.len()).map(of).collect()
}

/// Score of a plan with its own posts, from the poses of a judge.
fn score_with_posts(posed: &PosedPlan, judge: &Judge) -> f64 {
    judge.with_posts(&posed.posts).score_segments(&posed.plan.segments(&posed.walls))
}

fn without_post(posed: &PosedPlan, at: usize) -> PosedPlan {
    let mut fewer = posed.clone();
    fewer.posts.remove(at);
    fewer
}

/// Posts on which unexplained arcs of several sweeps agree, those of most beams first.
fn candidates(posed: &PosedPlan, kind: PostKind, left: &[&Arc]) -> Vec<PostShape> {
    let seed = |arc: &&Arc| {
        let pose = &posed.poses[arc.sweep];
        let radius_m = RADIUS_PRIOR_M[0];
        let center = arc.point_at(pose, arc.range_m + radius_m);
        fitted(PostShape { center, radius_m }, left, &posed.poses)
    };
    let mut found: Vec<FittedPost> = left.iter().filter_map(seed).collect();
    found.retain(|of| kind == PostKind::Any || of.post.radius_m > ROUND * of.sigma_radius_m);
    found.sort_by_key(|of| std::cmp::Reverse(of.beams));
    let mut distinct: Vec<PostShape> = Vec::new();
    for FittedPost { post, .. } in found {
        let is_same = |known: &PostShape| known.center.distance(post.center) < SAME_M;
        if !distinct.iter().any(is_same) {
            distinct.push(post);
        }
    }
    distinct.truncate(MAX_CANDIDATES);
    distinct
}

/// Post fitted to arcs.
struct FittedPost {
    post: PostShape,
    /// Standard deviation of the radius, metres.
    sigma_radius_m: f64,
    /// Number of beams of the arcs.
    beams: usize,
}

/// Post fitted to the arcs that agree with it; `None` if too few sweeps have such arcs.
///
/// The range of the echo is `|c - p| - r`, the bearing that of the centre `c`.
fn fitted(seed: PostShape, left: &[&Arc], poses: &[Pose]) -> Option<FittedPost> {
    const STEPS: usize = 6;
    let (mut post, mut sigma_radius_m) = (seed, f64::INFINITY);
    let mut own: Vec<&Arc> = Vec::new();
    for step in 0..STEPS {
        // The radius is unknown at first.
        let gate_m = if step < 2 { GATE_M + RADIUS_PRIOR_M[1] } else { GATE_M };
        own = left.iter().copied().filter(|arc| agrees(&post, arc, poses, gate_m)).collect();
        let mut normal = NormalEquations::new(3);
        for arc in &own {
            let pose = &poses[arc.sweep];
            let to = post.center - arc.place(pose);
            let distance_m = to.length().max(1e-6);
            let axis = to / distance_m;
            let off_m = arc.range_m - (distance_m - post.radius_m);
            let row = [(0, axis.x), (1, axis.y), (2, -1.0)];
            normal.add(&row, off_m, arc.errors.sigma_m(SIGMA_M), ROBUST);
            let across = axis.perp() / distance_m;
            let off_rad = wrap_pi(pose.direction_rad(arc.azimuth_deg) - to.to_angle());
            let sigma_rad = arc.sigma_deg().to_radians();
            normal.add(&[(0, across.x), (1, across.y)], off_rad, sigma_rad, ROBUST);
        }
        let [mean_m, sigma_m] = RADIUS_PRIOR_M;
        normal.add(&[(2, 1.0)], mean_m - post.radius_m, sigma_m, 1e3);
        let by = normal.step(1e-6)?;
        post = post.moved([by[0], by[1], by[2]]);
        sigma_radius_m = normal.covariance()?[(2, 2)].sqrt();
    }
    let mut sweeps: Vec<usize> = own.iter().map(|arc| arc.sweep).collect();
    sweeps.sort_unstable();
    sweeps.dedup();
    let beams = own.iter().map(|arc| arc.beams.len()).sum();
    let is_agreed = sweeps.len() >= MIN_SWEEPS && post.center.is_finite();
    is_agreed.then_some(FittedPost { post, sigma_radius_m, beams })
}

/// Post improved by steps that become smaller, with the score of the plan; `None` if the scene has
/// more paths than the model follows.
fn fine(
    from: PostShape,
    posed: &PosedPlan,
    (judge, reference): (&Judge, &ReferencePlan),
) -> Option<(f64, PostShape)> {
    const MAX_STEPS: usize = 3;
    let walls = posed.plan.segments(&posed.walls);
    let near = |post: &PostShape, own: &Judge| {
        let with = own.with_posts(&with_post(posed, post));
        reference.rescored(own).followed_by(&with, &walls)
    };
    let mut best = from;
    for step_m in FINE_M {
        let own = judge.with_sigma(judge.sigma_m.max(0.5 * step_m));
        let near = near(&best, &own)?;
        let neighbours = |post: &PostShape| {
            let moved = (0..6).map(|at| {
                let mut by = [0.0; 3];
                by[at / 2] = if at % 2 == 0 { step_m } else { -step_m };
                post.moved(by)
            });
            moved.collect()
        };
        let score = |post: &PostShape| score_of(post, posed, (&own, &near));
        (_, best) = climbed(best, MAX_STEPS, neighbours, score);
    }
    let score = score_of(&best, posed, (judge, &near(&best, judge)?));
    Some((score.unwrap_or(f64::NEG_INFINITY), best))
}

/// Score of a plan with one more post, by the predictions of one that differs little; `None` where no
/// post can be.
fn score_of(
    post: &PostShape,
    posed: &PosedPlan,
    (judge, reference): (&Judge, &ReferencePlan),
) -> Option<f64> {
    let walls = posed.plan.segments(&posed.walls);
    is_clear(post, &walls, posed).then(|| {
        let with = judge.with_posts(&with_post(posed, post));
        let context = ScoreContext::default().near(Some(reference));
        with.score_segments_above(&walls, context).unwrap_or(UNSCORED)
    })
}

/// Posts of a plan with one more.
fn with_post(posed: &PosedPlan, post: &PostShape) -> Vec<PostShape> {
    [&posed.posts[..], &[*post]].concat()
}

/// Returns `true` if range and middle of an arc agree with an echo from the surface.
fn agrees(post: &PostShape, arc: &Arc, poses: &[Pose], gate_m: f64) -> bool {
    let pose = &poses[arc.sweep];
    let to = post.center - arc.place(pose);
    let off_m = arc.range_m - (to.length() - post.radius_m);
    let off_rad = wrap_pi(pose.direction_rad(arc.azimuth_deg) - to.to_angle());
    off_m.abs() < arc.errors.gate_m(gate_m) && off_rad.abs() < GATE_RAD[usize::from(arc.is_cut)]
}

/// Returns `true` if no pose, wall or other post is inside or at the surface.
fn is_clear(post: &PostShape, walls: &[Segment], posed: &PosedPlan) -> bool {
    let from_pose_m = post.radius_m + CLEAR_OF_POSES_M;
    let is_free = |other: &PostShape| {
        other.center.distance(post.center) > post.radius_m + CLEAR_M + other.radius_m
    };
    posed.poses.iter().all(|pose| pose.position().distance(post.center) > from_pose_m)
        && post.is_clear_of(walls)
        && posed.posts.iter().all(is_free)
}

//! Hypotheses about a plan: the plan itself and others that explain the readings nearly as well.

use rayon::prelude::*;
use sonard_model::geometry::{DVec2, Pose};

use super::gaps::closures;
use crate::{
    alternatives::{Assessment, JudgedWall, LISTED_NATS, is_same},
    arrangement::Segment,
    judge::{Judge, ReferencePlan, ScoreContext},
    posed::PosedPlan,
    post::PostShape,
    result::{OpenPart, PieceStatus, SurveyedPost, WallPiece},
};

/// Maximum number of hypotheses, the most probable first.
const MAX_HYPOTHESES: usize = 20;
/// Minimum length of what remains of a wall, metres.
const MIN_WALL_M: f64 = 0.004;

/// Walls and posts with their score.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hypothesis {
    /// Difference from the plan; `None` for the plan itself.
    pub(super) part: Option<OpenPart>,
    pub(super) segments: Vec<Segment>,
    pub(super) posts: Vec<PostShape>,
    /// Score relative to that of the plan, nats.
    pub(super) nats: f64,
}

/// Hypotheses within 10 nats of a plan, each once, the plan itself first.
pub(super) fn hypotheses(
    posed: &PosedPlan,
    judge: &Judge,
    assessment: &Assessment,
    posts: &[SurveyedPost],
) -> Vec<Hypothesis> {
    let segments = posed.plan.segments(&posed.walls);
    let plan = Hypothesis { part: None, segments, posts: posed.posts.clone(), nats: 0.0 };
    let score = judge.score(&posed.plan, &posed.walls);
    let reference = ReferencePlan::new(judge, &plan.segments);
    let above = |floor: f64| ScoreContext::above(floor).near(reference.as_ref());
    let with_score = |mut of: Hypothesis| {
        of.nats =
            judge.score_segments_above(&of.segments, above(score - LISTED_NATS)).ok()? - score;
        Some(of)
    };
    let stretches = without_stretches(&plan, assessment).into_par_iter().filter_map(with_score);
    let mut others: Vec<Hypothesis> = stretches.collect();
    others.extend(with_closed_gaps(&plan, judge, reference.as_ref()));
    others.extend(without_posts(&plan, posts));
    others.extend(alternatives(&plan, assessment));
    others.retain(|of| of.nats > -LISTED_NATS);
    // Of equal plans the first remains, which has the narrower description.
    let mut found = vec![plan];
    for of in others {
        let is_known =
            |known: &Hypothesis| known.posts == of.posts && is_same(&known.segments, &of.segments);
        if !found.iter().any(is_known) {
            found.push(of);
        }
    }
    found[1..].sort_by(|a, b| b.nats.total_cmp(&a.nats));
    found.truncate(MAX_HYPOTHESES);
    found
}

/// Plans without one of the stretches that are not observed.
fn without_stretches(plan: &Hypothesis, assessment: &Assessment) -> Vec<Hypothesis> {
    let without = |(at, wall): (usize, &JudgedWall), piece: &WallPiece| {
        let others = plan.segments.iter().filter(|of| **of != wall.segment).copied();
        let ends =
            [[wall.segment.a.to_array(), piece.from_m], [piece.to_m, wall.segment.b.to_array()]];
        let rest = ends.map(|[a, b]| Segment { a: a.into(), b: b.into(), ..wall.segment });
        let rest = rest.into_iter().filter(|of| of.length_m() > MIN_WALL_M);
        let (from_m, to_m) = (piece.from_m, piece.to_m);
        Hypothesis {
            part: Some(OpenPart::Wall { wall: format!("wall-{}", at + 1), from_m, to_m }),
            segments: others.chain(rest).collect(),
            ..plan.clone()
        }
    };
    let walls = assessment.walls.iter().enumerate();
    let open = walls.flat_map(|(at, wall)| {
        let pieces = wall.pieces.iter().filter(|of| of.status != PieceStatus::Observed);
        pieces.map(move |piece| without((at, wall), piece))
    });
    open.collect()
}

/// Plans with a gap between free ends closed, by their likelihood alone.
///
/// The price of walls is a prior of walls that readings show. Where readings show nothing, a room
/// may go on or end. A closure that explains more than the plan counts as much as the plan.
fn with_closed_gaps(
    plan: &Hypothesis,
    judge: &Judge,
    reference: Option<&ReferencePlan>,
) -> Vec<Hypothesis> {
    let stops: Vec<DVec2> = judge.poses.iter().map(Pose::position).collect();
    let own_nats = judge.log_likelihood(&plan.segments);
    let closed = |added: Vec<Segment>| {
        let segments = [&plan.segments[..], &added].concat();
        let context = ScoreContext::above(own_nats - LISTED_NATS).near(reference);
        let nats = judge.log_likelihood_above(&segments, context).ok()? - own_nats;
        let ends = |of: &Segment| [of.a, of.b].map(|end| end.to_array());
        let part = Some(OpenPart::Gap { walls: added.iter().map(ends).collect() });
        Some(Hypothesis { part, segments, nats: nats.min(0.0), ..plan.clone() })
    };
    closures(&plan.segments, &stops).into_par_iter().filter_map(closed).collect()
}

/// Plans without one of the posts that are not observed.
fn without_posts(plan: &Hypothesis, posts: &[SurveyedPost]) -> Vec<Hypothesis> {
    let numbered = posts.iter().enumerate();
    let open = numbered.filter(|(_, post)| post.status != PieceStatus::Observed);
    let without = |(at, post): (usize, &SurveyedPost)| {
        let mut of = plan.clone();
        of.posts.remove(at);
        of.part = Some(OpenPart::Post { post: post.id.clone() });
        of.nats = -post.evidence_nats;
        of
    };
    open.map(without).collect()
}

fn alternatives(plan: &Hypothesis, assessment: &Assessment) -> Vec<Hypothesis> {
    let listed = (1..).zip(&assessment.alternatives);
    let hypothesis = |(number, (segments, nats)): (usize, &(Vec<Segment>, f64))| Hypothesis {
        part: Some(OpenPart::Alternative { number }),
        segments: segments.clone(),
        nats: *nats,
        ..plan.clone()
    };
    listed.map(hypothesis).collect()
}

//! Result of a survey from its final plan.

use std::collections::BTreeSet;

use sonard_inverse::FitSweep;
use sonard_model::{model::Prediction, reading::PathKind};

use crate::{
    alternatives::{Assessment, JudgedWall, LISTED_NATS},
    arrangement::LineArrangement,
    covariance::PlanCovariance,
    judge::{Judge, Predictions, outcome_of},
    next_view::find_next_view,
    options::SurveyOptions,
    posed::PosedPlan,
    posts::evidence_nats,
    readings::{Beam, Outcome},
    result::{
        AlternativePlan, PieceStatus, ReadingCause, SearchEnd, SensorFit, Survey, SurveyedEnd,
        SurveyedPose, SurveyedPost, SurveyedWall, UnexplainedArc,
    },
    rows::direct_post,
    spots::consistent_arcs,
    symmetry::equivalent_poses,
    trace::unexplained,
    workspace::Workspace,
};

/// Minimum number of sweeps whose direct echoes determine a post.
const MIN_POST_SWEEPS: usize = 2;
/// Standard deviation of centre and radius up to which a post is determined, metres.
const MAX_POST_SIGMA_M: f64 = 0.01;

pub(crate) fn report(
    sweeps: &[FitSweep],
    posed: &PosedPlan,
    assessment: &Assessment,
    covariance: &Option<PlanCovariance>,
    workspace: &Workspace,
    (end, options, fitted): (SearchEnd, &SurveyOptions, Option<SensorFit>),
) -> Survey {
    let judge = Judge::of(workspace, posed, workspace.errors.final_sigma_m());
    let explained_m = workspace.errors.explained_m();
    let score = judge.score(&posed.plan, &posed.walls);
    let predictions = judge.predictions(&posed.plan.segments(&posed.walls));
    let predictions = predictions.map(|(_, predictions)| predictions).unwrap_or_default();
    let left = match predictions.is_empty() {
        true => workspace.arcs.iter().flatten().collect(),
        false => unexplained(workspace, &predictions),
    };
    let causes = workspace.readings.iter().zip(&predictions).map(|(readings, predictions)| {
        readings
            .beams
            .iter()
            .zip(predictions)
            .map(|(beam, of)| cause(beam, of, explained_m))
            .collect()
    });
    let covariance = covariance.as_ref();
    let equivalent = equivalent_poses(posed, &judge);
    let (alternatives, probability) = weighted(assessment);
    let posts = surveyed_posts(posed, &judge, &predictions, covariance);
    // The scenes of the search, without those of the next view.
    let scored_scenes = workspace.scored();
    let open = (&posts[..], left.len());
    let (open_nats, next_view) = find_next_view(posed, &judge, assessment, open, options);
    Survey {
        walls: assessment
            .walls
            .iter()
            .enumerate()
            .map(|(at, wall)| surveyed(at, wall, &posed.plan, covariance))
            .collect(),
        posts,
        poses: sweeps
            .iter()
            .zip(equivalent)
            .enumerate()
            .map(|(at, (sweep, equivalent))| {
                let sigma = covariance.map(|covariance| covariance.pose_sigma(at));
                SurveyedPose {
                    scan: sweep.scan,
                    pose: posed.poses[at],
                    sigma_m: sigma.map(|[x, y, _]| [x, y]),
                    sigma_heading_deg: sigma.map(|[.., heading]| heading),
                    equivalent,
                }
            })
            .collect(),
        score,
        oblique_nats: judge.oblique_nats(&posed.plan.segments(&posed.walls)),
        arcs: workspace.arcs.iter().map(Vec::len).sum(),
        unexplained: left
            .iter()
            .map(|arc| UnexplainedArc {
                sweep: arc.sweep,
                azimuth_deg: arc.azimuth_deg,
                range_m: arc.range_m,
                beams: arc.beams.len(),
            })
            .collect(),
        causes: causes.collect(),
        alternatives,
        probability,
        open_nats,
        next_view,
        end,
        scored_scenes,
        reflectance: options.reflectance,
        fitted,
    }
}

/// Alternatives with probabilities by their scores, and the probability of the best plan.
fn weighted(assessment: &Assessment) -> (Vec<AlternativePlan>, f64) {
    let weights: Vec<f64> =
        assessment.alternatives.iter().map(|(_, difference)| difference.exp()).collect();
    let sum = 1.0 + weights.iter().sum::<f64>();
    let plans = assessment.alternatives.iter().zip(weights);
    let plans = plans.map(|((walls, score_difference), weight)| AlternativePlan {
        walls: walls.iter().map(|wall| [wall.a.to_array(), wall.b.to_array()]).collect(),
        score_difference: *score_difference,
        probability: weight / sum,
    });
    (plans.collect(), 1.0 / sum)
}

fn surveyed(
    at: usize,
    wall: &JudgedWall,
    plan: &LineArrangement,
    covariance: Option<&PlanCovariance>,
) -> SurveyedWall {
    let run = &wall.run;
    let end = |cut: usize, at_m: [f64; 2]| {
        let by = plan.cuts[run.line][cut].by;
        let corner = |by: usize| covariance?.corner([run.line, by], plan);
        SurveyedEnd { at_m, covariance_m2: by.and_then(corner) }
    };
    SurveyedWall {
        id: format!("wall-{}", at + 1),
        from: end(run.first, wall.segment.a.to_array()),
        to: end(run.last + 1, wall.segment.b.to_array()),
        sigma_direction_deg: wall.sigma.map(|[direction_deg, _]| direction_deg),
        sigma_across_m: wall.sigma.map(|[_, across_m]| across_m),
        evidence_nats: wall.evidence_nats,
        pieces: wall.pieces.clone(),
    }
}

/// Posts with their status: observed if direct echoes from two sweeps or more determine it and the
/// plan without it scores more than 10 nats worse.
fn surveyed_posts(
    posed: &PosedPlan,
    judge: &Judge,
    predictions: &Predictions,
    covariance: Option<&PlanCovariance>,
) -> Vec<SurveyedPost> {
    let explained = match predictions.is_empty() {
        true => Vec::new(),
        false => consistent_arcs(judge, predictions).unwrap_or_default(),
    };
    let sweeps_of = |post: usize| {
        let own = explained.iter().filter(|of| of.path().and_then(direct_post) == Some(post));
        own.map(|of| of.arc.sweep).collect::<BTreeSet<usize>>().len()
    };
    let surveyed = |(at, evidence_nats): (usize, f64)| {
        let sigma = covariance.and_then(|of| of.post_sigma(at));
        let sweeps = sweeps_of(at);
        let is_determined = sigma.is_some_and(|of| of.iter().all(|m| *m < MAX_POST_SIGMA_M));
        let is_observed = sweeps >= MIN_POST_SWEEPS && is_determined && evidence_nats > LISTED_NATS;
        SurveyedPost {
            id: format!("post-{}", at + 1),
            center_m: posed.posts[at].center.to_array(),
            radius_m: posed.posts[at].radius_m,
            sigma_m: sigma.map(|[x, y, _]| [x, y]),
            sigma_radius_m: sigma.map(|[.., radius]| radius),
            evidence_nats,
            sweeps,
            status: match is_observed {
                true => PieceStatus::Observed,
                false => PieceStatus::Conjectured,
            },
        }
    };
    evidence_nats(posed, judge).into_iter().enumerate().map(surveyed).collect()
}

fn cause(beam: &Beam, prediction: &Prediction, explained_m: f64) -> ReadingCause {
    let path = prediction.arrival.as_ref().map(|arrival| &arrival.path);
    match (beam.outcome, outcome_of(prediction), path) {
        (Outcome::Echo(measured_m), Outcome::Echo(expected_m), Some(path))
            if (measured_m - expected_m).abs() < explained_m =>
        {
            match path.kind() {
                PathKind::Diffracted => ReadingCause::Edge,
                _ if path.order() > 1 => ReadingCause::Multiple,
                _ => ReadingCause::First,
            }
        }
        (Outcome::NoEcho, Outcome::NoEcho, _)
        | (Outcome::BelowMinRange, Outcome::BelowMinRange, _) => ReadingCause::NoRange,
        _ => ReadingCause::Unexplained,
    }
}

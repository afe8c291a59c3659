//! Next best view: the pose from which a full turn of a stepper, or a round of an array, resolves most of
//! what a survey leaves open.

mod free_space;
mod gaps;
mod hypotheses;
mod overlap;
mod pattern;

use rayon::prelude::*;
use sonard_model::{
    geometry::{DVec2, Pose},
    model::Simulator,
};

use crate::{
    alternatives::Assessment,
    judge::Judge,
    options::SurveyOptions,
    posed::PosedPlan,
    readings::Outcome,
    result::{NextView, OpenPart, ResolvedPart, SurveyedPost},
};
use free_space::FreeSpace;
use hypotheses::{Hypothesis, hypotheses};
use overlap::ReadingOverlap;
use pattern::ViewPattern;

/// Entropy of the hypotheses up to which nothing is open, nats: the plan has a probability of 98 %.
const MIN_OPEN_NATS: f64 = 0.1;
/// Expected decrease of that entropy below which a place resolves nothing, nats.
const MIN_GAIN_NATS: f64 = 0.02;
/// Share of the largest gain from which the place farthest from all stops is preferred: it resolves
/// as much, and most of what no hypothesis contains.
const NEAR_BEST: f64 = 0.97;
/// Maximum number of places.
const MAX_PLACES: usize = 3000;
/// Maximum number of predicted beams, all poses and hypotheses together.
const MAX_BEAMS: usize = 300_000;
/// Share of the gain from which a part is listed.
const MIN_SHARE: f64 = 0.02;

/// Entropy of the hypotheses about a plan, nats, and the view that is expected to decrease it most.
///
/// The hypotheses are the plan, its alternatives, and the plan with one change each: without a
/// stretch of wall or a post that is not observed, or with a gap between free ends closed. Their
/// probabilities are by their scores, for gaps by the likelihood. Where no place decides among them
/// but arcs are unexplained, none of them is right, and the view is the place farthest from all
/// stops. The result is independent of the number of threads; it has no view if nothing is open, no
/// place resolves anything, or the observer cancelled.
pub(crate) fn find_next_view(
    posed: &PosedPlan,
    judge: &Judge,
    assessment: &Assessment,
    (posts, unexplained_arcs): (&[SurveyedPost], usize),
    options: &SurveyOptions,
) -> (f64, Option<NextView>) {
    let hypotheses = hypotheses(posed, judge, assessment, posts);
    let weights = Weights::of(&hypotheses);
    let open_nats = weights.entropy_nats();
    let is_open = open_nats > MIN_OPEN_NATS;
    let forecast = is_open.then(|| Forecast::new(judge, &hypotheses, &weights, options)).flatten();
    let view = forecast.and_then(|forecast| best_view(&forecast, posed, judge, options));
    let farthest = || {
        let part = OpenPart::UnexplainedArcs { count: unexplained_arcs };
        let resolves = vec![ResolvedPart { part, probability: 1.0, share: 1.0 }];
        let pose =
            (unexplained_arcs > 0).then(|| farthest_view(posed, judge, options)).flatten()?;
        Some(NextView { pose, gain_nats: 0.0, resolves })
    };
    (open_nats, view.or_else(farthest))
}

/// Reachable place whose distance from the nearest stop is largest.
fn farthest_view(posed: &PosedPlan, judge: &Judge, options: &SurveyOptions) -> Option<Pose> {
    if judge.workspace.observer.is_cancelled() {
        return None;
    }
    let to_stops_m = |place: &DVec2| distance_to_stops_m(*place, posed);
    let places = reachable_places(posed, judge, options.view_reach_m, MAX_PLACES).into_iter();
    let place = places.max_by(|a, b| to_stops_m(a).total_cmp(&to_stops_m(b)))?;
    pose_at(place, posed)
}

/// Places that are reachable in a plan within a distance of a stop, metres, at most `max_count`.
fn reachable_places(
    posed: &PosedPlan,
    judge: &Judge,
    reach_m: f64,
    max_count: usize,
) -> Vec<DVec2> {
    let walls = posed.plan.segments(&posed.walls);
    let free = FreeSpace { walls: &walls, posts: &posed.posts, poses: &posed.poses, judge };
    free.places(reach_m, max_count)
}

/// Distance of a place from the nearest stop, metres.
fn distance_to_stops_m(place: DVec2, posed: &PosedPlan) -> f64 {
    nearest_stop(place, posed).map_or(f64::INFINITY, |stop| stop.position().distance(place))
}

fn nearest_stop(place: DVec2, posed: &PosedPlan) -> Option<&Pose> {
    let distance_m = |stop: &Pose| stop.position().distance(place);
    posed.poses.iter().min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)))
}

/// Pose at a place with the heading of the nearest stop.
fn pose_at(place: DVec2, posed: &PosedPlan) -> Option<Pose> {
    let heading_deg = nearest_stop(place, posed)?.heading_deg;
    Some(Pose { x_m: place.x, y_m: place.y, heading_deg })
}

fn best_view(
    forecast: &Forecast,
    posed: &PosedPlan,
    judge: &Judge,
    options: &SurveyOptions,
) -> Option<NextView> {
    let per_place = forecast.simulators.len() * forecast.pattern.beams_per_place();
    let places = reachable_places(posed, judge, options.view_reach_m, MAX_BEAMS / per_place.max(1));
    let at_place = |place: &DVec2| forecast.pattern.poses_at(pose_at(*place, posed));
    let poses: Vec<Pose> = places.iter().flat_map(at_place).collect();
    let is_cancelled = || judge.workspace.observer.is_cancelled();
    let expected = |pose: &Pose| forecast.terms_at(pose).filter(|_| !is_cancelled());
    let all: Vec<Option<Vec<f64>>> = poses.par_iter().map(expected).collect();
    if is_cancelled() {
        return None;
    }
    let gain_nats = |terms: &[f64]| terms.iter().sum::<f64>();
    let views = || {
        let found = poses.iter().zip(&all);
        found.filter_map(|(pose, terms)| Some((*pose, terms.as_deref()?)))
    };
    let most_nats = views().map(|(_, terms)| gain_nats(terms)).fold(0.0, f64::max);
    let to_stops_m = |pose: &Pose| distance_to_stops_m(pose.position(), posed);
    let (pose, terms) = views()
        .filter(|(_, terms)| gain_nats(terms) >= NEAR_BEST * most_nats)
        .max_by(|a, b| {
            let is_farther = to_stops_m(&a.0).total_cmp(&to_stops_m(&b.0));
            is_farther.then(gain_nats(a.1).total_cmp(&gain_nats(b.1)))
        })
        .filter(|_| most_nats > MIN_GAIN_NATS)?;
    Some(NextView { pose, gain_nats: gain_nats(terms), resolves: forecast.resolved(terms) })
}

/// Probabilities of hypotheses.
struct Weights(Vec<f64>);

impl Weights {
    fn of(hypotheses: &[Hypothesis]) -> Self {
        let most = hypotheses.iter().map(|of| of.nats).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = hypotheses.iter().map(|of| (of.nats - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        Self(weights.into_iter().map(|weight| weight / sum).collect())
    }

    fn entropy_nats(&self) -> f64 {
        // Without the sign of a zero.
        self.0.iter().filter(|p| **p > 0.0).map(|p| -p * p.ln()).sum::<f64>() + 0.0
    }
}

/// Readings that are expected under hypotheses.
struct Forecast<'a> {
    hypotheses: &'a [Hypothesis],
    weights: &'a [f64],
    simulators: Vec<Simulator>,
    overlap: ReadingOverlap,
    pattern: ViewPattern<'a>,
}

impl<'a> Forecast<'a> {
    /// Forecast of given hypotheses; `None` if the scene of one is invalid.
    fn new(
        judge: &'a Judge<'a>,
        hypotheses: &'a [Hypothesis],
        weights: &'a Weights,
        options: &SurveyOptions,
    ) -> Option<Self> {
        let simulator = |of: &Hypothesis| judge.with_posts(&of.posts).simulator_of(&of.segments);
        Some(Self {
            hypotheses,
            weights: &weights.0,
            simulators: hypotheses.iter().map(simulator).collect::<Option<_>>()?,
            overlap: ReadingOverlap::new(judge.sigma_m, judge.workspace.reach_m()),
            pattern: ViewPattern::new(judge, options),
        })
    }

    /// Terms of the expected decrease of entropy by the readings from a pose, nats, one for each
    /// hypothesis: their sum is the gain. `None` if a scene has more paths than the model follows.
    ///
    /// The gain is a lower bound of the mutual information of hypothesis and readings,
    /// `-sum_i p_i ln sum_j p_j exp(-B_ij)` with the Bhattacharyya distances `B_ij` of the readings
    /// under two hypotheses (A. Kolchinsky and B. Tracey, "Estimating mixture entropy with pairwise
    /// distances", Entropy 19(7), 361, 2017, with the Chernoff divergence of 1/2). It never exceeds
    /// the entropy, and is exact where hypotheses give equal readings or exclude each other.
    /// Readings have the likelihood of the score, those of an arc as one. The terms of the plan
    /// itself are divided among the other hypotheses in proportion to their parts of it.
    fn terms_at(&self, pose: &Pose) -> Option<Vec<f64>> {
        let sweeps: Vec<Vec<Outcome>> = self
            .simulators
            .iter()
            .map(|simulator| self.pattern.predict(simulator, pose))
            .collect::<Option<_>>()?;
        let overlap = |a: usize, b: usize| {
            let pairs = sweeps[a].iter().zip(&sweeps[b]);
            let nats: f64 = pairs.map(|(a, b)| self.overlap.distance_nats(*a, *b)).sum();
            (-nats / self.pattern.beams_per_arc()).exp()
        };
        // Parts of the hypotheses in what is distinct from one of them.
        let distinct = |of: usize| -> Vec<f64> {
            (0..sweeps.len())
                .map(|other| self.weights[other] * (1.0 - overlap(of, other)))
                .collect()
        };
        let term =
            |of: usize, parts: &[f64]| -self.weights[of] * (-parts.iter().sum::<f64>()).ln_1p();
        let parts = distinct(PLAN);
        let sum: f64 = parts.iter().sum();
        let of_plan = term(PLAN, &parts);
        let share = |part: f64| if sum > 0.0 { of_plan * part / sum } else { 0.0 };
        let own = |of: usize| if of == PLAN { 0.0 } else { term(of, &distinct(of)) };
        Some((0..sweeps.len()).map(|of| own(of) + share(parts[of])).collect())
    }

    /// Parts of the plan that terms of the gain belong to, the largest first.
    fn resolved(&self, terms: &[f64]) -> Vec<ResolvedPart> {
        let sum: f64 = terms.iter().sum();
        let part = |((of, probability), term): ((&Hypothesis, &f64), &f64)| {
            let (part, share) = (of.part.clone()?, term / sum);
            Some(ResolvedPart { part, probability: *probability, share })
        };
        let all = self.hypotheses.iter().zip(self.weights).zip(terms);
        let mut found: Vec<ResolvedPart> = all.filter_map(part).collect();
        found.retain(|of| of.share > MIN_SHARE);
        found.sort_by(|a, b| b.share.total_cmp(&a.share));
        found
    }
}

/// Index of the plan itself among its hypotheses.
const PLAN: usize = 0;

//! Status of each piece of a plan, and other plans that explain the readings nearly as well.

use sonard_model::geometry::DVec2;

use crate::{
    arrangement::{LineArrangement, PieceSet, Run, Segment},
    covariance::PlanCovariance,
    judge::Judge,
    posed::PosedPlan,
    result::{PieceStatus, WallPiece},
    search::{PlanSearch, ScoredPlan},
    spots::observed_stretches,
};

/// Maximum difference of the score of a listed alternative, nats.
pub(crate) const LISTED_NATS: f64 = 10.0;
/// Loss of score above which a piece is not conjectured, nats.
const IMPLIED_NATS: f64 = 3.0;
/// Evidence above which no plan without a wall is searched, nats.
const CERTAIN_NATS: f64 = 60.0;
/// Maximum standard deviations of the direction of an observed wall, degrees, and of its distance,
/// metres: its 95 % interval is within 6 degrees and 6 cm.
const MAX_SIGMA_DEG: f64 = 3.0;
const MAX_SIGMA_M: f64 = 0.03;
/// Maximum distance of points of plans that are the same, metres.
const SAME_M: f64 = 0.02;

/// Wall with its evidence and pieces.
#[derive(Debug, Clone)]
pub(crate) struct JudgedWall {
    pub(crate) run: Run,
    pub(crate) segment: Segment,
    /// Standard deviations of its direction, degrees, and of its distance at its middle, metres.
    pub(crate) sigma: Option<[f64; 2]>,
    /// Loss of score without the wall, others unchanged, nats.
    pub(crate) evidence_nats: f64,
    pub(crate) pieces: Vec<WallPiece>,
}

/// Plans without one of the walls each, with their difference in score.
pub(crate) struct Assessment {
    pub(crate) walls: Vec<JudgedWall>,
    pub(crate) alternatives: Vec<(Vec<Segment>, f64)>,
    /// Best plan, if one of the alternatives is better than the plan given.
    pub(crate) better: Option<ScoredPlan>,
}

/// Judges each wall by the best plan without it, and each piece by the paths that it reflects.
pub(crate) fn assess(
    posed: &PosedPlan,
    judge: &Judge,
    covariance: Option<&PlanCovariance>,
) -> Assessment {
    let plan = &posed.plan;
    let best = ScoredPlan::new(plan, judge, posed.walls.clone());
    let observed = observed_stretches(plan, &best.walls, judge);
    let mut assessment = Assessment { walls: Vec::new(), alternatives: Vec::new(), better: None };
    for (run, observed) in plan.runs(&best.walls).into_iter().zip(observed) {
        let off: Vec<(usize, bool)> =
            (run.first..=run.last).map(|at| (plan.piece(run.line, at), false)).collect();
        let without = best.with_walls(plan, judge, best.walls.changed(&off));
        let evidence_nats = best.score - without.score;
        let other = (evidence_nats < CERTAIN_NATS)
            .then(|| best_without(plan, judge, without, &best.walls, &run));
        let lead_nats = other.as_ref().map_or(evidence_nats, |other| best.score - other.score);
        if let Some(other) = other {
            assessment.add(plan, &best, &other);
        }
        let lead_nats = lead_nats.min(evidence_nats);
        let segment = plan.segment(&run);
        let middle_m = plan.lines[run.line].along_m(0.5 * (segment.a + segment.b));
        let sigma = covariance.and_then(|covariance| covariance.line_sigma(run.line, middle_m));
        let is_determined = sigma.is_none_or(|[direction_deg, across_m]| {
            direction_deg <= MAX_SIGMA_DEG && across_m <= MAX_SIGMA_M
        });
        // A wall that a listed alternative lacks is not observed, either.
        let is_observed = lead_nats > LISTED_NATS && is_determined;
        let observed = if is_observed { observed } else { Vec::new() };
        let is_needed = lead_nats > IMPLIED_NATS;
        let pieces = pieces(plan, judge, &best, &run, &observed, is_needed);
        assessment.walls.push(JudgedWall { run, segment, sigma, evidence_nats, pieces });
    }
    assessment.alternatives.sort_by(|a, b| b.1.total_cmp(&a.1));
    assessment
}

impl Assessment {
    fn add(&mut self, plan: &LineArrangement, best: &ScoredPlan, other: &ScoredPlan) {
        let difference = other.score - best.score;
        let is_best = self.better.as_ref().is_none_or(|better| other.score > better.score);
        if difference > 0.5 && is_best {
            self.better = Some(other.clone());
        }
        let segments = plan.segments(&other.walls);
        let own = plan.segments(&best.walls);
        let is_known = {
            let known = self.alternatives.iter().map(|(known, _)| known.as_slice());
            known.chain([own.as_slice()]).any(|known| is_same(known, &segments))
        };
        if difference > -LISTED_NATS && !is_known {
            self.alternatives.push((segments, difference));
        }
    }
}

/// Best plan without any of the pieces of a wall.
fn best_without(
    plan: &LineArrangement,
    judge: &Judge,
    without: ScoredPlan,
    walls: &PieceSet,
    run: &Run,
) -> ScoredPlan {
    let mut excluded = PieceSet::new(plan.pieces());
    for at in run.first..=run.last {
        let piece = plan.piece(run.line, at);
        excluded.set(piece, walls.contains(piece));
    }
    let search = PlanSearch { plan, judge, excluded: Some(&excluded) };
    let found = search.climb(without);
    search.trim(found)
}

/// Stretches of a wall by status, neighbours of one status joined.
fn pieces(
    plan: &LineArrangement,
    judge: &Judge,
    best: &ScoredPlan,
    run: &Run,
    observed: &[[f64; 2]],
    is_needed: bool,
) -> Vec<WallPiece> {
    let line = &plan.lines[run.line];
    let mut found: Vec<WallPiece> = Vec::new();
    for at in run.first..=run.last {
        let piece = plan.piece(run.line, at);
        let is_implied = || {
            let without = best.walls.changed(&[(piece, false)]);
            let floor = best.score - IMPLIED_NATS;
            is_needed
                && best.score_of(plan, judge, &without, floor).is_none_or(|without| without < floor)
        };
        let [from_m, to_m] = [at, at + 1].map(|cut| plan.cuts[run.line][cut].along_m);
        for (range_m, is_observed) in split([from_m, to_m], observed) {
            let status = if is_observed {
                PieceStatus::Observed
            } else if is_implied() {
                PieceStatus::Implied
            } else {
                PieceStatus::Conjectured
            };
            let [from_m, to_m] = range_m.map(|along_m| line.at(along_m).to_array());
            match found.last_mut().filter(|last| last.status == status) {
                Some(last) => last.to_m = to_m,
                None => found.push(WallPiece { from_m, to_m, status }),
            }
        }
    }
    found
}

/// Parts of a range inside and outside of ordered stretches, `true` inside.
fn split([from, to]: [f64; 2], stretches: &[[f64; 2]]) -> Vec<([f64; 2], bool)> {
    let mut parts = Vec::new();
    let mut at = from;
    for stretch in stretches {
        let [low, high] = stretch.map(|end| end.clamp(at, to));
        if low < high {
            parts.push(([at, low], false));
            parts.push(([low, high], true));
            at = high;
        }
    }
    parts.push(([at, to], false));
    parts.retain(|([low, high], _)| low < high);
    parts
}

/// Returns `true` if all points of each plan are near the other.
pub(crate) fn is_same(a: &[Segment], b: &[Segment]) -> bool {
    let covers = |a: &[Segment], b: &[Segment]| a.iter().all(|wall| is_covered(wall, b));
    covers(a, b) && covers(b, a)
}

fn is_covered(wall: &Segment, others: &[Segment]) -> bool {
    const STEP_M: f64 = 0.05;
    let count = (wall.length_m() / STEP_M).ceil().max(1.0) as usize;
    let is_near = |point: DVec2| {
        others.iter().any(|other| {
            sonard_model::geometry::distance_to_segment(point, other.a, other.b) < SAME_M
        })
    };
    (0..=count).all(|at| is_near(wall.a.lerp(wall.b, at as f64 / count as f64)))
}

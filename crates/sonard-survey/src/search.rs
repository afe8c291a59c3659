//! Search of the walls of an arrangement: moves as long as they gain.

use std::sync::Arc;

use rayon::prelude::*;
use sonard_model::geometry::Pose;

use crate::{
    arrangement::{LineArrangement, PieceSet, Run},
    judge::{Judge, ROUNDING, ReferencePlan, ScoreContext, UNSCORED},
    line::Foot,
    moves::{MoveFinder, PlanMove, crosses},
    trace::touched_pieces,
};

/// Minimum gain of a move, nats.
const MIN_GAIN: f64 = 0.1;
/// Number of the best moves of a round that are tried again in turn.
const RETRIED: usize = 25;
/// Number of rounds after which pieces that no path meets are removed.
const PRUNED_ROUNDS: usize = 2;
/// Maximum loss by that removal, nats: the next round restores what was needed.
const PRUNING_LOSS: f64 = 12.0;

/// Walls with their score.
#[derive(Debug, Clone)]
pub(crate) struct ScoredPlan {
    pub(crate) walls: PieceSet,
    pub(crate) score: f64,
    /// Predictions; `None` if the scene has more paths than the model follows.
    reference: Option<Arc<ReferencePlan>>,
}

impl ScoredPlan {
    /// Scores walls of an arrangement.
    pub(crate) fn new(plan: &LineArrangement, judge: &Judge, walls: PieceSet) -> Self {
        let reference = ReferencePlan::new(judge, &plan.segments(&walls)).map(Arc::new);
        Self::with_reference(plan, judge, walls, reference)
    }

    /// Scores other walls by the predictions of this plan.
    pub(crate) fn with_walls(
        &self,
        plan: &LineArrangement,
        judge: &Judge,
        walls: PieceSet,
    ) -> Self {
        let segments = plan.segments(&walls);
        let reference = match self.reference() {
            Some(known) => known.followed_by(judge, &segments),
            None => ReferencePlan::new(judge, &segments),
        };
        Self::with_reference(plan, judge, walls, reference.map(Arc::new))
    }

    fn with_reference(
        plan: &LineArrangement,
        judge: &Judge,
        walls: PieceSet,
        reference: Option<Arc<ReferencePlan>>,
    ) -> Self {
        let context = ScoreContext::default().near(reference.as_deref());
        let score = judge.score_above(plan, &walls, context).unwrap_or(UNSCORED);
        Self { walls, score, reference }
    }

    /// Predictions of the plan, by which others are scored that differ little.
    pub(crate) fn reference(&self) -> Option<&ReferencePlan> {
        self.reference.as_deref()
    }

    /// Score of other walls, nats; `None` unless it is above a floor.
    pub(crate) fn score_of(
        &self,
        plan: &LineArrangement,
        judge: &Judge,
        walls: &PieceSet,
        floor: f64,
    ) -> Option<f64> {
        judge.score_above(plan, walls, ScoreContext::above(floor).near(self.reference()))
    }
}

/// Search over the pieces of an arrangement.
pub(crate) struct PlanSearch<'a> {
    pub(crate) plan: &'a LineArrangement,
    pub(crate) judge: &'a Judge<'a>,
    /// Pieces that may not become walls.
    pub(crate) excluded: Option<&'a PieceSet>,
}

impl PlanSearch<'_> {
    /// Improves walls until no move gains.
    pub(crate) fn climb(&self, from: ScoredPlan) -> ScoredPlan {
        let finder = MoveFinder::new(self.plan, &self.judge.poses);
        let mut best = from;
        for round in 1.. {
            if self.is_over() {
                break;
            }
            let gaining = self.gaining(&best, finder.moves(&best.walls));
            let mut is_changed = false;
            for change in gaining.iter().take(RETRIED) {
                is_changed |= self.try_move(&mut best, change, MIN_GAIN);
                if self.is_over() {
                    break;
                }
            }
            if !is_changed {
                break;
            }
            if round <= PRUNED_ROUNDS {
                let pruned = self.without_unmet(&best.walls);
                let pruned = best.with_walls(self.plan, self.judge, pruned);
                if pruned.score > best.score - PRUNING_LOSS {
                    best = pruned;
                }
            }
        }
        best
    }

    /// Removes what no reading needs: ends beyond the last crossing that matters, walls that cost
    /// more than they explain, and pairs of ends that meet behind a third wall.
    pub(crate) fn trim(&self, from: ScoredPlan) -> ScoredPlan {
        /// Loss up to which a whole wall is removed, and two ends, nats.
        const WHOLE: f64 = 0.5;
        const PAIR: f64 = 0.2;
        let mut best = from;
        while !self.is_over() {
            let runs = self.plan.runs(&best.walls);
            let pair = pairs_behind(self.plan, &best.walls, &runs)
                .into_iter()
                .any(|change| self.try_move(&mut best, &change, -PAIR));
            let single = !pair
                && runs.iter().any(|run| {
                    shortened(self.plan, run).into_iter().any(|change| {
                        let is_whole = change.len() == run.last - run.first + 1;
                        let loss = if is_whole { WHOLE } else { 0.0 };
                        self.try_move(&mut best, &change, -loss)
                    })
                });
            if !pair && !single {
                break;
            }
        }
        best
    }

    fn is_over(&self) -> bool {
        self.judge.workspace.is_over()
    }

    /// Moves that gain, best first.
    fn gaining(&self, from: &ScoredPlan, moves: Vec<PlanMove>) -> Vec<PlanMove> {
        let allowed = |change: &PlanMove| {
            self.excluded.is_none_or(|excluded| {
                change.iter().all(|&(piece, is_wall)| !is_wall || !excluded.contains(piece))
            })
        };
        let mut scored: Vec<(f64, PlanMove)> = moves
            .into_par_iter()
            .filter(allowed)
            .filter_map(|change| {
                let walls = from.walls.changed(&change);
                let floor = from.score + MIN_GAIN;
                let score = from.score_of(self.plan, self.judge, &walls, floor)?;
                Some((score - from.score, change))
            })
            .collect();
        scored.retain(|(gain, _)| *gain > MIN_GAIN);
        // Equal gains of different changes differ by rounding.
        let rounded = |gain: f64| (gain / ROUNDING).round();
        let order = |a: f64, b: f64| rounded(b).total_cmp(&rounded(a));
        scored.sort_by(|a, b| order(a.0, b.0).then_with(|| a.1.cmp(&b.1)));
        scored.into_iter().map(|(_, change)| change).collect()
    }

    /// Applies a move if it gains more than `min_gain`.
    fn try_move(&self, best: &mut ScoredPlan, change: &PlanMove, min_gain: f64) -> bool {
        let walls = best.walls.changed(change);
        let floor = best.score + min_gain;
        let score = best.score_of(self.plan, self.judge, &walls, floor);
        let is_better = walls != best.walls && score.is_some_and(|score| score > floor);
        if is_better {
            *best = best.with_walls(self.plan, self.judge, walls);
        }
        is_better
    }

    /// Walls without the ends that no path of an explained arc meets.
    fn without_unmet(&self, walls: &PieceSet) -> PieceSet {
        let Some(met) = touched_pieces(self.plan, walls, self.judge) else { return walls.clone() };
        let mut kept = PieceSet::new(self.plan.pieces());
        for run in self.plan.runs(walls) {
            let is_met = |at: &usize| self.plan.is_wall(&met, run.line, *at);
            let mut pieces = run.first..=run.last;
            let (Some(first), Some(last)) = (pieces.clone().find(is_met), pieces.rfind(is_met))
            else {
                continue;
            };
            (first..=last).for_each(|at| kept.set(self.plan.piece(run.line, at), true));
        }
        kept
    }
}

/// Walls at the feet of perpendiculars that nothing known hides, nearest first.
pub(crate) fn initial_walls(plan: &LineArrangement, poses: &[Pose]) -> PieceSet {
    let mut walls = PieceSet::new(plan.pieces());
    let lines = plan.lines.iter().enumerate();
    let mut feet: Vec<(usize, &Foot)> =
        lines.flat_map(|(at, line)| line.feet.iter().map(move |foot| (at, foot))).collect();
    feet.sort_by(|a, b| a.1.range_m.total_cmp(&b.1.range_m).then(a.0.cmp(&b.0)));
    for (line, foot) in feet {
        let from = poses[foot.sweep].position();
        let to = plan.lines[line].at(foot.along_m);
        let before = from + (to - from) * (1.0 - 0.03 / foot.range_m.max(0.05));
        let is_hidden =
            plan.segments(&walls).iter().any(|wall| crosses([from, before], [wall.a, wall.b]));
        if !is_hidden {
            walls.set(plan.piece(line, plan.piece_at(line, foot.along_m)), true);
        }
    }
    walls
}

/// Shorter versions of a wall, the shortest first, beginning with none.
fn shortened(plan: &LineArrangement, run: &Run) -> Vec<PlanMove> {
    let off = |pieces: std::ops::Range<usize>| {
        pieces.map(|at| (plan.piece(run.line, at), false)).collect::<PlanMove>()
    };
    let count = run.last - run.first + 1;
    let mut found = vec![off(run.first..run.last + 1)];
    for removed in (1..count).rev() {
        found.push(off(run.first..run.first + removed));
        found.push(off(run.last + 1 - removed..run.last + 1));
    }
    found
}

/// Pairs of walls that meet at an end beyond other walls, both shortened to those.
fn pairs_behind(plan: &LineArrangement, walls: &PieceSet, runs: &[Run]) -> Vec<PlanMove> {
    const SAME_M: f64 = 0.01;
    let ends: Vec<_> = runs
        .iter()
        .flat_map(|run| {
            let segment = plan.segment(run);
            [(segment.a, run, true), (segment.b, run, false)]
        })
        .collect();
    let mut found = Vec::new();
    for (at, (end, run, is_first)) in ends.iter().enumerate() {
        for (other_end, other, is_other_first) in &ends[at + 1..] {
            if run.line == other.line || end.distance(*other_end) > SAME_M {
                continue;
            }
            let both = [run.line, other.line];
            let ways = [
                inward(plan, walls, run, *is_first, both),
                inward(plan, walls, other, *is_other_first, both),
            ];
            if let [Some(mut change), Some(second)] = ways {
                change.extend(second);
                found.push(change);
            }
        }
    }
    found
}

/// Pieces from an end of a wall to the next crossing with a wall of another line.
fn inward(
    plan: &LineArrangement,
    walls: &PieceSet,
    run: &Run,
    is_first: bool,
    except: [usize; 2],
) -> Option<PlanMove> {
    let count = run.last - run.first + 1;
    let mut change = Vec::new();
    for step in 0..count {
        let at = if is_first { run.first + step } else { run.last - step };
        change.push((plan.piece(run.line, at), false));
        let cut = if is_first { at + 1 } else { at };
        let by = plan.cuts[run.line][cut].by;
        if by.is_some_and(|by| !except.contains(&by)) && plan.is_met(walls, run.line, cut) {
            return (step + 1 < count).then_some(change);
        }
    }
    None
}

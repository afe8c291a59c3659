//! Walls at feet of perpendiculars that other walls hide.

use std::collections::BTreeSet;

use sonard_model::geometry::{DVec2, Pose};

use super::plan_move::{PlanMove, to_next_wall};
use crate::{
    arrangement::{LineArrangement, PieceSet, Run},
    line::Foot,
};

/// Maximum number of hiding walls that give way.
const MAX_HIDING: usize = 2;
/// Distance before a foot at which nothing may hide it, metres.
const BEFORE_FOOT_M: f64 = 0.03;

/// Piece of a run that hides a foot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct HidingPiece {
    line: usize,
    first: usize,
    at: usize,
    last: usize,
}

/// Proposes walls at feet, together with the removal of the walls before them.
pub(super) fn uncover(
    plan: &LineArrangement,
    walls: &PieceSet,
    runs: &[Run],
    poses: &[Pose],
) -> Vec<PlanMove> {
    let mut found = Vec::new();
    for line in 0..plan.lines.len() {
        let mut covered: BTreeSet<(usize, Vec<HidingPiece>)> = BTreeSet::new();
        for foot in &plan.lines[line].feet {
            let at = plan.piece_at(line, foot.along_m);
            if !plan.is_inner(line, at) {
                continue;
            }
            let hiding = hiding(plan, runs, line, foot, poses);
            if hiding.len() <= MAX_HIDING && !(hiding.is_empty() && plan.is_wall(walls, line, at)) {
                covered.insert((at, hiding));
            }
        }
        let feet: BTreeSet<usize> = covered.iter().map(|of| of.0).collect();
        for (at, hiding) in &covered {
            found.extend(variants(plan, walls, (line, *at), hiding, &feet));
        }
    }
    found
}

/// Pieces of other walls between a place and the foot of its perpendicular.
fn hiding(
    plan: &LineArrangement,
    runs: &[Run],
    line: usize,
    foot: &Foot,
    poses: &[Pose],
) -> Vec<HidingPiece> {
    let from = poses[foot.sweep].position();
    let to = plan.lines[line].at(foot.along_m);
    let before = from + (to - from) * (1.0 - BEFORE_FOOT_M / foot.range_m.max(0.05));
    let others = runs.iter().filter(|run| run.line != line);
    let pieces = others.flat_map(|&Run { line, first, last }| {
        (first..=last).map(move |at| HidingPiece { line, first, at, last })
    });
    pieces.filter(|of| crosses([from, before], plan.ends_of(of.line, of.at))).collect()
}

/// Returns `true` if the inside of the first segment meets the second one.
pub(crate) fn crosses([p, q]: [DVec2; 2], [a, b]: [DVec2; 2]) -> bool {
    const INSIDE: f64 = 1e-6;
    let (along, across) = (q - p, b - a);
    let sine = along.perp_dot(across);
    if sine.abs() < 1e-12 {
        return false;
    }
    let on_first = (a - p).perp_dot(across) / sine;
    let on_second = (a - p).perp_dot(along) / sine;
    on_first > INSIDE && on_first < 1.0 - INSIDE && (0.0..=1.0).contains(&on_second)
}

/// Walls at a foot alone, at all feet of the line, or on to the next walls; with only the hiding
/// pieces removed, or one half of the hiding walls.
fn variants(
    plan: &LineArrangement,
    walls: &PieceSet,
    (line, at): (usize, usize),
    hiding: &[HidingPiece],
    feet: &BTreeSet<usize>,
) -> Vec<PlanMove> {
    let on = |at: usize| (plan.piece(line, at), true);
    let beside = [
        at.checked_add(1).and_then(|next| to_next_wall(plan, walls, (line, next), true)),
        at.checked_sub(1).and_then(|next| to_next_wall(plan, walls, (line, next), false)),
    ];
    let extended: Vec<usize> = beside.into_iter().flatten().flatten().collect();
    let mut found = Vec::new();
    for half in 0..3 {
        let mut change = vec![on(at)];
        for of in hiding {
            let removed = match half {
                0 => of.at..=of.at,
                1 => of.at..=of.last,
                _ => of.first..=of.at,
            };
            change.extend(removed.map(|at| (plan.piece(of.line, at), false)));
        }
        let with = |more: &mut dyn Iterator<Item = usize>| {
            change.iter().copied().chain(more.map(on)).collect::<PlanMove>()
        };
        if let (Some(&first), Some(&last)) = (feet.first(), feet.last())
            && first < last
        {
            found.push(with(&mut (first..=last)));
        }
        if !extended.is_empty() {
            found.push(with(&mut extended.iter().copied()));
        }
        found.push(change);
        if hiding.is_empty() {
            break;
        }
    }
    found
}

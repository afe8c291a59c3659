//! Changes of a plan that are worth a trial.

mod block;
mod corner;
mod hidden;
mod plan_move;

use std::collections::BTreeSet;

use sonard_model::geometry::Pose;

use block::blocks;
use corner::corners_at_points;
pub(crate) use hidden::crosses;
use hidden::uncover;
pub(crate) use plan_move::PlanMove;
use plan_move::to_next_wall;

use crate::{
    arrangement::{LineArrangement, PieceSet, Run},
    faces::cells,
};

/// Maximum number of pieces by which an end is retracted, extended, or extended to a corner.
const MAX_RETRACTED: usize = 14;
const MAX_EXTENDED: usize = 8;
const MAX_TO_CORNER: usize = 10;

/// Proposes changes of the walls of an arrangement.
pub(crate) struct MoveFinder<'a> {
    plan: &'a LineArrangement,
    poses: &'a [Pose],
    cells: Vec<Vec<usize>>,
    blocks: Vec<PlanMove>,
    /// Number of feet of perpendiculars on each piece.
    feet: Vec<usize>,
}

/// Moves under construction for given walls.
struct Proposals<'a> {
    plan: &'a LineArrangement,
    walls: &'a PieceSet,
    runs: Vec<Run>,
    found: Vec<PlanMove>,
}

impl<'a> MoveFinder<'a> {
    pub(crate) fn new(plan: &'a LineArrangement, poses: &'a [Pose]) -> Self {
        let mut feet = vec![0; plan.pieces()];
        for (line, of) in plan.lines.iter().enumerate() {
            for foot in &of.feet {
                feet[plan.piece(line, plan.piece_at(line, foot.along_m))] += 1;
            }
        }
        Self { plan, poses, cells: cells(plan), blocks: blocks(plan, poses), feet }
    }

    /// All proposals for a set of walls, each once, that change it.
    pub(crate) fn moves(&self, walls: &PieceSet) -> Vec<PlanMove> {
        let runs = self.plan.runs(walls);
        let mut proposals = Proposals { plan: self.plan, walls, runs, found: Vec::new() };
        proposals.resize();
        for line in 0..self.plan.lines.len() {
            proposals.fill_gaps(line);
            proposals.at_feet(line, &self.feet);
            proposals.between_walls(line);
            proposals.walls_at_points(line);
        }
        proposals.corners();
        proposals.invert(&self.cells);
        let corners = corners_at_points(self.plan, walls, &proposals.runs);
        proposals.found.extend(corners);
        proposals.found.extend(self.blocks.iter().cloned());
        let hidden = uncover(self.plan, walls, &proposals.runs, self.poses);
        proposals.found.extend(hidden);
        unique(proposals.found, walls)
    }
}

/// Sorted, without repetitions and without changes that change nothing.
fn unique(found: Vec<PlanMove>, walls: &PieceSet) -> Vec<PlanMove> {
    let mut seen = BTreeSet::new();
    let mut kept = Vec::with_capacity(found.len());
    for mut change in found {
        change.retain(|&(piece, is_wall)| walls.contains(piece) != is_wall);
        change.sort_unstable();
        change.dedup();
        if !change.is_empty() && seen.insert(change.clone()) {
            kept.push(change);
        }
    }
    kept
}

impl Proposals<'_> {
    fn push(&mut self, line: usize, pieces: impl Iterator<Item = usize>, is_wall: bool) {
        let change: PlanMove = pieces.map(|at| (self.plan.piece(line, at), is_wall)).collect();
        self.found.push(change);
    }

    /// Removes, retracts and extends walls, and takes out single pieces.
    fn resize(&mut self) {
        for Run { line, first, last } in self.runs.clone() {
            let inner = self.plan.pieces_of(line).saturating_sub(2);
            self.push(line, first..=last, false);
            for count in 1..MAX_RETRACTED.min(last - first + 1) {
                self.push(line, first..first + count, false);
                self.push(line, last + 1 - count..=last, false);
            }
            for count in 1..=MAX_EXTENDED {
                if first > count {
                    self.push(line, first - count..first, true);
                }
                if last + count <= inner {
                    self.push(line, last + 1..=last + count, true);
                }
            }
            for at in first + 1..last {
                self.push(line, at..=at, false);
            }
        }
    }

    fn fill_gaps(&mut self, line: usize) {
        let own: Vec<Run> = self.runs.iter().filter(|run| run.line == line).copied().collect();
        for pair in own.windows(2) {
            self.push(line, pair[0].last + 1..pair[1].first, true);
        }
    }

    /// Walls at feet of perpendiculars, and from the first foot to the last.
    fn at_feet(&mut self, line: usize, feet: &[usize]) {
        let with_feet: Vec<usize> = (0..self.plan.pieces_of(line))
            .filter(|&at| self.plan.is_inner(line, at) && feet[self.plan.piece(line, at)] > 0)
            .collect();
        for &at in &with_feet {
            self.push(line, at..=at, true);
        }
        if let [first, .., last] = with_feet[..] {
            self.push(line, first..=last, true);
        }
    }

    /// Walls between neighbouring walls that the line crosses, and over one of them.
    fn between_walls(&mut self, line: usize) {
        let last = self.plan.pieces_of(line).saturating_sub(1);
        let met: Vec<usize> =
            (1..=last).filter(|&cut| self.plan.is_met(self.walls, line, cut)).collect();
        for pair in met.windows(2) {
            self.push(line, pair[0]..pair[1], true);
        }
        for three in met.windows(3) {
            self.push(line, three[0]..three[2], true);
        }
    }

    /// Walls between points on the line, and from a point to the next wall on either side.
    fn walls_at_points(&mut self, line: usize) {
        /// Distance from a point to the piece beside it, metres.
        const BESIDE_M: f64 = 1e-4;
        let inner = self.plan.pieces_of(line).saturating_sub(2);
        let points = self.plan.lines[line].points.clone();
        for (at, &from_m) in points.iter().enumerate() {
            let first = self.plan.piece_at(line, from_m + BESIDE_M);
            for &to_m in points.iter().skip(at + 1).take(3) {
                let last = self.plan.piece_at(line, to_m - BESIDE_M);
                if first >= 1 && first <= last && last <= inner {
                    self.push(line, first..=last, true);
                }
            }
            for is_up in [true, false] {
                let from = if is_up { first } else { first.saturating_sub(1) };
                if let Some(pieces) = to_next_wall(self.plan, self.walls, (line, from), is_up) {
                    self.push(line, pieces.into_iter(), true);
                }
            }
        }
    }

    /// Pairs of walls, both extended to the corner of their lines.
    fn corners(&mut self) {
        for (at, a) in self.runs.clone().iter().enumerate() {
            for b in self.runs.clone().iter().skip(at + 1).filter(|b| b.line != a.line) {
                let Some(corner) = self.plan.lines[a.line].meet(&self.plan.lines[b.line]) else {
                    continue;
                };
                let ways = [a, b].map(|run| {
                    let along_m = self.plan.lines[run.line].along_m(corner);
                    let cuts = &self.plan.cuts[run.line];
                    let cut = cuts.iter().position(|cut| (cut.along_m - along_m).abs() < 1e-6)?;
                    extended_to(run, cut)
                });
                if let [Some(of_a), Some(of_b)] = ways {
                    let pieces = |run: &Run, way: std::ops::Range<usize>| {
                        let (plan, line) = (self.plan, run.line);
                        way.map(move |at| (plan.piece(line, at), true))
                    };
                    let change = pieces(a, of_a).chain(pieces(b, of_b)).collect();
                    self.found.push(change);
                }
            }
        }
    }

    /// Cells with a wall, their borders inverted.
    fn invert(&mut self, cells: &[Vec<usize>]) {
        for cell in cells.iter().filter(|cell| cell.iter().any(|at| self.walls.contains(*at))) {
            let change = cell.iter().map(|&at| (at, !self.walls.contains(at))).collect();
            self.found.push(change);
        }
    }
}

/// Pieces that extend a wall to a cut.
fn extended_to(run: &Run, cut: usize) -> Option<std::ops::Range<usize>> {
    let way = if cut <= run.first {
        cut..run.first
    } else if cut > run.last {
        run.last + 1..cut
    } else {
        0..0
    };
    (way.len() <= MAX_TO_CORNER).then_some(way)
}

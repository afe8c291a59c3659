//! Plan with its poses, and the columns of both in normal equations.

use sonard_model::geometry::Pose;

use crate::arrangement::{LineArrangement, PieceSet};

/// Plan with its poses.
#[derive(Debug, Clone)]
pub(crate) struct PosedPlan {
    pub(crate) plan: LineArrangement,
    pub(crate) walls: PieceSet,
    pub(crate) poses: Vec<Pose>,
}

/// Columns of the lines with walls in normal equations, after those of the poses: direction, then
/// distance.
#[derive(Debug, Clone)]
pub(crate) struct LineColumns {
    lines: Vec<Option<usize>>,
    count: usize,
}

impl LineColumns {
    pub(crate) fn new(posed: &PosedPlan) -> Self {
        let mut count = 3 * posed.poses.len().saturating_sub(1);
        let mut lines = vec![None; posed.plan.lines.len()];
        for run in posed.plan.runs(&posed.walls) {
            lines[run.line].get_or_insert_with(|| {
                count += 2;
                count - 2
            });
        }
        Self { lines, count }
    }

    /// Number of columns in all.
    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    /// Column of the direction of a line; `None` without walls on it.
    pub(crate) fn of(&self, line: usize) -> Option<usize> {
        self.lines.get(line).copied().flatten()
    }

    /// Column of the direction of each line.
    pub(crate) fn lines(&self) -> impl Iterator<Item = Option<usize>> + '_ {
        self.lines.iter().copied()
    }

    /// Columns of all directions.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.lines.iter().flatten().copied()
    }
}

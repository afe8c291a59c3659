//! Change of a plan, and the way along a line to the next wall.

use crate::arrangement::{LineArrangement, PieceSet};

/// Pieces that become walls or stop being walls.
pub(crate) type PlanMove = Vec<(usize, bool)>;

/// Maximum number of pieces from a point to the next wall.
const MAX_TO_WALL: usize = 12;

/// Pieces from one up or down the line to the next crossing wall; `None` if none is near.
pub(super) fn to_next_wall(
    plan: &LineArrangement,
    walls: &PieceSet,
    (line, from): (usize, usize),
    is_up: bool,
) -> Option<Vec<usize>> {
    let (mut at, mut way) = (from, Vec::new());
    while plan.is_inner(line, at) && way.len() < MAX_TO_WALL {
        way.push(at);
        if plan.is_met(walls, line, if is_up { at + 1 } else { at }) {
            return Some(way);
        }
        at = if is_up { at + 1 } else { at.checked_sub(1)? };
    }
    None
}

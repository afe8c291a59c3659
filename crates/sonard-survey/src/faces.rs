//! Bounded cells of an arrangement of lines.

use std::collections::{BTreeMap, BTreeSet};

use sonard_model::geometry::DVec2;

use crate::arrangement::LineArrangement;

/// Vertices closer than this are one, metres.
const SAME_M: f64 = 0.0025;
/// Minimum area of a cell, square metres.
const MIN_AREA_M2: f64 = 1e-3;
/// Maximum number of cells, largest first.
const MAX_CELLS: usize = 400;
const MAX_SIDES: usize = 200;

/// Half-edge: from a vertex to another along a piece.
type HalfEdge = (usize, usize, usize);

/// Vertices with their neighbours, counter-clockwise.
struct VertexGraph {
    points: Vec<DVec2>,
    /// Neighbouring vertex and number of the piece, in order of direction.
    neighbours: Vec<Vec<(usize, usize)>>,
}

/// Cells as sets of pieces, largest first.
pub(crate) fn cells(plan: &LineArrangement) -> Vec<Vec<usize>> {
    let graph = VertexGraph::new(plan);
    let mut seen: BTreeSet<HalfEdge> = BTreeSet::new();
    let mut found: Vec<(f64, Vec<usize>)> = Vec::new();
    for from in 0..graph.points.len() {
        for &(to, piece) in &graph.neighbours[from] {
            if let Some(cell) = graph.walk((from, to, piece), &mut seen) {
                found.push(cell);
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(MAX_CELLS);
    found.into_iter().map(|(_, cell)| cell).collect()
}

impl VertexGraph {
    fn new(plan: &LineArrangement) -> Self {
        let mut graph = Self { points: Vec::new(), neighbours: Vec::new() };
        let mut places: BTreeMap<(i64, i64), usize> = BTreeMap::new();
        for line in 0..plan.lines.len() {
            for at in 1..plan.pieces_of(line).saturating_sub(1) {
                let [a, b] = plan.ends_of(line, at).map(|end| graph.vertex(&mut places, end));
                if a != b {
                    let piece = plan.piece(line, at);
                    graph.neighbours[a].push((b, piece));
                    graph.neighbours[b].push((a, piece));
                }
            }
        }
        let points = &graph.points;
        for (at, neighbours) in graph.neighbours.iter_mut().enumerate() {
            let direction = |to: usize| (points[to] - points[at]).to_angle();
            neighbours.sort_by(|a, b| direction(a.0).total_cmp(&direction(b.0)).then(a.cmp(b)));
        }
        graph
    }

    fn vertex(&mut self, places: &mut BTreeMap<(i64, i64), usize>, point: DVec2) -> usize {
        let key = |at: f64| (at / SAME_M).round() as i64;
        let (x, y) = (key(point.x), key(point.y));
        for near in (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| (x, y))) {
            if let Some(&known) = places.get(&near)
                && self.points[known].distance(point) < SAME_M
            {
                return known;
            }
        }
        self.points.push(point);
        self.neighbours.push(Vec::new());
        places.insert((x, y), self.points.len() - 1);
        self.points.len() - 1
    }

    /// Cell to the left of a half-edge with its area; `None` if it was found before, has no area,
    /// or is unbounded.
    fn walk(&self, start: HalfEdge, seen: &mut BTreeSet<HalfEdge>) -> Option<(f64, Vec<usize>)> {
        let (mut edge, mut doubled_m2, mut cell) = (start, 0.0, Vec::new());
        for _ in 0..MAX_SIDES {
            if !seen.insert(edge) {
                break;
            }
            let (from, to, piece) = edge;
            cell.push(piece);
            doubled_m2 += self.points[from].perp_dot(self.points[to]);
            let around = &self.neighbours[to];
            let at = around.iter().position(|of| *of == (from, piece))?;
            let (next, along) = around[(at + around.len() - 1) % around.len()];
            edge = (to, next, along);
        }
        cell.sort_unstable();
        cell.dedup();
        let area_m2 = 0.5 * doubled_m2;
        (area_m2 > MIN_AREA_M2 && cell.len() >= 3).then_some((area_m2, cell))
    }
}

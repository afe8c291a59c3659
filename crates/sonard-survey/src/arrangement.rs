//! Arrangement of lines: each is cut into pieces, and a plan is the set of pieces that are walls.

use sonard_model::geometry::{DVec2, Pose, distance_to_segment};

use crate::line::Line;

/// Minimum distance between a cut of a line by itself and any other cut, metres.
const MIN_PIECE_M: f64 = 0.02;
/// Distance within which walls are joined, metres.
pub(crate) const JOINED_M: f64 = 0.004;
/// Minimum length of a wall, metres.
const MIN_WALL_M: f64 = 0.004;
/// Distance of cuts beside the feet of perpendiculars, metres.
const BESIDE_FOOT_M: f64 = 0.08;
/// Feet farther apart than this have cuts between them, metres.
const SEPARATE_FEET_M: f64 = 0.5;

/// Cut of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cut {
    /// Position along the line, metres.
    pub(crate) along_m: f64,
    /// Index of the line that cuts; `None` for a free end.
    pub(crate) by: Option<usize>,
}

/// Lines cut into pieces between neighbouring cuts. Pieces are numbered through all lines.
#[derive(Debug, Clone)]
pub(crate) struct LineArrangement {
    pub(crate) lines: Vec<Line>,
    /// Cuts of each line in order; the first and last bound the region.
    pub(crate) cuts: Vec<Vec<Cut>>,
    /// Number of the first piece of each line, and the number of pieces in all.
    first: Vec<usize>,
}

/// Set of pieces that are walls.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub(crate) struct PieceSet {
    words: Vec<u64>,
}

/// Neighbouring pieces of a line that are one wall: from the first to the last, by their numbers on
/// the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Run {
    pub(crate) line: usize,
    pub(crate) first: usize,
    pub(crate) last: usize,
}

/// Wall of a plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Segment {
    pub(crate) line: usize,
    pub(crate) a: DVec2,
    pub(crate) b: DVec2,
}

impl Segment {
    /// Length, metres.
    pub(crate) fn length_m(&self) -> f64 {
        self.a.distance(self.b)
    }
}

impl PieceSet {
    pub(crate) fn new(pieces: usize) -> Self {
        Self { words: vec![0; pieces.div_ceil(64)] }
    }

    pub(crate) fn contains(&self, piece: usize) -> bool {
        self.words.get(piece / 64).is_some_and(|word| word >> (piece % 64) & 1 == 1)
    }

    pub(crate) fn set(&mut self, piece: usize, is_wall: bool) {
        if let Some(word) = self.words.get_mut(piece / 64) {
            let bit = 1 << (piece % 64);
            if is_wall { *word |= bit } else { *word &= !bit }
        }
    }

    /// Set after changes of single pieces.
    pub(crate) fn changed(&self, changes: &[(usize, bool)]) -> Self {
        let mut set = self.clone();
        changes.iter().for_each(|&(piece, is_wall)| set.set(piece, is_wall));
        set
    }
}

impl LineArrangement {
    /// Cuts lines at each other, at their points, and beside the feet of perpendiculars, within
    /// `reach_m` of the poses.
    pub(crate) fn new(lines: Vec<Line>, poses: &[Pose], reach_m: f64) -> Self {
        let bare = Self::with_free_cuts(lines, poses, reach_m, &[]);
        let free: Vec<Vec<f64>> = bare
            .lines
            .iter()
            .zip(&bare.cuts)
            .map(|(line, cuts)| {
                let mut free = line.points.clone();
                free.extend(beside_feet(line));
                let is_apart =
                    |at: &f64| cuts.iter().all(|cut| (cut.along_m - at).abs() > MIN_PIECE_M);
                free.retain(is_apart);
                free
            })
            .collect();
        Self::with_free_cuts(bare.lines, poses, reach_m, &free)
    }

    /// Arrangement of the lines of walls with those walls.
    pub(crate) fn of_walls(walls: &[[DVec2; 2]], poses: &[Pose], reach_m: f64) -> (Self, PieceSet) {
        const ON_M: f64 = 1e-3;
        let mut lines: Vec<Line> = Vec::new();
        let mut segments = Vec::with_capacity(walls.len());
        for &[a, b] in walls {
            let line = Line::through((b - a).perp().to_angle(), a);
            let known = lines.iter().position(|known| known.is_same(&line, a, ON_M));
            segments.push(Segment { line: known.unwrap_or(lines.len()), a, b });
            if known.is_none() {
                lines.push(line);
            }
        }
        let ends: Vec<(DVec2, usize)> = walls.iter().flatten().map(|end| (*end, 1)).collect();
        lines.iter_mut().for_each(|line| line.attach_points(&ends));
        let plan = Self::new(lines, poses, reach_m);
        let set = plan.of_segments(&segments);
        (plan, set)
    }

    /// Cuts lines at each other and at given positions of each.
    fn with_free_cuts(lines: Vec<Line>, poses: &[Pose], reach_m: f64, free: &[Vec<f64>]) -> Self {
        let places = || poses.iter().map(Pose::position);
        let low = places().fold(DVec2::INFINITY, DVec2::min) - reach_m;
        let high = places().fold(DVec2::NEG_INFINITY, DVec2::max) + reach_m;
        let corners = [low, high, DVec2::new(low.x, high.y), DVec2::new(high.x, low.y)];
        let cuts: Vec<Vec<Cut>> = lines
            .iter()
            .enumerate()
            .map(|(at, line)| {
                let bounds = corners.map(|corner| line.along_m(corner));
                let all = || bounds.into_iter().chain(line.feet.iter().map(|foot| foot.along_m));
                let from = all().fold(f64::INFINITY, f64::min) - 0.01;
                let to = all().fold(f64::NEG_INFINITY, f64::max) + 0.01;
                let crossing = |(by, other): (usize, &Line)| {
                    let point = line.meet(other).filter(|_| by != at)?;
                    let is_within = point.cmpgt(low).all() && point.cmplt(high).all();
                    is_within.then(|| Cut { along_m: line.along_m(point), by: Some(by) })
                };
                let mut cuts: Vec<Cut> = lines.iter().enumerate().filter_map(crossing).collect();
                let own = free.get(at).into_iter().flatten();
                cuts.extend(own.map(|&along_m| Cut { along_m, by: None }));
                cuts.retain(|cut| cut.along_m > from && cut.along_m < to);
                cuts.extend([from, to].map(|along_m| Cut { along_m, by: None }));
                cuts.sort_by(|a, b| a.along_m.total_cmp(&b.along_m));
                cuts
            })
            .collect();
        let mut first = vec![0];
        for cuts in &cuts {
            first.push(first[first.len() - 1] + cuts.len().saturating_sub(1));
        }
        Self { lines, cuts, first }
    }

    /// Number of pieces of a line.
    pub(crate) fn pieces_of(&self, line: usize) -> usize {
        self.first[line + 1] - self.first[line]
    }

    /// Number of pieces in all.
    pub(crate) fn pieces(&self) -> usize {
        self.first[self.lines.len()]
    }

    /// Number of a piece among all.
    pub(crate) fn piece(&self, line: usize, at: usize) -> usize {
        self.first[line] + at
    }

    /// Returns `true` if a piece does not touch the boundary of the region.
    pub(crate) fn is_inner(&self, line: usize, at: usize) -> bool {
        at >= 1 && at + 2 <= self.pieces_of(line)
    }

    /// Piece of a line at a position along it.
    pub(crate) fn piece_at(&self, line: usize, along_m: f64) -> usize {
        let after = self.cuts[line].partition_point(|cut| cut.along_m < along_m);
        after.saturating_sub(1).min(self.pieces_of(line) - 1)
    }

    /// End points of a piece.
    pub(crate) fn ends_of(&self, line: usize, at: usize) -> [DVec2; 2] {
        [at, at + 1].map(|cut| self.lines[line].at(self.cuts[line][cut].along_m))
    }

    pub(crate) fn is_wall(&self, walls: &PieceSet, line: usize, at: usize) -> bool {
        walls.contains(self.piece(line, at))
    }

    /// Walls: runs of neighbouring pieces that have a length.
    pub(crate) fn runs(&self, walls: &PieceSet) -> Vec<Run> {
        let mut runs = Vec::new();
        for line in 0..self.lines.len() {
            let mut at = 0;
            while at < self.pieces_of(line) {
                if !self.is_wall(walls, line, at) {
                    at += 1;
                    continue;
                }
                let first = at;
                while at < self.pieces_of(line) && self.is_wall(walls, line, at) {
                    at += 1;
                }
                let run = Run { line, first, last: at - 1 };
                let segment = self.segment(&run);
                if segment.length_m() > MIN_WALL_M {
                    runs.push(run);
                }
            }
        }
        runs
    }

    /// Walls as segments, in the order of [`runs`](Self::runs).
    pub(crate) fn segments(&self, walls: &PieceSet) -> Vec<Segment> {
        self.runs(walls).iter().map(|run| self.segment(run)).collect()
    }

    pub(crate) fn segment(&self, run: &Run) -> Segment {
        let [a, _] = self.ends_of(run.line, run.first);
        let [_, b] = self.ends_of(run.line, run.last);
        Segment { line: run.line, a, b }
    }

    /// Returns `true` if the line that makes a cut has a wall there, within [`JOINED_M`]: several
    /// lines may cross almost in one point.
    pub(crate) fn is_met(&self, walls: &PieceSet, line: usize, cut: usize) -> bool {
        let cut = self.cuts[line][cut];
        let Some(other) = cut.by else { return false };
        let along_m = self.lines[other].along_m(self.lines[line].at(cut.along_m));
        let cuts = &self.cuts[other];
        let first = cuts.partition_point(|cut| cut.along_m < along_m - JOINED_M);
        let after = cuts.partition_point(|cut| cut.along_m <= along_m + JOINED_M);
        let pieces = first.saturating_sub(1)..after.min(self.pieces_of(other));
        pieces.into_iter().any(|at| self.is_wall(walls, other, at))
    }

    /// Walls of another arrangement on the lines of this one that are nearest to theirs.
    pub(crate) fn transfer(&self, from: &Self, walls: &PieceSet) -> PieceSet {
        let mut set = PieceSet::new(self.pieces());
        for segment in from.segments(walls) {
            let off = |line: &Line| line.off_m(segment.a).abs().max(line.off_m(segment.b).abs());
            let nearest = (0..self.lines.len())
                .min_by(|a, b| off(&self.lines[*a]).total_cmp(&off(&self.lines[*b])));
            let Some(line) = nearest else { continue };
            self.place(&mut set, &Segment { line, ..segment });
        }
        set
    }

    /// Walls on the lines of this arrangement.
    pub(crate) fn of_segments(&self, segments: &[Segment]) -> PieceSet {
        let mut set = PieceSet::new(self.pieces());
        segments.iter().for_each(|segment| self.place(&mut set, segment));
        set
    }

    fn place(&self, set: &mut PieceSet, segment: &Segment) {
        let [s, t] = [segment.a, segment.b].map(|end| self.lines[segment.line].along_m(end));
        self.fill(set, segment.line, [s.min(t), s.max(t)]);
    }

    /// Makes the inner pieces between two positions of a line walls.
    fn fill(&self, set: &mut PieceSet, line: usize, [from, to]: [f64; 2]) {
        for at in 1..self.pieces_of(line).saturating_sub(1) {
            let middle = 0.5 * (self.cuts[line][at].along_m + self.cuts[line][at + 1].along_m);
            if from < middle && middle < to {
                set.set(self.piece(line, at), true);
            }
        }
    }

    /// Turns all lines about the origin, then moves them.
    pub(crate) fn move_by(&mut self, turned_rad: f64, by: DVec2) {
        for (line, cuts) in self.lines.iter_mut().zip(&mut self.cuts) {
            line.move_by(turned_rad, by);
            let along_m = by.dot(line.along());
            cuts.iter_mut().for_each(|cut| cut.along_m += along_m);
        }
    }

    /// Arrangement of moved lines with the same walls: ends at a crossing follow it, free ends keep
    /// their position.
    pub(crate) fn rebuilt(
        &self,
        walls: &PieceSet,
        lines: Vec<Line>,
        poses: &[Pose],
        reach_m: f64,
    ) -> (Self, PieceSet) {
        let free: Vec<Vec<f64>> = self
            .cuts
            .iter()
            .map(|cuts| {
                let inner = cuts.get(1..cuts.len().saturating_sub(1)).unwrap_or_default();
                inner.iter().filter(|cut| cut.by.is_none()).map(|cut| cut.along_m).collect()
            })
            .collect();
        let new = Self::with_free_cuts(lines, poses, reach_m, &free);
        let mut set = PieceSet::new(new.pieces());
        for run in self.runs(walls) {
            let [a, b] = [run.first, run.last + 1].map(|cut| {
                let cut = self.cuts[run.line][cut];
                let met = cut.by.and_then(|by| new.lines[run.line].meet(&new.lines[by]));
                met.map_or(cut.along_m, |point| new.lines[run.line].along_m(point))
            });
            new.fill(&mut set, run.line, [a.min(b) - 1e-9, a.max(b) + 1e-9]);
        }
        (new, set)
    }
}

/// Number of ends of a wall, by its index, that no other wall joins.
pub(crate) fn free_ends(walls: &[Segment], at: usize) -> usize {
    let is_joined = |end: &DVec2| {
        let mut others = walls.iter().enumerate().filter(|(other, _)| *other != at);
        others.any(|(_, other)| distance_to_segment(*end, other.a, other.b) < JOINED_M)
    };
    [walls[at].a, walls[at].b].iter().filter(|end| !is_joined(end)).count()
}

/// Positions beside groups of feet.
fn beside_feet(line: &Line) -> Vec<f64> {
    let mut feet: Vec<f64> = line.feet.iter().map(|foot| foot.along_m).collect();
    feet.sort_by(f64::total_cmp);
    let groups = feet.chunk_by(|a, b| b - a <= SEPARATE_FEET_M);
    groups
        .filter_map(|group| Some([group.first()? - BESIDE_FOOT_M, group.last()? + BESIDE_FOOT_M]))
        .flatten()
        .collect()
}

//! Boxes of unknown size behind a face or an unexplained echo.

use sonard_model::geometry::{DVec2, distance_to_segment, encloses};

use crate::{
    arc::Arc,
    arrangement::{LineArrangement, Segment, free_ends},
    judge::{Judge, ReferencePlan, ScoreContext, UNSCORED},
    line::Line,
    posed::PosedPlan,
    ranking::{climbed, ranked},
};

/// Limits of the sides of a box, metres.
const SIDE_M: [f64; 2] = [0.1, 1.3];
/// Half length of the face that a single arc suggests, metres.
const SEED_HALF_M: f64 = 0.1;
/// Steps of the first search over sides, metres: a quarter of the width of the likelihood with
/// ranges of [`ROUGH_SIGMA_M`].
const STEP_M: f64 = 0.03;
/// Maximum displacement of an end in that search, inwards and outwards, metres.
const END_SPAN_M: [f64; 2] = [0.15, 0.75];
/// Standard deviation of ranges in that search, metres.
const ROUGH_SIGMA_M: f64 = 0.012;
/// Steps of the fine search, metres.
const FINE_M: [f64; 5] = [0.015, 0.008, 0.004, 0.002, 0.001];
/// Distance from a box within which walls are parts of it, metres.
const PART_M: f64 = 0.05;
/// Maximum number of faces from which boxes are tried.
const MAX_FACES: usize = 6;
/// Number of the best depths from which a search begins.
const STARTS: usize = 3;
/// Minimum gain of a box, nats.
const MIN_GAIN: f64 = 1.0;

/// Rectangle behind a face.
#[derive(Debug, Clone)]
struct BoxShape {
    /// Line of the face.
    face: Line,
    /// Ends of the face along its line, and signed depth along the normal, metres.
    from_m: f64,
    to_m: f64,
    depth_m: f64,
}

/// Plan with a box in place of one of its short walls, or at an unexplained arc, if the likelihood
/// gains; the best of all boxes tried.
pub(crate) fn with_box(posed: &PosedPlan, judge: &Judge, left: &[&Arc]) -> Option<PosedPlan> {
    let walls = posed.plan.segments(&posed.walls);
    let before = judge.score_segments(&walls);
    let faces = faces(posed, &walls, left);
    let plan = BoxedPlan { walls: &walls, reference: ReferencePlan::new(judge, &walls)? };
    let found = faces.into_iter().filter_map(|face| plan.grown(&face, judge));
    let (score, shape) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (score > before + MIN_GAIN).then(|| built(posed, &walls, &shape, judge.workspace.reach_m()))
}

/// Faces with a depth of 0: short walls with a free end, the longest first, and unexplained arcs.
fn faces(posed: &PosedPlan, walls: &[Segment], left: &[&Arc]) -> Vec<BoxShape> {
    let mut short: Vec<&Segment> = walls
        .iter()
        .enumerate()
        .filter(|(at, wall)| wall.length_m() < SIDE_M[1] && free_ends(walls, *at) > 0)
        .map(|(_, wall)| wall)
        .collect();
    short.sort_by(|a, b| b.length_m().total_cmp(&a.length_m()));
    let of_walls = short.into_iter().map(|wall| {
        let face = posed.plan.lines[wall.line].clone();
        let [from_m, to_m] = [wall.a, wall.b].map(|end| face.along_m(end));
        BoxShape { face, from_m, to_m, depth_m: 0.0 }
    });
    let mut arcs = left.to_vec();
    arcs.sort_by_key(|arc| std::cmp::Reverse(arc.beams.len()));
    let of_arcs = arcs.into_iter().map(|arc| {
        let pose = &posed.poses[arc.sweep];
        let foot = arc.point_at(pose, arc.range_m);
        let face = Line::through(pose.direction_rad(arc.azimuth_deg), foot);
        let along_m = face.along_m(foot);
        BoxShape { face, from_m: along_m - SEED_HALF_M, to_m: along_m + SEED_HALF_M, depth_m: 0.0 }
    });
    of_walls.chain(of_arcs).take(MAX_FACES).collect()
}

/// Walls to which a box is added.
struct BoxedPlan<'w> {
    walls: &'w [Segment],
    /// Predictions of a plan that differs little.
    reference: ReferencePlan,
}

impl BoxedPlan<'_> {
    /// Plan that is predicted by that with a box, for a judge; `None` if the scene has more paths than
    /// the model follows.
    fn near(&self, shape: &BoxShape, judge: &Judge) -> Option<Self> {
        let reference = self.reference.rescored(judge);
        let reference = reference.followed_by(judge, &shape.placed(self.walls))?;
        Some(Self { reference, ..*self })
    }

    /// Likeliest box behind a face, on either side of it.
    fn grown(&self, face: &BoxShape, judge: &Judge) -> Option<(f64, BoxShape)> {
        let rough = judge.with_sigma(judge.workspace.errors.sigma_m(ROUGH_SIGMA_M));
        let plan = Self { reference: self.reference.rescored(&rough), ..*self };
        let count = ((SIDE_M[1] - SIDE_M[0]) / STEP_M) as i32;
        let depth = |at: i32| {
            let depth_m = SIDE_M[0] + STEP_M * f64::from(at.abs() - 1);
            BoxShape { depth_m: depth_m.copysign(f64::from(at)), ..face.clone() }
        };
        let depths = (-count..=count).filter(|at| *at != 0).map(depth);
        let mut starts = ranked(depths.collect(), |shape| plan.score_of(shape, &rough));
        starts.truncate(STARTS);
        let searched = starts.into_iter().filter_map(|(score, shape)| {
            let ends = plan.near(&shape, &rough)?.ends_of(shape, &rough, score);
            plan.fine(ends, judge)
        });
        searched.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Box with the likeliest ends of its face, one after the other, twice.
    fn ends_of(&self, from: BoxShape, rough: &Judge, score: f64) -> BoxShape {
        let (mut best, mut best_score) = (from, score);
        let [inwards, outwards] = END_SPAN_M.map(|span_m| (span_m / STEP_M) as i32);
        for _ in 0..2 {
            for is_to in [true, false] {
                let with = |at: i32| {
                    let by_m = STEP_M * f64::from(at);
                    let mut shape = best.clone();
                    if is_to {
                        shape.to_m += by_m;
                    } else {
                        shape.from_m -= by_m;
                    }
                    shape
                };
                let tried = (-inwards..=outwards).map(with).collect();
                let tried = ranked(tried, |shape| self.score_of(shape, rough));
                let better = tried.into_iter().next().filter(|of| of.0 > best_score);
                if let Some((score, shape)) = better {
                    (best, best_score) = (shape, score);
                }
            }
        }
        best
    }

    /// Box with all three sizes improved by steps that become smaller; `None` if the scene has more
    /// paths than the model follows.
    fn fine(&self, from: BoxShape, judge: &Judge) -> Option<(f64, BoxShape)> {
        const MAX_STEPS: usize = 6;
        let mut best = (f64::NEG_INFINITY, from);
        for step_m in FINE_M {
            let own = judge.with_sigma(judge.sigma_m.max(0.5 * step_m));
            let plan = self.near(&best.1, &own)?;
            let neighbours = |shape: &BoxShape| {
                let moved = (0..6).map(|at| {
                    let by_m = if at % 2 == 0 { step_m } else { -step_m };
                    let mut shape = shape.clone();
                    match at / 2 {
                        0 => shape.from_m += by_m,
                        1 => shape.to_m += by_m,
                        _ => shape.depth_m += by_m,
                    }
                    shape
                });
                moved.collect()
            };
            best = climbed(best.1, MAX_STEPS, neighbours, |shape| plan.score_of(shape, &own));
        }
        Some(best)
    }

    /// Score with a box, nats; `None` for one that is too large or too small or contains a stop.
    fn score_of(&self, shape: &BoxShape, judge: &Judge) -> Option<f64> {
        let sides = [shape.to_m - shape.from_m, shape.depth_m.abs()];
        let is_sized = sides.iter().all(|side_m| (SIDE_M[0]..SIDE_M[1]).contains(side_m));
        let corners = shape.corners();
        let is_clear = judge.poses.iter().all(|pose| !encloses(&corners, pose.position()));
        (is_sized && is_clear).then(|| {
            let context = ScoreContext::default().near(Some(&self.reference));
            let score = judge.score_segments_above(&shape.placed(self.walls), context);
            score.unwrap_or(UNSCORED)
        })
    }
}

impl BoxShape {
    /// Corners: the ends of the face, then those of the opposite side.
    fn corners(&self) -> [DVec2; 4] {
        let [a, b] = [self.from_m, self.to_m].map(|along_m| self.face.at(along_m));
        let depth = self.depth_m * self.face.normal();
        [a, b, b + depth, a + depth]
    }

    /// Walls with the sides of the box in place of those that are parts of it.
    fn placed(&self, walls: &[Segment]) -> Vec<Segment> {
        let corners = self.corners();
        let is_part = |wall: &Segment| {
            [wall.a, wall.a.midpoint(wall.b), wall.b].iter().all(|at| self.holds(&corners, *at))
        };
        let kept: Vec<Segment> = walls.iter().filter(|wall| !is_part(wall)).copied().collect();
        let next = walls.iter().map(|wall| wall.line + 1).max().unwrap_or(0);
        let side =
            |at: usize| Segment { line: next + at, a: corners[at], b: corners[(at + 1) % 4] };
        kept.into_iter().chain((0..4).map(side)).collect()
    }

    /// Returns `true` inside the box or near its sides.
    fn holds(&self, corners: &[DVec2; 4], at: DVec2) -> bool {
        let is_near =
            |side: usize| distance_to_segment(at, corners[side], corners[(side + 1) % 4]) < PART_M;
        encloses(corners, at) || (0..4).any(is_near)
    }
}

/// Arrangement with the lines of the other walls and those of the box.
fn built(posed: &PosedPlan, walls: &[Segment], shape: &BoxShape, reach_m: f64) -> PosedPlan {
    let placed = shape.placed(walls);
    let (others, sides) = placed.split_at(placed.len() - 4);
    let mut lines: Vec<Line> = Vec::new();
    let mut used: Vec<usize> = others.iter().map(|wall| wall.line).collect();
    used.sort_unstable();
    used.dedup();
    lines.extend(used.iter().map(|line| posed.plan.lines[*line].clone()));
    let mut all = Vec::new();
    for wall in others {
        let line = used.binary_search(&wall.line).unwrap_or(0);
        all.push(Segment { line, ..*wall });
    }
    for side in sides {
        let normal_rad = (side.b - side.a).perp().to_angle();
        all.push(Segment { line: lines.len(), ..*side });
        lines.push(Line::through(normal_rad, side.a));
    }
    for (at, line) in lines.iter_mut().enumerate() {
        let ends = all.iter().filter(|wall| wall.line == at).flat_map(|wall| [wall.a, wall.b]);
        let mut points: Vec<f64> = ends.map(|end| line.along_m(end)).collect();
        points.extend(&line.points);
        points.sort_by(f64::total_cmp);
        line.points = points;
    }
    let plan = LineArrangement::new(lines, &posed.poses, reach_m);
    let walls = plan.of_segments(&all);
    PosedPlan { plan, walls, posts: posed.posts.clone(), poses: posed.poses.clone() }
}

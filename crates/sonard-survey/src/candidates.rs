//! Lines on which walls are tried.

use std::{
    cmp::Reverse,
    f64::consts::{FRAC_PI_2, PI},
};

use sonard_model::geometry::{DVec2, Pose, distance_to_segment, wrap_pi};

use crate::{
    arc::Arc,
    arrangement::Segment,
    bundle::SupportedFeature,
    feature::VirtualFeature,
    line::{Foot, Line},
};

/// Distance within which lines are one, metres.
const SAME_M: f64 = 0.015;
/// Maximum number of lines of single arcs.
const MAX_SINGLE: usize = 6;
/// Minimum number of beams of a cut arc that suggests a line by itself.
const MIN_CUT_BEAMS: usize = 6;
/// Share of the arcs of a feature that must be unexplained for a line of it to be tried.
const OPEN_SHARE: f64 = 0.34;

/// Inputs of a choice of candidate lines.
pub(crate) struct CandidateSources<'a> {
    pub(crate) features: &'a [SupportedFeature<'a>],
    pub(crate) poses: &'a [Pose],
    /// Lines with walls.
    pub(crate) kept: Vec<Line>,
    /// Walls on them.
    pub(crate) walls: &'a [Segment],
    /// Arcs that the walls leave unexplained; `None` before there are walls.
    pub(crate) left: Option<&'a [&'a Arc]>,
}

impl CandidateSources<'_> {
    /// Chooses up to `max` lines: those with walls; those of line features; those of single
    /// unexplained arcs; and those through point features, through places of unexplained arcs and
    /// through ends of walls, along directions in use and square to them, the best supported first.
    pub(crate) fn lines(&self, max: usize) -> Vec<Line> {
        let center = self.center();
        let mut points = self.points();
        let mut lines = Vec::new();
        for line in &self.kept {
            add(&mut lines, line.clone(), center);
        }
        let mut of_features = self.open_lines();
        of_features.sort_by_key(|line| Reverse(line.support));
        for line in of_features {
            add(&mut lines, line, center);
        }
        let in_use = if self.kept.is_empty() { lines.clone() } else { self.kept.clone() };
        let lone = self.lone_points();
        points.extend(lone.iter().map(|point| (*point, 3)));
        let mut through = self.lines_through(&in_use, &points);
        let ranks: Vec<usize> = through.iter().map(|line| self.rank(line, &points)).collect();
        let mut order: Vec<usize> = (0..through.len()).collect();
        order.sort_by(|a, b| ranks[*b].cmp(&ranks[*a]).then(a.cmp(b)));
        let through = order.into_iter().map(|at| std::mem::replace(&mut through[at], EMPTY));
        for line in self.single_lines().into_iter().chain(through) {
            if lines.len() >= max {
                break;
            }
            add(&mut lines, line, center);
        }
        let features = self.points();
        lines.iter_mut().for_each(|line| line.attach_points(&features));
        lines
    }

    fn center(&self) -> DVec2 {
        let sum: DVec2 = self.poses.iter().map(Pose::position).sum();
        sum / self.poses.len().max(1) as f64
    }

    /// Point features with their support.
    fn points(&self) -> Vec<(DVec2, usize)> {
        let point = |of: &SupportedFeature| match of.feature {
            VirtualFeature::Point { position, .. } => Some((position, of.arcs.len())),
            VirtualFeature::Line { .. } => None,
        };
        self.features.iter().filter_map(point).collect()
    }

    /// Lines of line features, unless walls explain most of their arcs.
    fn open_lines(&self) -> Vec<Line> {
        let is_open = |of: &&SupportedFeature| {
            self.left.is_none_or(|left| {
                let open = of.arcs.iter().filter(|arc| left.contains(arc)).count();
                open as f64 >= OPEN_SHARE * of.arcs.len() as f64
            })
        };
        let open = self.features.iter().filter(is_open);
        open.filter_map(|of| Line::of_feature(of, self.poses)).collect()
    }

    /// Lines of single unexplained arcs, widest first.
    fn single_lines(&self) -> Vec<Line> {
        let mut left: Vec<&Arc> = self.left.unwrap_or_default().to_vec();
        left.retain(|arc| !arc.is_cut || arc.beams.len() >= MIN_CUT_BEAMS);
        left.sort_by_key(|arc| Reverse(arc.beams.len()));
        let line = |arc: &&Arc| {
            let [feature, _] = VirtualFeature::of_arc(arc, &self.poses[arc.sweep]);
            Line::of_feature(&SupportedFeature { feature, arcs: vec![arc] }, self.poses)
        };
        left.iter().filter_map(line).take(MAX_SINGLE).collect()
    }

    /// Places of unexplained arcs.
    fn lone_points(&self) -> Vec<DVec2> {
        let place = |arc: &&Arc| arc.point_at(&self.poses[arc.sweep], arc.range_m);
        self.left.unwrap_or_default().iter().map(place).collect()
    }

    fn wall_ends(&self) -> Vec<DVec2> {
        self.walls.iter().flat_map(|wall| [wall.a, wall.b]).collect()
    }

    /// Lines through points and ends of walls along directions in use, and through pairs of loose
    /// ends.
    fn lines_through(&self, in_use: &[Line], points: &[(DVec2, usize)]) -> Vec<Line> {
        let directions = directions(in_use);
        let ends = self.wall_ends();
        let through = |point: DVec2| {
            directions.iter().map(move |&normal_rad| Line::through(normal_rad, point))
        };
        let mut found: Vec<Line> = points.iter().flat_map(|(point, _)| through(*point)).collect();
        let is_loose = |at: usize| {
            let others = ends.iter().enumerate().filter(|(other, _)| *other != at);
            !others.into_iter().any(|(_, other)| other.distance(ends[at]) < 0.02)
        };
        let loose: Vec<DVec2> =
            (0..ends.len()).filter(|at| is_loose(*at)).map(|at| ends[at]).collect();
        for (at, a) in loose.iter().enumerate() {
            for b in &loose[at + 1..] {
                if (0.1..3.0).contains(&a.distance(*b)) {
                    found.push(Line::through((*b - *a).perp().to_angle(), *a));
                }
            }
        }
        found.extend(ends.iter().flat_map(|end| through(*end)));
        found
    }

    /// Support of a line through points: the arcs of points on it, more if they are at walls or
    /// unexplained, and ends of walls.
    fn rank(&self, line: &Line, points: &[(DVec2, usize)]) -> usize {
        const ON_M: f64 = 0.012;
        const AT_WALL_M: f64 = 0.03;
        let mut rank = 0;
        for (point, support) in points {
            if line.off_m(*point).abs() < ON_M {
                let is_at_wall =
                    |wall: &Segment| distance_to_segment(*point, wall.a, wall.b) < AT_WALL_M;
                rank += 2 + support + if self.walls.iter().any(is_at_wall) { 6 } else { 0 };
            }
        }
        let ends = self.wall_ends();
        rank + 6 * ends.iter().filter(|end| line.off_m(**end).abs() < ON_M).count()
    }
}

const EMPTY: Line = Line::new(0.0, 0.0);

/// Adds a line unless it is one of those known, whose feet it then extends.
fn add(lines: &mut Vec<Line>, line: Line, center: DVec2) {
    let near = line.anchor(center);
    if let Some(known) = lines.iter_mut().find(|known| line.is_same(known, near, SAME_M)) {
        for foot in &line.feet {
            if !known.feet.iter().any(|other| other.sweep == foot.sweep) {
                let along_m = known.along_m(line.at(foot.along_m));
                known.feet.push(Foot { along_m, ..*foot });
            }
        }
        known.support = known.support.max(line.support);
        return;
    }
    lines.push(line);
}

/// Directions of normals in use and square to them, within 2 degrees once each, radians in [0, pi).
fn directions(lines: &[Line]) -> Vec<f64> {
    const SAME_RAD: f64 = 0.035;
    let mut found: Vec<f64> = Vec::new();
    for line in lines {
        for turn in [0.0, FRAC_PI_2] {
            let normal_rad = (line.normal_rad + turn).rem_euclid(PI);
            let is_known = |known: &f64| {
                let off_rad = wrap_pi(2.0 * (normal_rad - known)).abs() / 2.0;
                off_rad < SAME_RAD
            };
            if !found.iter().any(is_known) {
                found.push(normal_rad);
            }
        }
    }
    found
}

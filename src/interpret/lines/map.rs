//! A map of lines that grows with every scan.

use super::{FitSettings, LineKind, MapLine, MergeSettings, clusters, fit, merge};
use crate::{
    geometry::DVec2,
    interpret::{Heard, Sweep},
};

/// How a line map is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineMapSettings {
    /// Sonar readings beyond this "logical" distance are left out, metres.
    pub logical_m: f64,
    /// Radius of the circle around the robot in which objects are reliably known, metres.
    pub known_m: f64,
    /// A later reading in such a circle contradicts it if it is farther than this from all that
    /// was known there, metres.
    pub contradicts_m: f64,
    /// Least radius of a sonar reading's circle of influence, metres; laser has none.
    pub sonar_radius_m: f64,
    /// How sonar segments are fitted.
    pub sonar: FitSettings,
    /// How laser segments are fitted.
    pub laser: FitSettings,
    /// Which lines are merged.
    pub merge: MergeSettings,
}

impl Default for LineMapSettings {
    fn default() -> Self {
        Self {
            logical_m: 3.0,
            known_m: 0.5,
            contradicts_m: 0.05,
            sonar_radius_m: 0.04,
            sonar: FitSettings::default(),
            laser: FitSettings { tolerance_m: 0.02, least_points: 5, least_length_m: 0.03 },
            merge: MergeSettings::default(),
        }
    }
}

/// A map of lines.
#[derive(Debug, Clone, Default)]
pub struct LineMap {
    settings: LineMapSettings,
    lines: Vec<MapLine>,
    /// Places where the robot was, with the readings close to it there.
    known: Vec<(DVec2, Vec<DVec2>)>,
    /// Where laser segments were seen, with the place they were seen from: empty triangles.
    clear: Vec<[DVec2; 3]>,
}

impl LineMap {
    /// An empty map.
    #[must_use]
    pub fn new(settings: LineMapSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// Its lines.
    #[must_use]
    pub fn lines(&self) -> &[MapLine] {
        &self.lines
    }

    /// Its lines, to confirm their ends.
    pub fn lines_mut(&mut self) -> &mut [MapLine] {
        &mut self.lines
    }

    /// Adds a sonar scan; returns how many readings the three rules left out.
    pub fn add_sonar(&mut self, sweep: &Sweep) -> usize {
        let robot = sweep.pose.position();
        let echoes: Vec<DVec2> = sweep
            .beams
            .iter()
            .filter_map(|beam| match beam.heard {
                Heard::Echo(range_m) => Some(sweep.point(beam, range_m)),
                _ => None,
            })
            .collect();
        let kept: Vec<DVec2> =
            echoes.iter().copied().filter(|point| self.may_be(robot, *point)).collect();
        let close = |point: &DVec2| point.distance(robot) <= self.settings.known_m;
        self.known.push((robot, kept.iter().copied().filter(close).collect()));
        let (fitted, radius_m) = (self.settings.sonar, self.settings.sonar_radius_m);
        self.add(&kept, radius_m, &fitted, LineKind::Sonar);
        echoes.len() - kept.len()
    }

    /// Adds laser readings from a place, in the order of their directions.
    pub fn add_laser(&mut self, robot: DVec2, points: &[DVec2]) {
        let fitted = self.settings.laser;
        for ends in self.add(points, 0.0, &fitted, LineKind::Laser) {
            self.clear.push([robot, ends[0], ends[1]]);
        }
    }

    /// The three rules: not beyond the logical distance, not against what is known around a place
    /// where the robot was, not between the laser and what it saw.
    fn may_be(&self, robot: DVec2, point: DVec2) -> bool {
        let LineMapSettings { logical_m, known_m, contradicts_m, .. } = self.settings;
        let known = |(place, objects): &(DVec2, Vec<DVec2>)| {
            place.distance(point) < known_m
                && *place != robot
                && objects.iter().all(|object| object.distance(point) > contradicts_m)
        };
        point.distance(robot) <= logical_m
            && !self.known.iter().any(known)
            && !self.clear.iter().any(|triangle| is_inside(triangle, point, contradicts_m))
    }

    /// Clusters points, fits segments to each and merges them into the map; returns the segments'
    /// ends.
    fn add(
        &mut self,
        points: &[DVec2],
        least_radius_m: f64,
        fitted: &FitSettings,
        kind: LineKind,
    ) -> Vec<[DVec2; 2]> {
        let mut found = Vec::new();
        for cluster in clusters(points, least_radius_m) {
            let points: Vec<DVec2> = cluster.iter().map(|at| points[*at]).collect();
            for segment in fit(&points, fitted) {
                let confidence = segment.confidence;
                found.push(segment.ends);
                self.take_in(MapLine {
                    ends: segment.ends,
                    terminal: [false; 2],
                    kind,
                    confidence,
                });
            }
        }
        found
    }

    /// Merges a line with all that are one wall with it.
    fn take_in(&mut self, mut line: MapLine) {
        while let Some((at, merged)) = self
            .lines
            .iter()
            .enumerate()
            .find_map(|(at, old)| Some((at, merge(old, &line, &self.settings.merge)?)))
        {
            self.lines.remove(at);
            line = merged;
        }
        self.lines.push(line);
    }
}

/// Whether a point lies in a triangle, at least `margin_m` before its far side.
fn is_inside([apex, a, b]: &[DVec2; 3], point: DVec2, margin_m: f64) -> bool {
    let (to_a, to_b, to_point) = (*a - *apex, *b - *apex, point - *apex);
    let turn = to_a.perp_dot(to_b).signum();
    let between = turn * to_a.perp_dot(to_point) > 0.0 && turn * to_point.perp_dot(to_b) > 0.0;
    let side = *b - *a;
    let height_m = turn * side.perp_dot(point - *a) / side.length();
    between && height_m > margin_m
}

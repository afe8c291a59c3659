//! A map of lines that grows with every scan.

use super::{FitSettings, LaserScan, LineKind, MapLine, MergeSettings, clusters, fit, merge};
use crate::interpret::{Heard, Sweep};
use sonard_model::geometry::DVec2;

/// Settings of a line map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineMapSettings {
    /// Sonar readings beyond this "logical" distance are left out, metres.
    pub logical_m: f64,
    /// Radius of the circle around the robot in which objects are reliably known, metres.
    pub known_m: f64,
    /// A later reading in such a circle contradicts it if it is farther than this from all that
    /// was known there, metres.
    pub contradicts_m: f64,
    /// Least radius of a sonar reading's circle of influence, metres.
    pub sonar_radius_m: f64,
    /// The same of a laser reading, metres. The paper needs none, its readings being close to
    /// each other; but noise makes pairs of readings that are closer still.
    pub laser_radius_m: f64,
    /// Laser readings beyond this are too noisy for segments, metres.
    pub laser_logical_m: f64,
    /// Leave out sonar readings from behind what the laser saw, which the paper keeps, being of no
    /// use to a robot before the wall.
    pub opaque: bool,
    /// A sonar line that a laser contradicts along so much of its length is dropped whole, and what
    /// is left of one after a cut is kept from this length on, metres.
    pub least_rest_m: f64,
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
            laser_radius_m: 0.02,
            laser_logical_m: 2.0,
            opaque: true,
            least_rest_m: 0.15,
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
    /// What the laser saw: up to there nothing stands.
    views: Vec<LaserScan>,
    /// The segments in it: nothing can be sensed through them.
    screens: Vec<[DVec2; 2]>,
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
        let is_close = |point: &DVec2| point.distance(robot) <= self.settings.known_m;
        let close: Vec<DVec2> = kept.iter().copied().filter(is_close).collect();
        self.cut_around(robot, &close);
        self.known.push((robot, close));
        let (fitted, radius_m) = (self.settings.sonar, self.settings.sonar_radius_m);
        for cluster in clusters(&kept, radius_m) {
            let points: Vec<DVec2> = cluster.iter().map(|at| kept[*at]).collect();
            for segment in fit(&points, &fitted) {
                self.take_in(MapLine {
                    ends: segment.ends,
                    terminal: [false; 2],
                    kind: LineKind::Sonar,
                    confidence: segment.confidence,
                    seen_from: robot,
                });
            }
        }
        echoes.len() - kept.len()
    }

    /// Adds what a laser saw; returns its segments.
    pub fn add_laser(&mut self, scan: &LaserScan) -> Vec<MapLine> {
        let seen = scan.lines(&self.settings);
        for line in &seen {
            self.screens.push(line.ends);
            self.take_in(*line);
        }
        self.views.push(scan.clone());
        self.cut_cleared(scan);
        seen
    }

    /// The three rules: not beyond the logical distance, not against what is known around a place
    /// where the robot was, not between the laser and what it saw; and not behind that either.
    fn may_be(&self, robot: DVec2, point: DVec2) -> bool {
        let LineMapSettings { logical_m, known_m, contradicts_m, .. } = self.settings;
        let known = |(place, objects): &(DVec2, Vec<DVec2>)| {
            place.distance(point) < known_m
                && *place != robot
                && objects.iter().all(|object| object.distance(point) > contradicts_m)
        };
        point.distance(robot) <= logical_m
            && !self.known.iter().any(known)
            && !self.is_cleared(robot, point)
    }

    /// Whether the laser saw that nothing is at a point, or that it can't be sensed from a place.
    fn is_cleared(&self, from: DVec2, point: DVec2) -> bool {
        let LineMapSettings { contradicts_m, opaque, laser_logical_m, .. } = self.settings;
        self.views.iter().any(|view| view.clears(point, laser_logical_m, contradicts_m))
            || opaque && self.is_hidden(from, point)
    }

    /// Whether a laser's segment, or a line confirmed at both ends, stands between two points.
    fn is_hidden(&self, from: DVec2, point: DVec2) -> bool {
        let is_whole = |line: &&MapLine| line.kind != LineKind::Sonar && line.terminal == [true; 2];
        let whole = self.lines.iter().filter(is_whole).map(|line| line.ends);
        let mut screens = self.screens.iter().copied().chain(whole);
        screens.any(|screen| hides(screen, from, point, self.settings.contradicts_m))
    }

    /// Cuts out of the sonar lines what the laser contradicts, now that it has seen this too.
    fn cut_cleared(&mut self, latest: &LaserScan) {
        let LineMapSettings { contradicts_m, laser_logical_m, least_rest_m, .. } = self.settings;
        let is_absent = |point| latest.clears(point, laser_logical_m, contradicts_m);
        let cut = |line: &MapLine| {
            if line.kind != LineKind::Sonar {
                return vec![*line];
            }
            let (absent, count) = samples(line).fold((0, 0), |(absent, count), point| {
                (absent + usize::from(is_absent(point)), count + 1)
            });
            let is_contradicted = absent as f64 * line.length_m() >= least_rest_m * count as f64;
            if is_contradicted || self.is_told(line) {
                return Vec::new();
            }
            rests(line, least_rest_m, |point| !self.is_cleared(line.seen_from, point))
        };
        self.lines = self.lines.iter().flat_map(cut).collect();
    }

    /// Whether a sonar line lies on one that the laser saw, so that it tells nothing.
    fn is_told(&self, line: &MapLine) -> bool {
        let better = self.lines.iter().filter(|other| other.kind != LineKind::Sonar);
        let near_m = self.settings.merge.distance_m;
        better.into_iter().any(|other| line.ends.iter().all(|end| other.distance_m(*end) < near_m))
    }

    /// Cuts out of the sonar lines what lies close to the robot and isn't heard there.
    fn cut_around(&mut self, robot: DVec2, heard: &[DVec2]) {
        let LineMapSettings { known_m, contradicts_m, least_rest_m, .. } = self.settings;
        let lines = std::mem::take(&mut self.lines);
        let cut = |line: MapLine| {
            // Of a mirror-like wall only a part is heard; it speaks for the whole.
            let off_m = |point: &DVec2| line.direction().perp_dot(*point - line.ends[0]).abs();
            let is_heard = heard.iter().any(|point| off_m(point) < contradicts_m);
            if line.kind != LineKind::Sonar || is_heard || line.distance_m(robot) > known_m {
                return vec![line];
            }
            rests(&line, least_rest_m, |point| point.distance(robot) > known_m)
        };
        self.lines = lines.into_iter().flat_map(cut).collect();
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

/// Points along a line, at least two.
fn samples(line: &MapLine) -> impl ExactSizeIterator<Item = DVec2> + use<> {
    const STEP_M: f64 = 0.02;
    let steps = (line.length_m() / STEP_M).ceil().max(1.0);
    let [a, b] = line.ends;
    (0..steps as usize + 1).map(move |step| a.lerp(b, step as f64 / steps))
}

/// What is left of a line where only some of its points are kept; not what is shorter than asked
/// for, unless nothing was cut.
fn rests(line: &MapLine, least_m: f64, keep: impl Fn(DVec2) -> bool) -> Vec<MapLine> {
    let points: Vec<(usize, DVec2)> = samples(line).enumerate().collect();
    let last = points.len() - 1;
    let kept: Vec<(usize, DVec2)> = points.into_iter().filter(|(_, point)| keep(*point)).collect();
    if kept.len() == last + 1 {
        return vec![*line];
    }
    kept.chunk_by(|a, b| b.0 - a.0 == 1)
        .map(|run| (run[0], run[run.len() - 1]))
        .map(|((from, a), (to, b))| MapLine {
            ends: [a, b],
            terminal: [line.terminal[0] && from == 0, line.terminal[1] && to == last],
            ..*line
        })
        .filter(|rest| rest.length_m() >= least_m)
        .collect()
}

/// Whether a segment stands between two points, `margin_m` or more before the second; its outermost
/// bits, as long as the margin, don't count.
fn hides([a, b]: [DVec2; 2], from: DVec2, point: DVec2, margin_m: f64) -> bool {
    let (way, side) = (point - from, b - a);
    let across = way.perp_dot(side);
    let along_way = (a - from).perp_dot(side) / across;
    let along_side_m = (a - from).perp_dot(way) / across * side.length();
    let height_m = side.perp_dot(point - a).abs() / side.length();
    (0.0..=1.0).contains(&along_way)
        && (margin_m..=side.length() - margin_m).contains(&along_side_m)
        && height_m > margin_m
}

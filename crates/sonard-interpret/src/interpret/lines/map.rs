//! Line map built incrementally from sonar and laser scans.

use super::{FitSettings, LaserScan, LineKind, MapLine, MergeSettings, clusters, fit, merge};
use crate::interpret::{BeamOutcome, Sweep};
use sonard_model::geometry::DVec2;

/// Settings of a line map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineMapSettings {
    /// "Logical" distance beyond which sonar readings are discarded, metres.
    pub logical_m: f64,
    /// Radius around the robot within which objects are reliably detected, metres.
    pub known_m: f64,
    /// Distance from everything detected within such a circle at which a later reading in it is
    /// contradicted, metres.
    pub contradicts_m: f64,
    /// Minimum radius of a sonar reading's circle of influence, metres.
    pub sonar_radius_m: f64,
    /// Minimum radius of a laser reading's circle of influence, metres. The paper needs none,
    /// since its readings are dense; but noise produces pairs of readings that are closer still.
    pub laser_radius_m: f64,
    /// Maximum range of laser readings for segments, metres; beyond it they are too noisy.
    pub laser_logical_m: f64,
    /// Discard sonar readings from behind what the laser detected. The paper keeps them, but
    /// they are of no use to a robot in front of the wall.
    pub opaque: bool,
    /// Contradicted length from which a sonar line is dropped entirely, and minimum length of
    /// the remainder of a cut line, metres.
    pub min_rest_m: f64,
    /// Fit of sonar segments.
    pub sonar: FitSettings,
    /// Fit of laser segments.
    pub laser: FitSettings,
    /// Merging of lines.
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
            min_rest_m: 0.15,
            sonar: FitSettings::default(),
            laser: FitSettings { tolerance_m: 0.02, min_points: 5, min_length_m: 0.03 },
            merge: MergeSettings::default(),
        }
    }
}

/// Map of line segments.
#[derive(Debug, Clone, Default)]
pub struct LineMap {
    settings: LineMapSettings,
    lines: Vec<MapLine>,
    /// Past robot positions, each with the readings close to it.
    known: Vec<(DVec2, Vec<DVec2>)>,
    /// Laser scans: free space up to their readings.
    views: Vec<LaserScan>,
    /// Laser segments, opaque to sonar.
    screens: Vec<[DVec2; 2]>,
}

impl LineMap {
    /// Empty map.
    #[must_use]
    pub fn new(settings: LineMapSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// Line segments of the map.
    #[must_use]
    pub fn lines(&self) -> &[MapLine] {
        &self.lines
    }

    /// Mutable line segments, to confirm their ends.
    pub fn lines_mut(&mut self) -> &mut [MapLine] {
        &mut self.lines
    }

    /// Adds a sonar scan and returns the number of readings discarded by the three rules.
    pub fn add_sonar(&mut self, sweep: &Sweep) -> usize {
        let robot = sweep.pose.position();
        let echoes: Vec<DVec2> = sweep
            .beams
            .iter()
            .filter_map(|beam| match beam.outcome {
                BeamOutcome::Echo(range_m) => Some(sweep.point(beam, range_m)),
                _ => None,
            })
            .collect();
        let kept: Vec<DVec2> =
            echoes.iter().copied().filter(|point| self.is_plausible(robot, *point)).collect();
        let is_close = |point: &DVec2| point.distance(robot) <= self.settings.known_m;
        let close: Vec<DVec2> = kept.iter().copied().filter(is_close).collect();
        self.cut_around(robot, &close);
        self.known.push((robot, close));
        let (fit_settings, radius_m) = (self.settings.sonar, self.settings.sonar_radius_m);
        for cluster in clusters(&kept, radius_m) {
            let points: Vec<DVec2> = cluster.iter().map(|at| kept[*at]).collect();
            for segment in fit(&points, &fit_settings) {
                self.insert(MapLine {
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

    /// Adds a laser scan and returns its segments.
    pub fn add_laser(&mut self, scan: &LaserScan) -> Vec<MapLine> {
        let seen = scan.lines(&self.settings);
        for line in &seen {
            self.screens.push(line.ends);
            self.insert(*line);
        }
        self.views.push(scan.clone());
        self.cut_cleared(scan);
        seen
    }

    /// Applies the three rules: within the logical distance, consistent with readings around an
    /// earlier robot position, and not in space cleared by the laser, nor behind its segments.
    fn is_plausible(&self, robot: DVec2, point: DVec2) -> bool {
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

    /// Returns `true` if the laser cleared a point, or if it is hidden from a position.
    fn is_cleared(&self, from: DVec2, point: DVec2) -> bool {
        let LineMapSettings { contradicts_m, opaque, laser_logical_m, .. } = self.settings;
        self.views.iter().any(|view| view.clears(point, laser_logical_m, contradicts_m))
            || opaque && self.is_hidden(from, point)
    }

    /// Returns `true` if a laser segment or a line confirmed at both ends lies between two points.
    fn is_hidden(&self, from: DVec2, point: DVec2) -> bool {
        let is_whole = |line: &&MapLine| line.kind != LineKind::Sonar && line.terminal == [true; 2];
        let whole = self.lines.iter().filter(is_whole).map(|line| line.ends);
        let mut screens = self.screens.iter().copied().chain(whole);
        screens.any(|screen| hides(screen, from, point, self.settings.contradicts_m))
    }

    /// Cuts out of the sonar lines everything that the latest laser scan contradicts.
    fn cut_cleared(&mut self, latest: &LaserScan) {
        let LineMapSettings { contradicts_m, laser_logical_m, min_rest_m: least_rest_m, .. } =
            self.settings;
        let is_absent = |point| latest.clears(point, laser_logical_m, contradicts_m);
        let cut = |line: &MapLine| {
            if line.kind != LineKind::Sonar {
                return vec![*line];
            }
            let (absent, count) = samples(line).fold((0, 0), |(absent, count), point| {
                (absent + usize::from(is_absent(point)), count + 1)
            });
            let is_contradicted = absent as f64 * line.length_m() >= least_rest_m * count as f64;
            if is_contradicted || self.is_redundant(line) {
                return Vec::new();
            }
            remainders(line, least_rest_m, |point| !self.is_cleared(line.seen_from, point))
        };
        self.lines = self.lines.iter().flat_map(cut).collect();
    }

    /// Returns `true` if a sonar line coincides with one that the laser detected.
    fn is_redundant(&self, line: &MapLine) -> bool {
        let better = self.lines.iter().filter(|other| other.kind != LineKind::Sonar);
        let near_m = self.settings.merge.distance_m;
        better.into_iter().any(|other| line.ends.iter().all(|end| other.distance_m(*end) < near_m))
    }

    /// Cuts out of the sonar lines everything close to the robot that is not detected there.
    fn cut_around(&mut self, robot: DVec2, detected: &[DVec2]) {
        let LineMapSettings { known_m, contradicts_m, min_rest_m: least_rest_m, .. } =
            self.settings;
        let lines = std::mem::take(&mut self.lines);
        let cut = |line: MapLine| {
            // Only a part of a specular wall returns an echo; it confirms the whole.
            let off_m = |point: &DVec2| line.direction().perp_dot(*point - line.ends[0]).abs();
            let is_detected = detected.iter().any(|point| off_m(point) < contradicts_m);
            if line.kind != LineKind::Sonar || is_detected || line.distance_m(robot) > known_m {
                return vec![line];
            }
            remainders(&line, least_rest_m, |point| point.distance(robot) > known_m)
        };
        self.lines = lines.into_iter().flat_map(cut).collect();
    }

    /// Inserts a line, merged with all lines of the same wall.
    fn insert(&mut self, mut line: MapLine) {
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

/// Pieces of a line at least `min_m` long whose points are all kept; the line itself if nothing
/// is cut.
fn remainders(line: &MapLine, min_m: f64, keep: impl Fn(DVec2) -> bool) -> Vec<MapLine> {
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
        .filter(|rest| rest.length_m() >= min_m)
        .collect()
}

/// Returns `true` if a segment lies between two points, `margin_m` or more before the second. The
/// outermost pieces of the segment, of the length of the margin, are ignored.
fn hides([a, b]: [DVec2; 2], from: DVec2, point: DVec2, margin_m: f64) -> bool {
    let (ray, side) = (point - from, b - a);
    let across = ray.perp_dot(side);
    let along_ray = (a - from).perp_dot(side) / across;
    let along_side_m = (a - from).perp_dot(ray) / across * side.length();
    let height_m = side.perp_dot(point - a).abs() / side.length();
    (0.0..=1.0).contains(&along_ray)
        && (margin_m..=side.length() - margin_m).contains(&along_side_m)
        && height_m > margin_m
}

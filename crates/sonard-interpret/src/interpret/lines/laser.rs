//! Segments of a laser scan, and which of their ends are the ends of what stands there.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LineKind, LineMapSettings, MapLine, clusters, fit};
use sonard_model::geometry::{DVec2, Pose, wrap_360};

/// A laser scan from one position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LaserScan {
    /// Where it stood; azimuth 0 is its heading.
    pub pose: Pose,
    /// Its readings, counter-clockwise.
    pub returns: Vec<LaserReturn>,
}

/// One reading of a laser.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LaserReturn {
    /// Degrees counter-clockwise from the heading.
    pub azimuth_deg: f64,
    /// Distance, metres; `null` where nothing came back.
    pub range_m: Option<f64>,
}

/// So many readings beyond a segment's end say what is there.
const BEYOND: usize = 6;
/// What is so much farther or nearer than the segment's line is something else, metres.
const JUMP_M: f64 = 0.10;
/// Segments whose ends are so close meet in a corner, metres.
const CORNER_M: f64 = 0.10;
/// And turn by at least this angle there, degrees.
const CORNER_DEG: f64 = 20.0;

impl LaserScan {
    /// Place of a reading in the world, metres; `None` for one without a range that can be.
    fn point(&self, at: usize) -> Option<DVec2> {
        let LaserReturn { azimuth_deg, range_m } = self.returns[at];
        let range_m = range_m.filter(|range_m| range_m.is_finite() && *range_m > 0.0)?;
        Some(self.pose.point_at(azimuth_deg, range_m)).filter(|point| point.is_finite())
    }

    /// The segments seen nearer than the logical distance. An end is terminal if two segments meet
    /// there in a corner, or if the readings beyond it come from farther away. It is not where the
    /// field of view ends, or where something nearer hides the rest.
    #[must_use]
    pub fn lines(&self, settings: &LineMapSettings) -> Vec<MapLine> {
        let robot = self.pose.position();
        let near: Vec<(usize, DVec2)> = (0..self.returns.len())
            .filter_map(|at| Some((at, self.point(at)?)))
            .filter(|(_, point)| point.distance(robot) <= settings.laser_logical_m)
            .collect();
        let points: Vec<DVec2> = near.iter().map(|(_, point)| *point).collect();
        let mut lines = Vec::new();
        for cluster in clusters(&points, settings.laser_radius_m) {
            let of_cluster: Vec<DVec2> = cluster.iter().map(|at| points[*at]).collect();
            for segment in fit(&of_cluster, &settings.laser) {
                let [first, last] = [segment.from, segment.from + segment.points - 1]
                    .map(|place| near[cluster[place]].0);
                let terminal = [
                    self.is_border(first, false, segment.ends),
                    self.is_border(last, true, segment.ends),
                ];
                lines.push(MapLine {
                    ends: segment.ends,
                    terminal,
                    kind: LineKind::Laser,
                    confidence: segment.confidence,
                    seen_from: robot,
                });
            }
        }
        join_corners(&mut lines);
        // A bit between two corners that are one has nothing left.
        lines.retain(|line| line.length_m() >= settings.laser.least_length_m);
        lines
    }

    /// Whether the laser saw through a point, which is nearer than `reach_m`, to what is farther
    /// away by more than `margin_m`. That is the paper's triangle between the robot and a segment,
    /// for any shape of what was seen.
    #[must_use]
    pub fn clears(&self, point: DVec2, reach_m: f64, margin_m: f64) -> bool {
        let off = point - self.pose.position();
        let (Some(first), distance_m) = (self.returns.first(), off.length()) else { return false };
        if distance_m > reach_m {
            return false;
        }
        let turn_deg = off.to_angle().to_degrees() - self.pose.heading_deg - first.azimuth_deg;
        let azimuth_deg = first.azimuth_deg + wrap_360(turn_deg);
        let next = self.returns.partition_point(|one| one.azimuth_deg < azimuth_deg);
        let is_farther =
            |one: &LaserReturn| one.range_m.is_none_or(|range_m| range_m > distance_m + margin_m);
        match self.returns.get(next.saturating_sub(1)..=next) {
            Some(around) if next > 0 => around.iter().all(is_farther),
            _ => false,
        }
    }

    /// Whether most of the readings beyond one are from behind the line through `ends`.
    fn is_border(&self, at: usize, upwards: bool, ends: [DVec2; 2]) -> bool {
        let beyond = (1..=BEYOND).filter_map(|step| match upwards {
            true => Some(at + step).filter(|place| *place < self.returns.len()),
            false => at.checked_sub(step),
        });
        let behind: Vec<bool> = beyond.map(|place| self.is_behind(place, at, ends)).collect();
        let count = behind.iter().filter(|behind| **behind).count();
        behind.len() == BEYOND && 2 * count > BEYOND
    }

    /// Whether a reading is from behind a line that goes through the reading `known`.
    fn is_behind(&self, at: usize, known: usize, [a, b]: [DVec2; 2]) -> bool {
        let LaserReturn { azimuth_deg, range_m } = self.returns[at];
        let Some(range_m) = range_m else { return true };
        let ray = DVec2::from_angle(self.pose.direction_rad(azimuth_deg));
        let along = b - a;
        let slant = ray.perp_dot(along);
        let crossing_m = (a - self.pose.position()).perp_dot(along) / slant;
        let line_m = match crossing_m.is_finite() && crossing_m > 0.0 {
            true => crossing_m,
            false => self.returns[known].range_m.unwrap_or_default(),
        };
        range_m > line_m + JUMP_M
    }
}

/// Lets segments whose ends meet at an angle end in the crossing of their lines.
fn join_corners(lines: &mut [MapLine]) {
    for one in 1..lines.len() {
        for other in 0..one {
            let pairs = [0, 1].into_iter().flat_map(|i| [0, 1].map(|j| (i, j)));
            for (i, j) in pairs {
                let (a, b) = (lines[one].ends[i], lines[other].ends[j]);
                let Some(corner) = lines[one].meets(&lines[other], CORNER_DEG) else { continue };
                if a.distance(b) < CORNER_M
                    && a.distance(corner) < CORNER_M
                    && b.distance(corner) < CORNER_M
                {
                    (lines[one].ends[i], lines[other].ends[j]) = (corner, corner);
                    (lines[one].terminal[i], lines[other].terminal[j]) = (true, true);
                }
            }
        }
    }
}

//! Segments of a laser scan, and confirmation of their ends.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LineKind, LineMapSettings, MapLine, clusters, fit};
use sonard_model::geometry::{DVec2, Pose, wrap_360};

/// A laser scan from one position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LaserScan {
    /// Pose of the laser; azimuth 0 is the heading.
    pub pose: Pose,
    /// Readings, counter-clockwise.
    pub returns: Vec<LaserReturn>,
}

/// Reading of a laser scan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LaserReturn {
    /// Azimuth, degrees counter-clockwise from the heading.
    pub azimuth_deg: f64,
    /// Distance, metres; `null` without a return.
    pub range_m: Option<f64>,
}

/// Number of readings beyond the end of a segment that are evaluated.
const BEYOND: usize = 6;
/// Range difference from the line of a segment that indicates another object, metres.
const JUMP_M: f64 = 0.10;
/// Maximum distance between ends of segments that form a corner, metres.
const CORNER_M: f64 = 0.10;
/// Minimum angle between the segments of a corner, degrees.
const CORNER_DEG: f64 = 20.0;

impl LaserScan {
    /// World position of a reading, metres; `None` without a valid range.
    fn point(&self, at: usize) -> Option<DVec2> {
        let LaserReturn { azimuth_deg, range_m } = self.returns[at];
        let range_m = range_m.filter(|range_m| range_m.is_finite() && *range_m > 0.0)?;
        Some(self.pose.point_at(azimuth_deg, range_m)).filter(|point| point.is_finite())
    }

    /// Segments within the logical distance. An end is terminal if two segments form a corner
    /// there, or if the readings beyond it are farther away. It is not where the field of view
    /// ends, or where something nearer hides the rest.
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
        // A short piece between two corners that coincide has no length left.
        lines.retain(|line| line.length_m() >= settings.laser.min_length_m);
        lines
    }

    /// Returns `true` if the laser saw through a point within `reach_m` to something farther away
    /// by more than `margin_m`. That generalizes the paper's triangle between the robot and a
    /// segment to any shape.
    #[must_use]
    pub fn clears(&self, point: DVec2, reach_m: f64, margin_m: f64) -> bool {
        let off = point - self.pose.position();
        let (Some(first), distance_m) = (self.returns.first(), off.length()) else { return false };
        if distance_m > reach_m {
            return false;
        }
        let turn_deg = off.to_angle().to_degrees() - self.pose.heading_deg - first.azimuth_deg;
        let azimuth_deg = first.azimuth_deg + wrap_360(turn_deg);
        let next = self.returns.partition_point(|reading| reading.azimuth_deg < azimuth_deg);
        let is_farther = |reading: &LaserReturn| {
            reading.range_m.is_none_or(|range_m| range_m > distance_m + margin_m)
        };
        match self.returns.get(next.saturating_sub(1)..=next) {
            Some(around) if next > 0 => around.iter().all(is_farther),
            _ => false,
        }
    }

    /// Returns `true` if most readings beyond reading `at` are behind the line through `ends`.
    fn is_border(&self, at: usize, upwards: bool, ends: [DVec2; 2]) -> bool {
        let beyond = (1..=BEYOND).filter_map(|step| match upwards {
            true => Some(at + step).filter(|place| *place < self.returns.len()),
            false => at.checked_sub(step),
        });
        let behind: Vec<bool> = beyond.map(|place| self.is_behind(place, at, ends)).collect();
        let count = behind.iter().filter(|behind| **behind).count();
        behind.len() == BEYOND && 2 * count > BEYOND
    }

    /// Returns `true` if a reading is behind a line that passes through the reading `known`.
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

/// Extends segments whose ends form a corner to the intersection of their lines.
fn join_corners(lines: &mut [MapLine]) {
    for first in 1..lines.len() {
        for second in 0..first {
            let pairs = [0, 1].into_iter().flat_map(|i| [0, 1].map(|j| (i, j)));
            for (i, j) in pairs {
                let (a, b) = (lines[first].ends[i], lines[second].ends[j]);
                let Some(corner) = lines[first].intersection(&lines[second], CORNER_DEG) else {
                    continue;
                };
                if a.distance(b) < CORNER_M
                    && a.distance(corner) < CORNER_M
                    && b.distance(corner) < CORNER_M
                {
                    (lines[first].ends[i], lines[second].ends[j]) = (corner, corner);
                    (lines[first].terminal[i], lines[second].terminal[j]) = (true, true);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpret::lines::LineKind;

    fn line(ends: [[f64; 2]; 2]) -> MapLine {
        MapLine {
            ends: ends.map(DVec2::from),
            terminal: [false; 2],
            kind: LineKind::Laser,
            confidence: 1.0,
            seen_from: DVec2::ZERO,
        }
    }

    /// Ends are moved only if both are near the corner.
    #[test]
    fn corners_need_both_ends() {
        let floor = line([[0.0, 0.0], [1.0, 0.0]]);
        let mut near = [floor, line([[1.06, 0.04], [1.06, 1.0]])];
        join_corners(&mut near);
        let corner = DVec2::new(1.06, 0.0);
        assert!(
            near[0].ends[1].distance(corner) < 1e-12 && near[1].ends[0].distance(corner) < 1e-12
        );
        assert_eq!((near[0].terminal, near[1].terminal), ([false, true], [true, false]));
        // Too far from each other, and the corner too far from the one or the other.
        for far in [
            [[1.06, 0.09], [1.06, 1.0]],
            [[1.06, 0.03], [0.61, 0.33]],
            [[0.99, 0.04], [0.49, 0.24]],
        ] {
            let before = [floor, line(far)];
            let mut lines = before;
            join_corners(&mut lines);
            assert_eq!(lines, before);
        }
    }
}

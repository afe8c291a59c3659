//! Objects as groups of lines, in the order of their exploration.

use sonard_interpret::interpret::lines::MapLine;
use sonard_model::geometry::DVec2;

/// Maximum distance between lines of one object, metres.
const ONE_OBJECT_M: f64 = 0.35;

/// Objects in the order of their discovery, the nearest first within one stop. The order is a
/// breadth-first search: the exploration of an object finishes before those discovered during it.
#[derive(Debug, Clone, Default)]
pub(super) struct Objects {
    /// Point on each object.
    anchors: Vec<DVec2>,
}

impl Objects {
    /// Adds the new objects of the map.
    pub(super) fn discover(&mut self, lines: &[MapLine], robot: DVec2) {
        let nearest = |group: &[usize]| {
            group
                .iter()
                .map(|at| nearest_point(&lines[*at], robot))
                .min_by(|a, b| a.distance(robot).total_cmp(&b.distance(robot)))
        };
        let mut fresh: Vec<DVec2> = groups(lines)
            .iter()
            .filter(|group| !self.anchors.iter().any(|anchor| is_on(lines, group, *anchor)))
            .filter_map(|group| nearest(group))
            .collect();
        fresh.sort_by(|a, b| a.distance(robot).total_cmp(&b.distance(robot)));
        self.anchors.extend(fresh);
    }

    /// Indices of the map lines of each object, in the order of discovery.
    pub(super) fn in_order(&self, lines: &[MapLine]) -> Vec<Vec<usize>> {
        let mut groups = groups(lines);
        let discovered = |group: &Vec<usize>| {
            let first = self.anchors.iter().position(|anchor| is_on(lines, group, *anchor));
            first.unwrap_or(usize::MAX)
        };
        groups.sort_by_key(discovered);
        groups
    }
}

fn is_on(lines: &[MapLine], group: &[usize], anchor: DVec2) -> bool {
    group.iter().any(|at| lines[*at].distance_m(anchor) < ONE_OBJECT_M)
}

fn nearest_point(line: &MapLine, to: DVec2) -> DVec2 {
    let place_m = line.direction().dot(to - line.ends[0]).clamp(0.0, line.length_m());
    line.ends[0] + place_m * line.direction()
}

/// Groups of lines closer than [`ONE_OBJECT_M`].
fn groups(lines: &[MapLine]) -> Vec<Vec<usize>> {
    let mut group: Vec<usize> = (0..lines.len()).collect();
    for first in 0..lines.len() {
        for second in 0..first {
            if group[first] != group[second] && are_near(&lines[first], &lines[second]) {
                let (from, to) = (group[first].max(group[second]), group[first].min(group[second]));
                group.iter_mut().filter(|name| **name == from).for_each(|name| *name = to);
            }
        }
    }
    let members =
        |name: usize| (0..lines.len()).filter(|at| group[*at] == name).collect::<Vec<_>>();
    (0..lines.len()).map(members).filter(|group| !group.is_empty()).collect()
}

/// Whether an end of one line is near the other line. Lines of one map do not cross far from their
/// ends.
fn are_near(a: &MapLine, b: &MapLine) -> bool {
    let off_m = |line: &MapLine, ends: [DVec2; 2]| {
        ends.map(|end| line.distance_m(end)).into_iter().fold(f64::INFINITY, f64::min)
    };
    off_m(a, b.ends).min(off_m(b, a.ends)) < ONE_OBJECT_M
}

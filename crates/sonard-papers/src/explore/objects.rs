//! Lines that belong to one object, and the order in which objects are explored.

use sonard_interpret::interpret::lines::MapLine;
use sonard_model::geometry::DVec2;

/// Lines closer than this are of one object, metres.
const ONE_OBJECT_M: f64 = 0.35;

/// Objects in the order in which they were discovered; within one stop the nearer comes first. That
/// is a breadth-first search: an object seen from another one waits until that is explored.
#[derive(Debug, Clone, Default)]
pub(super) struct Objects {
    /// A place on each.
    anchors: Vec<DVec2>,
}

impl Objects {
    /// Notes the objects of the map that are new.
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

    /// The lines of each object, in the order of their discovery, by their places in the map.
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

/// Lines that touch, or nearly so.
fn groups(lines: &[MapLine]) -> Vec<Vec<usize>> {
    let mut group: Vec<usize> = (0..lines.len()).collect();
    for one in 0..lines.len() {
        for other in 0..one {
            if group[one] != group[other] && are_near(&lines[one], &lines[other]) {
                let (from, to) = (group[one].max(group[other]), group[one].min(group[other]));
                group.iter_mut().filter(|name| **name == from).for_each(|name| *name = to);
            }
        }
    }
    let of = |name: usize| (0..lines.len()).filter(|at| group[*at] == name).collect::<Vec<_>>();
    (0..lines.len()).map(of).filter(|group| !group.is_empty()).collect()
}

/// Whether an end of one line is near the other; lines of one map don't cross far from their ends.
fn are_near(one: &MapLine, other: &MapLine) -> bool {
    let off_m = |line: &MapLine, ends: [DVec2; 2]| {
        ends.map(|end| line.distance_m(end)).into_iter().fold(f64::INFINITY, f64::min)
    };
    off_m(one, other.ends).min(off_m(other, one.ends)) < ONE_OBJECT_M
}

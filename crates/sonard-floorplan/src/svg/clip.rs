//! Clipping of lines at clip paths of any shape.

use std::rc::Rc;

use sonard_model::geometry::DVec2;
use usvg::{ClipPath, FillRule, Group, Node, Transform};

use super::outline::{Page, Polyline};

/// Part of a drawing that is visible: the intersection of regions.
#[derive(Debug, Clone, Default)]
pub(super) struct Visible {
    regions: Vec<Rc<Region>>,
}

/// Area of a clip path, metres: the union of shapes.
#[derive(Debug, Default)]
struct Region {
    shapes: Vec<ClipShape>,
}

#[derive(Debug)]
struct ClipShape {
    edges: Vec<[DVec2; 2]>,
    rule: FillRule,
}

/// Distance below which a point is on an edge, metres: a tenth of what a scene distinguishes.
const SAME_M: f64 = 1e-5;
/// Maximum number of edges of a region.
const MAX_EDGES: usize = 20_000;

impl Visible {
    /// Intersects with the clip path of a group; returns `false` if a part of it is not applied.
    pub(super) fn clip(&mut self, group: &Group, clip: &ClipPath, page: &Page) -> bool {
        let frame = group.abs_transform().pre_concat(clip.transform());
        let mut region = Region::default();
        let is_whole = region.add(clip.root(), frame, page);
        let edges: usize = region.shapes.iter().map(|shape| shape.edges.len()).sum();
        if !is_whole || edges > MAX_EDGES {
            return false;
        }
        self.regions.push(Rc::new(region));
        clip.clip_path().is_none_or(|further| self.clip(group, further, page))
    }

    /// Returns the visible parts of a line, each with a flag for closed lines.
    pub(super) fn cut(&self, (corners, is_closed): Polyline) -> Vec<Polyline> {
        let first = corners.first().copied().filter(|_| is_closed);
        let ends = corners.iter().copied().zip(corners.iter().skip(1).copied().chain(first));
        let mut parts: Vec<Polyline> = Vec::new();
        let (mut lines, mut whole_lines) = (0, 0);
        for (from, to) in ends {
            let visible = self.visible_spans(from, to);
            lines += 1;
            whole_lines += usize::from(visible == [[0.0, 1.0]]);
            for [begin, end] in visible {
                let (from, to) = (from.lerp(to, begin), from.lerp(to, end));
                match parts.last_mut() {
                    Some((part, _))
                        if part.last().is_some_and(|last| last.distance(from) < SAME_M) =>
                    {
                        part.push(to);
                    }
                    _ => parts.push((vec![from, to], false)),
                }
            }
        }
        if lines == whole_lines { vec![(corners, is_closed)] } else { parts }
    }

    /// Visible spans of a straight line, as shares of its length.
    fn visible_spans(&self, from: DVec2, to: DVec2) -> Vec<[f64; 2]> {
        let mut spans = vec![[0.0, 1.0]];
        let share = SAME_M / from.distance(to).max(SAME_M);
        for region in &self.regions {
            let mut crossings = region.crossings(from, to);
            crossings.extend([0.0, 1.0]);
            crossings.sort_by(f64::total_cmp);
            crossings.dedup_by(|next, last| *next - *last < share);
            let inside: Vec<[f64; 2]> = crossings
                .windows(2)
                .map(|ends| [ends[0], ends[1]])
                .filter(|[begin, end]| region.contains(from.lerp(to, begin.midpoint(*end))))
                .collect();
            spans = intersected(&spans, &inside);
        }
        spans
    }
}

/// Intersects two rising lists of spans, and joins spans that touch.
fn intersected(spans: &[[f64; 2]], others: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let pairs = spans.iter().flat_map(|span| others.iter().map(move |other| (span, other)));
    let mut found: Vec<[f64; 2]> = Vec::new();
    for (span, other) in pairs {
        let (begin, end) = (span[0].max(other[0]), span[1].min(other[1]));
        if begin >= end {
            continue;
        }
        match found.last_mut() {
            Some(last) if last[1] == begin => last[1] = end,
            _ => found.push([begin, end]),
        }
    }
    found
}

impl Region {
    /// Adds the shapes of a group; returns `false` if some are clipped themselves.
    fn add(&mut self, group: &Group, frame: Transform, page: &Page) -> bool {
        group.children().iter().all(|node| match node {
            Node::Group(group) if group.clip_path().is_none() => {
                self.add(group, frame.pre_concat(group.transform()), page)
            }
            Node::Group(_) => false,
            Node::Path(path) => {
                let Some(outline) = path.data().clone().transform(frame) else { return true };
                let edges = page.polylines(&outline).into_iter().flat_map(|(corners, _)| {
                    let next = corners.iter().cycle().skip(1).take(corners.len()).copied();
                    corners.iter().copied().zip(next).map(|(a, b)| [a, b]).collect::<Vec<_>>()
                });
                let rule = path.fill().map_or(FillRule::NonZero, usvg::Fill::rule);
                self.shapes.push(ClipShape { edges: edges.collect(), rule });
                true
            }
            Node::Image(_) | Node::Text(_) => true,
        })
    }

    fn contains(&self, point: DVec2) -> bool {
        self.shapes.iter().any(|shape| shape.contains(point))
    }

    /// Shares of a line's length at which it crosses an edge.
    fn crossings(&self, from: DVec2, to: DVec2) -> Vec<f64> {
        let along = to - from;
        let length = along.length();
        let crossing = |[a, b]: [DVec2; 2]| {
            let edge = b - a;
            let across = along.perp_dot(edge);
            if across.abs() > 1e-9 * length * edge.length() {
                let at = (a - from).perp_dot(edge) / across;
                let on_edge = (a - from).perp_dot(along) / across;
                let is_within = (-1e-9..=1.0 + 1e-9).contains(&on_edge);
                return [Some(at).filter(|_| is_within), None];
            }
            // On a parallel edge the line may begin or end to be covered.
            let on_line = |corner: DVec2| {
                let offset = corner - from;
                (offset.perp_dot(along).abs() < SAME_M * length)
                    .then(|| offset.dot(along) / (length * length))
            };
            [on_line(a), on_line(b)]
        };
        let edges = self.shapes.iter().flat_map(|shape| &shape.edges);
        let all = edges.flat_map(|edge| crossing(*edge)).flatten();
        all.filter(|at| (0.0..=1.0).contains(at)).collect()
    }
}

impl ClipShape {
    /// Returns `true` for a point inside by the fill rule, or on an edge.
    fn contains(&self, point: DVec2) -> bool {
        let mut winding = 0;
        for [a, b] in &self.edges {
            if distance_to([*a, *b], point) < SAME_M {
                return true;
            }
            let is_upward = a.y <= point.y && b.y > point.y;
            let is_downward = a.y > point.y && b.y <= point.y;
            let side = (*b - *a).perp_dot(point - *a);
            winding += i32::from(is_upward && side > 0.0) - i32::from(is_downward && side < 0.0);
        }
        match self.rule {
            FillRule::NonZero => winding != 0,
            FillRule::EvenOdd => winding % 2 != 0,
        }
    }
}

fn distance_to([a, b]: [DVec2; 2], point: DVec2) -> f64 {
    let edge = b - a;
    let at = ((point - a).dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance(a + at * edge)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(ends: &[(f64, f64)]) -> Vec<DVec2> {
        ends.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
    }

    fn visible(shapes: &[(&[(f64, f64)], FillRule)]) -> Visible {
        let shape = |(corners, rule): &(&[(f64, f64)], FillRule)| {
            let corners = line(corners);
            let next = corners.iter().cycle().skip(1).take(corners.len());
            let edges = corners.iter().zip(next).map(|(a, b)| [*a, *b]).collect();
            ClipShape { edges, rule: *rule }
        };
        let region = Region { shapes: shapes.iter().map(shape).collect() };
        Visible { regions: vec![Rc::new(region)] }
    }

    const BOX: [(f64, f64); 4] = [(4.0, 0.0), (6.0, 0.0), (6.0, 8.0), (4.0, 8.0)];

    #[test]
    fn lines_are_cut_at_a_box() {
        let visible = visible(&[(&BOX, FillRule::NonZero)]);
        let cut = visible.cut((line(&[(0.0, 4.0), (10.0, 4.0)]), false));
        assert_eq!(cut, [(line(&[(4.0, 4.0), (6.0, 4.0)]), false)]);
        // A ring that leaves the box is open; one inside, and the edge itself, stay closed.
        let ring = line(&[(5.0, 1.0), (9.0, 1.0), (9.0, 2.0), (5.0, 2.0)]);
        assert_eq!(visible.cut((ring, true)).len(), 2);
        for ring in [line(&[(4.5, 1.0), (5.5, 1.0), (5.0, 2.0)]), line(&BOX)] {
            assert_eq!(visible.cut((ring.clone(), true)), [(ring, true)]);
        }
        assert!(visible.cut((line(&[(0.0, 0.0), (1.0, 8.0)]), false)).is_empty());
        let unclipped = Visible::default().cut((line(&[(0.0, 0.0), (1e6, 0.0)]), false));
        assert_eq!(unclipped.len(), 1);
    }

    #[test]
    fn any_shape_clips() {
        let across = || (line(&[(0.0, 4.0), (10.0, 4.0)]), false);
        let spans = |visible: &Visible| -> Vec<[f64; 2]> {
            visible
                .cut(across())
                .iter()
                .map(|(part, _)| [part[0].x, part[part.len() - 1].x])
                .collect()
        };
        // A triangle; two boxes; a box with a hole, by both rules; no shape.
        let triangle = visible(&[(&[(2.0, 0.0), (8.0, 0.0), (5.0, 8.0)], FillRule::NonZero)]);
        assert_eq!(spans(&triangle), [[3.5, 6.5]]);
        let other = [(7.0, 0.0), (9.0, 0.0), (9.0, 8.0), (7.0, 8.0)];
        let two = visible(&[(&BOX, FillRule::NonZero), (&other, FillRule::NonZero)]);
        assert_eq!(spans(&two), [[4.0, 6.0], [7.0, 9.0]]);
        let star = [
            (1.0, 0.0),
            (9.0, 0.0),
            (9.0, 8.0),
            (1.0, 8.0),
            (1.0, 0.0),
            (3.0, 2.0),
            (7.0, 2.0),
            (7.0, 6.0),
            (3.0, 6.0),
            (3.0, 2.0),
        ];
        assert_eq!(spans(&visible(&[(&star, FillRule::EvenOdd)])), [[1.0, 3.0], [7.0, 9.0]]);
        assert_eq!(spans(&visible(&[(&star, FillRule::NonZero)])), [[1.0, 9.0]]);
        assert!(spans(&visible(&[])).is_empty());
    }

    #[test]
    fn regions_intersect() {
        let mut both = visible(&[(&BOX, FillRule::NonZero)]);
        let other = [(0.0, 0.0), (5.0, 0.0), (5.0, 8.0), (0.0, 8.0)];
        both.regions.extend(visible(&[(&other, FillRule::NonZero)]).regions);
        let cut = both.cut((line(&[(0.0, 4.0), (10.0, 4.0)]), false));
        assert_eq!(cut, [(line(&[(4.0, 4.0), (5.0, 4.0)]), false)]);
    }
}

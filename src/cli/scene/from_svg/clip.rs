//! Clipping of lines at rectangular clip paths.

use usvg::{ClipPath, Group, Node, Transform, tiny_skia_path::PathSegment};

use crate::geometry::DVec2;

/// Axis-parallel rectangle through which a drawing is visible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Window {
    low: [f64; 2],
    high: [f64; 2],
}

impl Default for Window {
    fn default() -> Self {
        Self { low: [f64::NEG_INFINITY; 2], high: [f64::INFINITY; 2] }
    }
}

impl Window {
    /// Intersection of two windows.
    pub(super) fn within(self, other: Self) -> Self {
        Self {
            low: [0, 1].map(|axis| self.low[axis].max(other.low[axis])),
            high: [0, 1].map(|axis| self.high[axis].min(other.high[axis])),
        }
    }

    fn is_open(self) -> bool {
        self == Self::default()
    }

    /// Transforms the window to other coordinates with parallel axes.
    pub(super) fn transformed(self, place: impl Fn([f64; 2]) -> DVec2) -> Self {
        if self.is_open() {
            return self;
        }
        let finite = |number: f64| number.clamp(-1e9, 1e9);
        let [a, b] = [self.low, self.high].map(|corner| place(corner.map(finite)));
        Self { low: [a.x.min(b.x), a.y.min(b.y)], high: [a.x.max(b.x), a.y.max(b.y)] }
    }

    /// Returns the visible parts of a line, each with a flag for closed lines.
    pub(super) fn cut(self, corners: Vec<DVec2>, is_closed: bool) -> Vec<(Vec<DVec2>, bool)> {
        let is_inside = |corner: &DVec2| {
            (0..2).all(|axis| (self.low[axis]..=self.high[axis]).contains(&corner[axis]))
        };
        if self.is_open() || corners.iter().all(is_inside) {
            return vec![(corners, is_closed)];
        }
        let first = corners.first().copied().filter(|_| is_closed);
        let ends = corners.iter().copied().zip(corners.iter().skip(1).copied().chain(first));
        let mut parts: Vec<(Vec<DVec2>, bool)> = Vec::new();
        for (from, to) in ends {
            let Some((from, to)) = self.seen(from, to) else { continue };
            match parts.last_mut() {
                Some((part, _)) if part.last().is_some_and(|last| last.distance(from) < 1e-9) => {
                    part.push(to);
                }
                _ => parts.push((vec![from, to], false)),
            }
        }
        parts
    }

    /// Visible part of a straight line (Liang and Barsky).
    fn seen(self, from: DVec2, to: DVec2) -> Option<(DVec2, DVec2)> {
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let delta = to[axis] - from[axis];
            let (below, above) = (self.low[axis] - from[axis], self.high[axis] - from[axis]);
            if delta == 0.0 {
                if below > 0.0 || above < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (below / delta, above / delta);
            enters = enters.max(a.min(b));
            leaves = leaves.min(a.max(b));
        }
        (enters < leaves).then(|| (from.lerp(to, enters), from.lerp(to, leaves)))
    }
}

/// Returns the rectangle of a group's clip path, if it is an axis-parallel one.
pub(super) fn rectangle(group: &Group, clip: &ClipPath) -> Option<Window> {
    let frame = group.abs_transform().pre_concat(clip.transform());
    let window = of_children(clip.root(), frame)?;
    Some(match clip.clip_path() {
        Some(further) => window.within(rectangle(group, further)?),
        None => window,
    })
}

fn of_children(root: &Group, frame: Transform) -> Option<Window> {
    let [only] = root.children() else { return None };
    match only {
        Node::Group(group) if group.clip_path().is_none() => {
            of_children(group, frame.pre_concat(group.transform()))
        }
        Node::Path(path) => {
            let outline = path.data().clone().transform(frame)?;
            let mut corners: Vec<[f64; 2]> = Vec::new();
            for segment in outline.segments() {
                match segment {
                    PathSegment::MoveTo(to) | PathSegment::LineTo(to) => {
                        corners.push([to.x.into(), to.y.into()]);
                    }
                    PathSegment::Close => {}
                    _ => return None,
                }
            }
            corners.dedup();
            if corners.len() > 1 && corners.first() == corners.last() {
                corners.pop();
            }
            of_corners(&corners)
        }
        _ => None,
    }
}

/// Returns the rectangle of four corners, if adjacent ones share x or y.
fn of_corners(corners: &[[f64; 2]]) -> Option<Window> {
    let [a, b, c, d] = corners else { return None };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-3;
    let is_side = |a: &[f64; 2], b: &[f64; 2]| near(a[0], b[0]) != near(a[1], b[1]);
    let is_upright = [(a, b), (b, c), (c, d), (d, a)].iter().all(|(a, b)| is_side(a, b));
    let of = |pick: fn(f64, f64) -> f64, axis: usize| {
        corners.iter().map(|corner| corner[axis]).reduce(pick).unwrap_or_default()
    };
    is_upright.then(|| Window {
        low: [of(f64::min, 0), of(f64::min, 1)],
        high: [of(f64::max, 0), of(f64::max, 1)],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_at_the_window() {
        let window = Window { low: [4.0, 0.0], high: [6.0, 8.0] };
        let line =
            |ends: &[(f64, f64)]| ends.iter().map(|&(x, y)| DVec2::new(x, y)).collect::<Vec<_>>();
        let cut = window.cut(line(&[(0.0, 4.0), (10.0, 4.0)]), false);
        assert_eq!(cut, [(line(&[(4.0, 4.0), (6.0, 4.0)]), false)]);
        // A ring that leaves the window is open; one inside stays closed.
        let cut = window.cut(line(&[(5.0, 1.0), (9.0, 1.0), (9.0, 2.0), (5.0, 2.0)]), true);
        assert_eq!(cut.len(), 2);
        let inside = line(&[(4.5, 1.0), (5.5, 1.0), (5.0, 2.0)]);
        assert_eq!(window.cut(inside.clone(), true), [(inside, true)]);
        assert!(window.cut(line(&[(0.0, 0.0), (1.0, 8.0)]), false).is_empty());
        assert_eq!(Window::default().cut(line(&[(0.0, 0.0), (1e6, 0.0)]), false).len(), 1);
    }
}

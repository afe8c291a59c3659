//! Label placement without overlap of other labels or walls.

use super::canvas::{Anchor, Px, Rect, text_width_px};

/// Occupied areas and lines of a panel.
#[derive(Debug, Clone)]
pub(super) struct Labels {
    panel: Rect,
    taken: Vec<Rect>,
    lines: Vec<(Px, Px)>,
    marks: Vec<Rect>,
}

impl Labels {
    /// Empty panel.
    pub(super) fn new(panel: Rect) -> Self {
        Self { panel, taken: Vec::new(), lines: Vec::new(), marks: Vec::new() }
    }

    /// Keeps a rectangle free of labels.
    pub(super) fn keep_free(&mut self, rect: Rect) {
        self.taken.push(rect);
    }

    /// Keeps a line free of labels.
    pub(super) fn keep_off(&mut self, from: Px, to: Px) {
        self.lines.push((from, to));
    }

    /// Keeps a mark free of labels that find another place.
    pub(super) fn avoid_mark(&mut self, at: Px, radius_px: f64) {
        let side = 2.0 * radius_px;
        self.marks.push(Rect::new(at.x - radius_px, at.y - radius_px, side, side));
    }

    /// Number of marks that a text with its baseline at `at` would cover.
    fn covered(&self, at: Px, anchor: Anchor, size_px: f64, text: &str) -> usize {
        let rect = text_rect(at, anchor, size_px, text);
        self.marks.iter().filter(|mark| mark.overlaps(&rect)).count()
    }

    /// Number of marks that a text rotated about its middle at `at` would cover.
    pub(super) fn covered_turned(&self, at: Px, turn_deg: f64, size_px: f64, text: &str) -> usize {
        let back = Px::from_angle(-turn_deg.to_radians());
        let half = Px::new(text_width_px(text, size_px), size_px) / 2.0;
        let is_covered = |mark: &&Rect| {
            let off = back.rotate(mark.center() - at).abs();
            let reach = half + Px::splat(mark.width() / 2.0);
            off.x < reach.x && off.y < reach.y
        };
        self.marks.iter().filter(is_covered).count()
    }

    /// Reserves the area of a text with its baseline at `at`; returns `false` if it is occupied.
    pub(super) fn place(&mut self, at: Px, anchor: Anchor, size_px: f64, text: &str) -> bool {
        let rect = text_rect(at, anchor, size_px, text);
        self.reserve(rect, 0.0, Px::new(rect.width(), rect.height()))
    }

    /// Reserves the first free one of several places, those that cover the fewest marks first;
    /// `None` if all are occupied.
    pub(super) fn place_at_one(
        &mut self,
        places: impl IntoIterator<Item = (Px, Anchor)>,
        size_px: f64,
        text: &str,
    ) -> Option<(Px, Anchor)> {
        let mut places: Vec<_> = places.into_iter().collect();
        places.sort_by_key(|(at, anchor)| self.covered(*at, *anchor, size_px, text));
        places.into_iter().find(|(at, anchor)| self.place(*at, *anchor, size_px, text))
    }

    /// Reserves the area of a text rotated about its middle at `at`; `false` if it is occupied.
    pub(super) fn place_turned(&mut self, at: Px, turn_deg: f64, size_px: f64, text: &str) -> bool {
        let (sin, cos) = turn_deg.to_radians().sin_cos();
        let (w, h) = (text_width_px(text, size_px), size_px);
        let width = w * cos.abs() + h * sin.abs();
        let height = w * sin.abs() + h * cos.abs();
        let around = Rect::new(at.x - width / 2.0, at.y - height / 2.0, width, height);
        self.reserve(around, turn_deg, Px::new(w, h))
    }

    /// Reserves `around`, the bounding box of a text of a size rotated about its middle.
    fn reserve(&mut self, around: Rect, turn_deg: f64, size: Px) -> bool {
        let back = Px::from_angle(-turn_deg.to_radians());
        let middle = around.center();
        let crossed = |&(from, to): &(Px, Px)| {
            let [from, to] = [from, to].map(|at| back.rotate(at - middle));
            crosses(from, to, size / 2.0)
        };
        let free = self.panel.encloses(&around)
            && !self.taken.iter().any(|other| other.overlaps(&around))
            && !self.lines.iter().any(crossed);
        if free {
            self.taken.push(around);
        }
        free
    }
}

/// Area of a text with its baseline at `at`.
fn text_rect(at: Px, anchor: Anchor, size_px: f64, text: &str) -> Rect {
    let width = text_width_px(text, size_px);
    let left = match anchor {
        Anchor::Start => at.x,
        Anchor::Middle => at.x - width / 2.0,
        Anchor::End => at.x - width,
    };
    Rect::new(left, at.y - 0.8 * size_px, width, 1.1 * size_px)
}

/// Returns `true` if a segment crosses a rectangle centred on the origin (Liang-Barsky clipping).
fn crosses(from: Px, to: Px, half: Px) -> bool {
    let along = to - from;
    let mut part = [0.0_f64, 1.0];
    for (at, along, half) in [(from.x, along.x, half.x), (from.y, along.y, half.y)] {
        if along.abs() < 1e-9 {
            if at.abs() > half {
                return false;
            }
        } else {
            let [a, b] = [(-half - at) / along, (half - at) / along];
            part = [part[0].max(a.min(b)), part[1].min(a.max(b))];
        }
    }
    part[0] <= part[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_avoids_walls() {
        let panel = Rect::new(0.0, 0.0, 200.0, 200.0);
        let mut labels = Labels::new(panel);
        labels.keep_off(Px::new(0.0, 0.0), Px::new(200.0, 200.0));
        let at = |x: f64, y: f64| Px::new(x, y);
        assert!(!labels.place(at(80.0, 100.0), Anchor::Start, 12.0, "a wall here"));
        assert!(labels.place(at(120.0, 50.0), Anchor::Start, 12.0, "none"));
        // Parallel to the wall at a distance of 10 pixels.
        let parallel = at(100.0, 100.0) + 10.0 * Px::new(-1.0, 1.0).normalize();
        assert!(labels.place_turned(parallel, 45.0, 12.0, "along"));
        assert!(!labels.place_turned(at(50.0, 50.0), 45.0, 12.0, "over"));
    }

    #[test]
    fn covered_marks_are_counted() {
        let mut labels = Labels::new(Rect::new(0.0, 0.0, 200.0, 200.0));
        (0..10).for_each(|i| labels.avoid_mark(Px::new(20.0 * f64::from(i), 100.0), 3.0));
        let covered = |y| labels.covered(Px::new(0.0, y), Anchor::Start, 12.0, "along the wall");
        assert!(covered(104.0) >= 3, "{}", covered(104.0));
        assert_eq!(covered(80.0), 0);
        let turned = |y, turn_deg| {
            labels.covered_turned(Px::new(100.0, y), turn_deg, 12.0, "along the wall")
        };
        assert!(turned(100.0, 0.0) >= 3 && turned(100.0, 90.0) == 1 && turned(80.0, 0.0) == 0);
    }
}

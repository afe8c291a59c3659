//! Keeps texts from covering each other.

use super::canvas::{Anchor, Px, Rect, text_width_px};

/// What is taken on a panel.
#[derive(Debug, Clone)]
pub(super) struct Labels {
    panel: Rect,
    taken: Vec<Rect>,
}

impl Labels {
    /// Texts within this panel.
    pub(super) fn new(panel: Rect) -> Self {
        Self { panel, taken: Vec::new() }
    }

    /// Keeps a region free of texts.
    pub(super) fn keep_free(&mut self, rect: Rect) {
        self.taken.push(rect);
    }

    /// Takes the room of a text on the base line at `at`, unless some of it is taken.
    pub(super) fn place(&mut self, at: Px, anchor: Anchor, size_px: f64, text: &str) -> bool {
        let width = text_width_px(text, size_px);
        let left = match anchor {
            Anchor::Start => at.x,
            Anchor::Middle => at.x - width / 2.0,
            Anchor::End => at.x - width,
        };
        self.take(Rect::new(left, at.y - 0.8 * size_px, width, 1.1 * size_px))
    }

    /// The same for a text turned about its middle, which is at `at`.
    pub(super) fn place_turned(&mut self, at: Px, turn_deg: f64, size_px: f64, text: &str) -> bool {
        let (sin, cos) = turn_deg.to_radians().sin_cos();
        let (w, h) = (text_width_px(text, size_px), size_px);
        let width = w * cos.abs() + h * sin.abs();
        let height = w * sin.abs() + h * cos.abs();
        self.take(Rect::new(at.x - width / 2.0, at.y - height / 2.0, width, height))
    }

    fn take(&mut self, rect: Rect) -> bool {
        let free = self.panel.encloses(&rect) && !self.taken.iter().any(|other| other.meets(&rect));
        if free {
            self.taken.push(rect);
        }
        free
    }
}

//! Legends: rows of samples with their labels.

use super::{
    canvas::{Anchor, Layer, MarkShape, Px, Rect, text_width_px},
    theme,
};

/// Legend entry.
#[derive(Debug, Clone, PartialEq)]
pub struct LegendEntry {
    /// Drawn sample.
    pub sample: LegendSample,
    /// Meaning of the sample.
    pub text: String,
}

/// Sample drawn before the label.
#[derive(Debug, Clone, PartialEq)]
pub enum LegendSample {
    /// Mark of a reading.
    Mark {
        /// Shape of the mark.
        shape: MarkShape,
        /// Fill.
        colour: &'static str,
    },
    /// Open circle.
    Ring {
        /// Stroke.
        colour: &'static str,
    },
    /// Line.
    Line {
        /// Stroke.
        colour: &'static str,
        /// Stroke width, px.
        width_px: f64,
        /// SVG dash array, or `none`.
        dash: &'static str,
    },
    /// Short radial stroke.
    Tick {
        /// Stroke.
        colour: &'static str,
    },
    /// Framed area.
    Patch {
        /// Fill.
        colour: &'static str,
    },
    /// Arrow that points out of the view.
    Outward,
}

impl LegendEntry {
    /// Entry of a sample and its meaning.
    pub fn new(sample: LegendSample, text: impl Into<String>) -> Self {
        Self { sample, text: text.into() }
    }
}

const ROW_PX: f64 = 21.0;
const SAMPLE_PX: f64 = 30.0;
const GAP_PX: f64 = 20.0;

/// Draws the entries from `at` (upper left) in rows of at most `width_px`; returns the layer
/// and its height.
pub fn draw(entries: &[LegendEntry], at: Px, width_px: f64) -> (Layer, f64) {
    let mut layer = Layer::new("legend");
    let (mut x, mut row) = (0.0, 0.0);
    for entry in entries {
        let width = SAMPLE_PX + text_width_px(&entry.text, theme::TEXT_PX);
        if x > 0.0 && x + width > width_px {
            (x, row) = (0.0, row + 1.0);
        }
        let middle = at + Px::new(x, (row + 0.5) * ROW_PX);
        layer.add(sample(&entry.sample, middle));
        let text_at = middle + Px::new(SAMPLE_PX, 4.5);
        layer.text(text_at, Anchor::Start, theme::TEXT_PX, &entry.text);
        x += width + GAP_PX;
    }
    let rows = if entries.is_empty() { 0.0 } else { row + 1.0 };
    (layer, rows * ROW_PX)
}

fn sample(sample: &LegendSample, at: Px) -> Layer {
    let middle = at + Px::new(SAMPLE_PX / 2.0 - 3.0, 0.0);
    let left = at + Px::new(1.0, 0.0);
    let right = at + Px::new(SAMPLE_PX - 6.0, 0.0);
    match sample {
        LegendSample::Mark { shape, colour } => {
            let mut layer = Layer::new("sample").with("fill", *colour);
            layer.mark(*shape, middle, 4.0, None);
            layer
        }
        LegendSample::Ring { colour } => {
            let mut layer = Layer::new("sample").stroked(colour, 1.0);
            layer.line(left, middle - Px::new(3.5, 0.0));
            layer.circle(middle, 3.5);
            layer
        }
        LegendSample::Line { colour, width_px, dash } => {
            let mut layer =
                Layer::new("sample").stroked(colour, *width_px).with("stroke-dasharray", *dash);
            layer.line(left, right);
            layer
        }
        LegendSample::Patch { colour } => {
            let mut layer = Layer::new("sample").stroked(theme::FRAME, 1.0).with("fill", *colour);
            layer.rect(Rect::new(left.x, at.y - 6.0, right.x - left.x, 12.0), 0.0);
            layer
        }
        LegendSample::Tick { colour } => {
            let mut layer = Layer::new("sample").stroked(colour, 1.3);
            for shift in [-5.0, 0.0, 5.0] {
                layer.line(middle + Px::new(shift, -4.0), middle + Px::new(shift, 4.0));
            }
            layer
        }
        LegendSample::Outward => {
            let mut layer = Layer::new("sample").with("fill", theme::INK);
            let [nose, tail] = [Px::new(6.0, 0.0), Px::new(-4.0, 5.0)];
            layer.polygon(&[middle + nose, middle + tail, middle + Px::new(tail.x, -tail.y)]);
            layer
        }
    }
}

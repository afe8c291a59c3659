//! Reliability diagrams: observed frequency over mean predicted probability.

use crate::calibration::{Reliability, ReliabilityBin};
use sonard_plot::{
    Picture,
    canvas::{Anchor, Layer, MarkShape, Px, Rect},
    caption,
    legend::{self, LegendEntry, LegendSample},
    theme, ticks,
};

const SIDE_PX: f64 = 520.0;
const COUNTS_PX: f64 = 110.0;

/// Draws the observed frequency over the mean predicted probability of each bin, with the counts
/// below.
///
/// On the dashed line predictions are perfectly calibrated. Below it they are overconfident.
#[must_use]
pub fn draw_reliability(title: &str, lines: &[String], reliability: &Reliability) -> Picture {
    let (heading, top) = caption::draw(title, Some("SIMULATED, nothing measured"), lines);
    let left = (theme::PAGE_PX - SIDE_PX) / 2.0;
    let panel = Rect::new(left, top + 24.0, SIDE_PX, SIDE_PX);
    let counts = Rect::new(left, panel.bottom + 34.0, SIDE_PX, COUNTS_PX);
    let mut page = Layer::new("reliability");
    page.add(heading);
    page.add(frame(panel));
    page.add(points(panel, &reliability.bins));
    page.add(bars(counts, &reliability.bins));
    let below = Px::new(left, counts.bottom + 50.0);
    let entries = [
        LegendEntry::new(
            LegendSample::Mark { shape: MarkShape::Dot, colour: theme::BLUE },
            "bins of 0.1",
        ),
        LegendEntry::new(
            LegendSample::Line { colour: theme::QUIET, width_px: 1.2, dash: "6 4" },
            "perfectly calibrated",
        ),
    ];
    let (key, height) = legend::draw(&entries, below, SIDE_PX);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + height + theme::MARGIN_PX / 2.0, page)
}

fn at(panel: Rect, x: f64, y: f64) -> Px {
    Px::new(panel.left + x * panel.width(), panel.bottom - y * panel.height())
}

fn frame(panel: Rect) -> Layer {
    let mut layer = Layer::new("frame");
    let mut grid = Layer::new("grid").stroked(theme::GRID, theme::HAIRLINE_PX);
    let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
    for part in ticks::multiples(0.0, 1.0, 0.2) {
        grid.line(at(panel, part, 0.0), at(panel, part, 1.0));
        grid.line(at(panel, 0.0, part), at(panel, 1.0, part));
        let label_at = at(panel, 0.0, part) + Px::new(-6.0, 4.0);
        numbers.text(label_at, Anchor::End, theme::SMALL_PX, &ticks::label(part, 0.1));
    }
    let mut ideal = Layer::new("ideal").stroked(theme::QUIET, 1.2).with("stroke-dasharray", "6 4");
    ideal.line(at(panel, 0.0, 0.0), at(panel, 1.0, 1.0));
    let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
    border.rect(panel, 0.0);
    layer.extend([grid, numbers, ideal, border]);
    let above = Px::new(panel.left, panel.top - 6.0);
    layer.text(above, Anchor::Start, theme::TEXT_PX, "observed frequency");
    layer
}

/// Marks of the filled bins at their mean predicted probabilities, joined by a line.
fn points(panel: Rect, bins: &[ReliabilityBin]) -> Layer {
    let filled: Vec<&ReliabilityBin> = bins.iter().filter(|bin| bin.count > 0).collect();
    let mut line = Layer::new("line").stroked(theme::BLUE, 1.4);
    line.runs([filled.iter().map(|b| at(panel, b.mean_predicted, b.observed)).collect::<Vec<_>>()]);
    let mut marks = Layer::new("bins").with("fill", theme::BLUE);
    for bin in filled {
        let hint = format!(
            "{} predictions, mean predicted probability {:.3}, observed frequency {:.3}",
            bin.count, bin.mean_predicted, bin.observed
        );
        marks.mark(MarkShape::Dot, at(panel, bin.mean_predicted, bin.observed), 5.0, Some(&hint));
    }
    let mut layer = Layer::new("points");
    layer.extend([line, marks]);
    layer
}

/// Histogram of predictions on a logarithmic scale, because max are near 0 or 1.
fn bars(panel: Rect, bins: &[ReliabilityBin]) -> Layer {
    let max = bins.iter().map(|bin| bin.count).max().unwrap_or(1).max(10) as f64;
    let height = |count: f64| (1.0 + count).log10() / (1.0 + max).log10();
    let mut layer = Layer::new("counts");
    let mut fill = Layer::new("bars").with("fill", theme::SKY);
    let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
    for (index, bin) in bins.iter().enumerate() {
        let part = |i: usize| i as f64 / bins.len() as f64;
        let low = at(panel, part(index), 0.0);
        let high = at(panel, part(index + 1), 0.82 * height(bin.count as f64));
        fill.rect(Rect { left: low.x + 1.0, top: high.y, right: high.x - 1.0, bottom: low.y }, 0.0);
        let above = Px::new((low.x + high.x) / 2.0, high.y - 3.0);
        numbers.text(above, Anchor::Middle, theme::SMALL_PX, &bin.count.to_string());
    }
    for part in ticks::multiples(0.0, 1.0, 0.2) {
        let below = at(panel, part, 0.0) + Px::new(0.0, 15.0);
        numbers.text(below, Anchor::Middle, theme::SMALL_PX, &ticks::label(part, 0.1));
    }
    let middle = at(panel, 0.5, 0.0) + Px::new(0.0, 32.0);
    numbers.text(middle, Anchor::Middle, theme::SMALL_PX, "mean predicted probability");
    let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
    border.rect(panel, 0.0);
    layer.extend([fill, numbers, border]);
    let above = Px::new(panel.left, panel.top - 6.0);
    layer.text(above, Anchor::Start, theme::TEXT_PX, "count (logarithmic)");
    layer
}

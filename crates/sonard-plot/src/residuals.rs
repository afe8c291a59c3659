//! Residuals at full width, with their distribution.

use super::{
    canvas::{Anchor, Layer, Px, Rect},
    caption,
    legend::{self, LegendEntry, LegendSample},
    legend_entries,
    picture::Picture,
    readings::{PlottedBeam, PlottedScan},
    scan_caption, scan_strips,
    strip::{AzimuthAxis, AzimuthStrip},
    theme,
};
use sonard_model::scene::Scene;
use sonard_records::ScanView;

const RESIDUAL_PX: f64 = 300.0;
const RANGE_PX: f64 = 190.0;
const HISTOGRAM_PX: f64 = 110.0;

/// Draws measured minus predicted range against azimuth with a histogram on the same scale, and
/// range against azimuth below.
///
/// A log without predictions has no residuals, which the picture states. The scene only
/// contributes its name and that of the pose.
#[must_use]
pub fn draw_residuals(scans: &[ScanView], scene: Option<&Scene>) -> Picture {
    let readings: Vec<PlottedScan> = scans.iter().map(PlottedScan::from_scan).collect();
    let mut lines = scan_caption::lines(scans);
    if readings.iter().all(|scan| scan.residuals().next().is_none()) {
        lines.push("No beam has both a measured and a predicted range: no residuals.".into());
    }
    let (heading, top) =
        caption::draw(&scan_caption::title(scans, scene), scan_caption::badge(scans), &lines);
    let azimuths =
        AzimuthAxis::from_plan(scans.first().and_then(|s| Some(&s.start.as_ref()?.plan)));
    let left = theme::MARGIN_PX + 50.0;
    let width = theme::PAGE_PX - theme::MARGIN_PX - left - HISTOGRAM_PX - 14.0;
    let residual = Rect::new(left, top + 20.0, width, RESIDUAL_PX);
    let range = Rect::new(left, residual.bottom + 30.0, width, RANGE_PX);

    let mut page = Layer::new("residuals");
    page.add(heading);
    page.add(scan_strips::residual(residual, azimuths, &readings, false));
    page.add(histogram(residual, azimuths, &readings));
    page.add(scan_strips::range(range, azimuths, &readings, true));
    let below = Px::new(theme::MARGIN_PX, range.bottom + 46.0);
    let legend_width = theme::PAGE_PX - 2.0 * theme::MARGIN_PX;
    let mut entries = legend_entries::with_range(&readings);
    let is_predicted = |beam: &PlottedBeam| beam.model_range_m.is_some();
    if readings.iter().any(|scan| scan.has_model && scan.beams.iter().any(is_predicted)) {
        let sample = LegendSample::Line { colour: theme::SKY, width_px: 7.0, dash: "none" };
        entries.push(LegendEntry::new(sample, "prediction"));
    }
    let (key, height) = legend::draw(&entries, below, legend_width);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + height + theme::MARGIN_PX / 2.0, page)
}

/// Histogram of the residuals, next to the strip and on its scale.
fn histogram(residuals: Rect, azimuths: AzimuthAxis, scans: &[PlottedScan]) -> Layer {
    const BINS: usize = 50;
    let strip =
        AzimuthStrip { panel: residuals, azimuths, scale: scan_strips::residual_scale(scans) };
    let mut counts = [0_usize; BINS];
    for (_, residual_m) in scans.iter().flat_map(PlottedScan::residuals) {
        let down = (strip.y(1e3 * residual_m) - residuals.top) / residuals.height();
        counts[((down * BINS as f64) as usize).min(BINS - 1)] += 1;
    }
    let max = counts.into_iter().max().unwrap_or(0).max(1);
    let panel = Rect::new(residuals.right + 14.0, residuals.top, HISTOGRAM_PX, residuals.height());
    let bin_px = panel.height() / BINS as f64;
    let mut bars = Layer::new("bars").with("fill", theme::BLUE);
    for (i, count) in counts.into_iter().enumerate().filter(|(_, count)| *count > 0) {
        let length = (panel.width() - 4.0) * count as f64 / max as f64;
        let top = panel.top + i as f64 * bin_px;
        bars.rect(Rect::new(panel.left, top + 0.4, length, bin_px - 0.8), 0.0);
    }
    let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
    border.rect(panel, 0.0);
    let mut layer = Layer::new("histogram");
    layer.add(bars);
    layer.add(border);
    let above = Px::new(panel.left, panel.top - 6.0);
    layer.text(above, Anchor::Start, theme::TEXT_PX, &format!("beams (max {max})"));
    layer
}

//! Floor plan with the lines fitted to scans.

use super::{
    canvas::{Layer, MarkShape},
    legend::{LegendEntry, LegendSample},
    legend_entries, overlay,
    picture::Picture,
    plan::PlanProjection,
    theme,
};
use sonard_interpret::interpret::lines::{LineKind, MapLine};
use sonard_model::{geometry::DVec2, scene::Scene};
use sonard_records::{ScanView, text::format_count};

const KINDS: [(LineKind, &str, &str); 3] = [
    (LineKind::Sonar, "sonar line", theme::BLUE),
    (LineKind::Laser, "laser line", theme::VERMILLION),
    (LineKind::Complex, "line confirmed by laser", theme::GREEN),
];

/// Draws a line map over the readings: the colour of a line depends on its source, its opacity on
/// the confidence; confirmed ends have dots.
#[must_use]
pub fn draw_lines(scans: &[ScanView], scene: Option<&Scene>, lines: &[MapLine]) -> Picture {
    let samples = entries(lines);
    let dot = LegendSample::Mark { shape: MarkShape::Dot, colour: theme::NO_ECHO };
    let entries: Vec<LegendEntry> = samples
        .into_iter()
        .chain(has_ranges(scans).then(|| LegendEntry::new(dot, "reading")))
        .chain(scene.map(legend_entries::materials).into_iter().flatten())
        .collect();
    let finding = format_count(lines.len(), "line");
    let draw = |plan: &PlanProjection| lines.iter().map(|line| layer(plan, line)).collect();
    let ends: Vec<DVec2> = lines.iter().flat_map(|line| line.ends).collect();
    overlay::draw(scans, scene, finding, &ends, draw, |_| None, &entries)
}

/// Returns `true` if a reading has a range, and so a dot.
pub(super) fn has_ranges(scans: &[ScanView]) -> bool {
    scans.iter().flat_map(|scan| &scan.pings).any(|ping| ping.range_m.is_some())
}

/// Legend entries for the kinds of lines present.
pub fn entries<'a>(lines: impl IntoIterator<Item = &'a MapLine>) -> Vec<LegendEntry> {
    let present: Vec<LineKind> = lines.into_iter().map(|line| line.kind).collect();
    let kinds = KINDS.iter().filter(|(kind, ..)| present.contains(kind));
    let sample = |colour| LegendSample::Line { colour, width_px: 2.6, dash: "none" };
    kinds.map(|(_, name, colour)| LegendEntry::new(sample(colour), *name)).collect()
}

/// Line with its confirmed ends.
pub fn layer(plan: &PlanProjection, line: &MapLine) -> Layer {
    let colour = KINDS
        .iter()
        .find(|(kind, ..)| *kind == line.kind)
        .map_or(theme::INK, |(.., colour)| colour);
    let mut layer = Layer::new("line")
        .stroked(colour, 2.6)
        .with("stroke-opacity", 0.35 + 0.65 * line.confidence.clamp(0.0, 1.0));
    let [a, b] = line.ends.map(|end| plan.px(end));
    layer.line(a, b);
    let mut ends = Layer::new("ends").with("fill", colour);
    for (at, _) in [a, b].into_iter().zip(line.terminal).filter(|(_, terminal)| *terminal) {
        ends.mark(MarkShape::Dot, at, 3.5, None);
    }
    layer.add(ends);
    layer
}

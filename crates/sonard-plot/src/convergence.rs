//! Errors of a method against its resolution, on logarithmic axes.

use super::{
    canvas::{Anchor, Layer, MarkShape, Px, Rect},
    caption,
    legend::{self, LegendEntry, LegendSample},
    picture::Picture,
    theme,
};

const PANEL_PX: f64 = 400.0;
const MARK_PX: f64 = 4.0;

/// Distance of the row of zero errors below the smallest error, decades.
const ZERO_ROW_BELOW: f64 = 0.35;

/// Errors of one case as a function of resolution.
#[derive(Debug, Clone, PartialEq)]
pub struct Convergence {
    /// Name in the legend.
    pub name: String,
    /// Resolution and error, ordered by resolution. An error of 0 is drawn in a row of its own;
    /// otherwise both must be positive.
    pub errors: Vec<[f64; 2]>,
}

/// Draws the error of each case against the resolution. The titles of both axes include units;
/// `badge` states the provenance of the readings ([`badge_for`](crate::badge_for)).
#[must_use]
pub fn draw_convergence(
    title: &str,
    badge: Option<&str>,
    lines: &[String],
    [across, up]: [&str; 2],
    cases: &[Convergence],
) -> Picture {
    let (heading, top) = caption::draw(title, badge, lines);
    let (left, width) = (theme::MARGIN_PX + 62.0, theme::PAGE_PX - 2.0 * theme::MARGIN_PX - 80.0);
    let panel = Rect::new(left, top + 24.0, width, PANEL_PX);
    let axes = LogAxes::around(panel, cases);
    let mut page = Layer::new("convergence");
    page.add(heading);
    page.add(grid(&axes));
    let mut entries = Vec::new();
    for (number, case) in cases.iter().enumerate() {
        let colour = COLOURS[number % COLOURS.len()];
        let dash = theme::WALL_DASHES[number / COLOURS.len() % theme::WALL_DASHES.len()];
        page.add(curve(&axes, case, colour, dash));
        let sample = LegendSample::Line { colour, width_px: 2.0, dash };
        entries.push(LegendEntry::new(sample, case.name.as_str()));
    }
    page.text(Px::new(left, panel.top - 8.0), Anchor::Start, theme::TEXT_PX, up);
    let middle = Px::new(panel.center().x, panel.bottom + 36.0);
    page.text(middle, Anchor::Middle, theme::SMALL_PX, across);
    let (key, height) = legend::draw(&entries, Px::new(left, panel.bottom + 52.0), width);
    page.add(key);
    Picture::new(theme::PAGE_PX, panel.bottom + 52.0 + height + theme::MARGIN_PX / 2.0, page)
}

const COLOURS: [&str; 6] =
    [theme::BLUE, theme::VERMILLION, theme::GREEN, theme::PURPLE, theme::ORANGE, theme::SKY];

/// Logarithmic axes, in decades.
struct LogAxes {
    panel: Rect,
    across: [f64; 2],
    up: [f64; 2],
    /// Position of the row of zero errors.
    zero_row: f64,
}

impl LogAxes {
    fn around(panel: Rect, cases: &[Convergence]) -> Self {
        let all = || cases.iter().flat_map(|case| &case.errors).copied();
        let across = span(all().map(|[at, _]| at));
        let up = span(all().map(|[_, error]| error));
        let zero_row = up[0] - ZERO_ROW_BELOW;
        let across = [across[0] - 0.08, across[1] + 0.08];
        Self { panel, across, up: [zero_row - 0.15, up[1] + 0.15], zero_row }
    }

    fn x(&self, value: f64) -> f64 {
        let share = (value.log10() - self.across[0]) / (self.across[1] - self.across[0]);
        self.panel.left + share.clamp(0.0, 1.0) * self.panel.width()
    }

    fn y(&self, error: f64) -> f64 {
        let power = if error > 0.0 { error.log10() } else { self.zero_row };
        let share = (power - self.up[0]) / (self.up[1] - self.up[0]);
        self.panel.bottom - share.clamp(0.0, 1.0) * self.panel.height()
    }
}

/// Decimal logarithms of the smallest and largest positive value; one decade if there are none.
fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let powers = values.filter(|value| value.is_normal() && *value > 0.0).map(f64::log10);
    let [min, max] = powers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], power| {
        [low.min(power), high.max(power)]
    });
    if min.is_finite() { [min, max.max(min + 0.1)] } else { [-1.0, 0.0] }
}

/// 1, 2 and 5 times each power of ten within the limits.
fn round_values([from, to]: [f64; 2]) -> impl Iterator<Item = f64> {
    let decades = from.floor() as i32..=to.ceil() as i32;
    decades
        .flat_map(|decade| [1.0, 2.0, 5.0].map(|times| times * 10_f64.powi(decade)))
        .filter(move |value| (from..=to).contains(&value.log10()))
}

fn grid(axes: &LogAxes) -> Layer {
    let panel = axes.panel;
    let mut layer = Layer::new("axes");
    let mut lines = Layer::new("grid").stroked(theme::GRID, theme::HAIRLINE_PX);
    let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
    for value in round_values(axes.across) {
        let x = axes.x(value);
        lines.line(Px::new(x, panel.top), Px::new(x, panel.bottom));
        let place = Px::new(x, panel.bottom + 16.0);
        numbers.text(place, Anchor::Middle, theme::SMALL_PX, &value.to_string());
    }
    let known = round_values([axes.zero_row + ZERO_ROW_BELOW - 0.01, axes.up[1]]);
    for value in known.chain([0.0]) {
        let y = axes.y(value);
        lines.line(Px::new(panel.left, y), Px::new(panel.right, y));
        let place = Px::new(panel.left - 5.0, y + 4.0);
        numbers.text(place, Anchor::End, theme::SMALL_PX, &value.to_string());
    }
    let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
    border.rect(panel, 0.0);
    layer.extend([lines, border, numbers]);
    layer
}

fn curve(axes: &LogAxes, case: &Convergence, colour: &'static str, dash: &'static str) -> Layer {
    let drawn = case.errors.iter().filter(|[at, error]| *at > 0.0 && error.is_finite());
    let points: Vec<(Px, String)> = drawn
        .map(|&[at, error]| (Px::new(axes.x(at), axes.y(error)), format!("{at}: {error}")))
        .collect();
    let mut layer = Layer::new("case");
    let mut line = Layer::new("line").stroked(colour, 1.8).with("stroke-dasharray", dash);
    line.runs([points.iter().map(|(at, _)| *at).collect::<Vec<_>>()]);
    let mut marks = Layer::new("marks").with("fill", colour);
    for (at, hint) in &points {
        marks.mark(MarkShape::Dot, *at, MARK_PX, Some(&format!("{}, {hint}", case.name)));
    }
    layer.extend([line, marks]);
    layer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_errors_are_the_lowest_row() {
        let case =
            Convergence { name: "room".into(), errors: vec![[2.0, 0.3], [0.5, 0.004], [0.1, 0.0]] };
        let axes = LogAxes::around(Rect::new(0.0, 0.0, 100.0, 100.0), std::slice::from_ref(&case));
        assert!(axes.y(0.0) > axes.y(0.004) && axes.y(0.004) > axes.y(0.3));
        assert!(axes.x(0.1) < axes.x(0.5));
        let svg = draw_convergence("t", None, &[], ["spacing", "share"], &[case]).to_svg();
        assert_eq!(svg.matches("<title>room, ").count(), 3);
        let nothing = Convergence { name: "none".into(), errors: vec![[f64::NAN, f64::NAN]] };
        let svg = draw_convergence("t", None, &[], ["x", "y"], &[nothing]).to_svg();
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}

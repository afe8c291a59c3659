//! Quantities stacked over a common axis, such as drift over days or spread over azimuths.

use super::{
    canvas::{Anchor, Layer, MarkShape, Px, Rect},
    caption,
    legend::{self, LegendEntry, LegendSample},
    picture::Picture,
    theme, ticks,
};

const STRIP_PX: f64 = 130.0;
const BETWEEN_PX: f64 = 34.0;
const MARK_PX: f64 = 3.0;

/// Quantity with its values and limits.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name of the quantity, with its unit.
    pub title: String,
    /// Values, in any order.
    pub points: Vec<SeriesPoint>,
    /// Lower and upper limit of valid values.
    pub limits: Option<[f64; 2]>,
}

/// Value of a series.
#[derive(Debug, Clone, PartialEq)]
pub struct SeriesPoint {
    /// Position on the common axis.
    pub x: f64,
    /// Value of the quantity.
    pub y: f64,
    /// Tooltip of the mark.
    pub hint: String,
    /// Whether the value is rejected, and drawn as a cross.
    pub rejected: bool,
}

/// Draws quantities stacked over a common axis with the title `x_title`, including its unit.
/// `badge` states the provenance of the readings, unless from hardware
/// ([`badge_among`](crate::badge_among)).
#[must_use]
pub fn draw_series(
    title: &str,
    badge: Option<&str>,
    lines: &[String],
    x_title: &str,
    strips: &[Series],
) -> Picture {
    let (heading, top) = caption::draw(title, badge, lines);
    let along = || strips.iter().flat_map(|strip| &strip.points).map(|point| point.x);
    let axis = Axis::over(along());
    let (left, width) = (theme::MARGIN_PX + 62.0, theme::PAGE_PX - 2.0 * theme::MARGIN_PX - 70.0);

    let mut page = Layer::new("series");
    page.add(heading);
    let mut bottom = top;
    for (index, strip) in strips.iter().enumerate() {
        let panel = Rect::new(left, bottom + 22.0, width, STRIP_PX);
        let last = index + 1 == strips.len();
        page.add(draw_strip(strip, panel, axis, last));
        bottom = panel.bottom + if last { 0.0 } else { BETWEEN_PX - 22.0 };
    }
    let middle = Px::new(left + width / 2.0, bottom + 34.0);
    page.text(middle, Anchor::Middle, theme::SMALL_PX, x_title);
    bottom += 34.0 + theme::MARGIN_PX;
    if strips.iter().flat_map(|strip| &strip.points).any(|point| point.rejected) {
        let entry =
            |shape, colour, text| LegendEntry::new(LegendSample::Mark { shape, colour }, text);
        let entries = [
            entry(MarkShape::Dot, theme::BLUE, "accepted"),
            entry(MarkShape::Cross, theme::VERMILLION, "rejected"),
        ];
        let (key, height) = legend::draw(&entries, Px::new(left, bottom), width);
        page.add(key);
        bottom += height;
    }
    Picture::new(theme::PAGE_PX, bottom + theme::MARGIN_PX / 2.0, page)
}

/// Interval drawn from edge to edge.
#[derive(Debug, Clone, Copy)]
struct Axis {
    from: f64,
    to: f64,
}

impl Axis {
    /// Interval of the finite values; of unit length if they are equal.
    fn over(values: impl Iterator<Item = f64>) -> Self {
        let none = Self { from: f64::INFINITY, to: f64::NEG_INFINITY };
        let all = values
            .filter(|value| value.is_finite())
            .fold(none, |axis, value| Self { from: axis.from.min(value), to: axis.to.max(value) });
        match all.to - all.from {
            span if span > 0.0 => all,
            _ if all.from.is_finite() => Self { from: all.from - 0.5, to: all.from + 0.5 },
            _ => Self { from: 0.0, to: 1.0 },
        }
    }

    /// Interval of the values with a margin, including nearby limits.
    fn around(strip: &Series) -> Self {
        let values = Self::over(strip.points.iter().map(|point| point.y));
        let span = values.to - values.from;
        let near = (values.from - span)..=(values.to + span);
        let limits = strip.limits.into_iter().flatten().filter(|limit| near.contains(limit));
        let ends = [values.from, values.to].into_iter();
        let all = Self::over(ends.chain(limits));
        let room = 0.12 * (all.to - all.from);
        Self { from: all.from - room, to: all.to + room }
    }

    fn share(&self, value: f64) -> f64 {
        ((value - self.from) / (self.to - self.from)).clamp(0.0, 1.0)
    }
}

fn draw_strip(strip: &Series, panel: Rect, along: Axis, last: bool) -> Layer {
    let values = Axis::around(strip);
    let x = |value: f64| panel.left + along.share(value) * panel.width();
    let y = |value: f64| panel.bottom - values.share(value) * panel.height();
    let mut layer = Layer::new("strip");
    let mut grid = Layer::new("grid").stroked(theme::GRID, theme::HAIRLINE_PX);
    let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
    let step = ticks::nice_step(values.to - values.from, panel.height() / 28.0);
    for value in ticks::multiples(values.from, values.to, step) {
        grid.line(Px::new(panel.left, y(value)), Px::new(panel.right, y(value)));
        let place = Px::new(panel.left - 5.0, y(value) + 4.0);
        numbers.text(place, Anchor::End, theme::SMALL_PX, &ticks::label(value, step));
    }
    let step = ticks::nice_step(along.to - along.from, panel.width() / 80.0);
    for value in ticks::multiples(along.from, along.to, step) {
        grid.line(Px::new(x(value), panel.top), Px::new(x(value), panel.bottom));
        if last {
            let place = Px::new(x(value), panel.bottom + 15.0);
            numbers.text(place, Anchor::Middle, theme::SMALL_PX, &ticks::label(value, step));
        }
    }
    let mut limits =
        Layer::new("limits").stroked(theme::VERMILLION, 1.0).with("stroke-dasharray", "6 4");
    let shown = |limit: &f64| (values.from..=values.to).contains(limit);
    for limit in strip.limits.into_iter().flatten().filter(shown) {
        limits.line(Px::new(panel.left, y(limit)), Px::new(panel.right, y(limit)));
    }
    let mut accepted = Layer::new("marks").with("fill", theme::BLUE).with("fill-opacity", 0.75);
    let mut rejected = Layer::new("rejected").with("fill", theme::VERMILLION);
    let drawn = strip.points.iter().filter(|point| point.x.is_finite() && point.y.is_finite());
    for point in drawn {
        let at = Px::new(x(point.x), y(point.y));
        let (marks, shape) = match point.rejected {
            false => (&mut accepted, MarkShape::Dot),
            true => (&mut rejected, MarkShape::Cross),
        };
        marks.mark(shape, at, MARK_PX, Some(&point.hint));
    }
    let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
    border.rect(panel, 0.0);
    layer.extend([grid, limits, border, accepted, rejected, numbers]);
    let title = match strip.points.is_empty() {
        true => format!("{}: no data", strip.title),
        false => strip.title.clone(),
    };
    layer.text(Px::new(panel.left, panel.top - 6.0), Anchor::Start, theme::TEXT_PX, &title);
    layer
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(values: &[f64]) -> Series {
        let point = |(i, y): (usize, &f64)| SeriesPoint {
            x: 0.5 * i as f64,
            y: *y,
            hint: format!("scan {i}"),
            rejected: i == 2,
        };
        let points = values.iter().enumerate().map(point).collect();
        Series { title: "temperature, C".into(), points, limits: Some([19.5, 20.5]) }
    }

    #[test]
    fn every_point_is_drawn_once() {
        let full = series(&[20.0, 20.4, 21.2, 20.9]);
        let axis = Axis::around(&full);
        assert!(axis.from < 19.5 && axis.to > 21.2, "{axis:?}");
        let svg = draw_series("drift", None, &[], "hours", &[full, series(&[])]).to_svg();
        assert_eq!(svg.matches("<title>scan ").count(), 4);
        for part in ["hours", "no data", "rejected"] {
            assert!(svg.contains(part), "{part}");
        }
    }

    #[test]
    fn degenerate_values_are_drawn() {
        for values in [&[][..], &[1.0], &[f64::NAN, 2.0], &[3.0, 3.0], &[f64::INFINITY]] {
            let svg = draw_series("drift", None, &["a line".into()], "hours", &[series(values)]);
            let svg = svg.to_svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{values:?}");
        }
    }
}

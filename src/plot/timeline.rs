//! Quantities against time, one strip each: what drifted over hours or days.

use jiff::Timestamp;

use super::{
    canvas::{Anchor, Layer, Px, Rect, Shape},
    caption,
    picture::Picture,
    theme, ticks,
};

const STRIP_PX: f64 = 130.0;
const BETWEEN_PX: f64 = 34.0;
const MARK_PX: f64 = 3.0;

/// One quantity over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    /// What it is, with its unit.
    pub title: String,
    /// When and how much, with a text that a viewer shows at the mark; in any order.
    pub points: Vec<(Timestamp, f64, String)>,
    /// Beyond these values something is wrong.
    pub limits: Option<[f64; 2]>,
}

/// Draws quantities one above the other over the same time, which runs in hours from the first
/// point of all.
#[must_use]
pub fn draw_timelines(title: &str, lines: &[String], strips: &[Timeline]) -> Picture {
    let (heading, top) = caption::draw(title, None, lines);
    let times = || strips.iter().flat_map(|strip| &strip.points).map(|point| point.0);
    let first = times().min().unwrap_or_default();
    let hours = |at: Timestamp| at.duration_since(first).as_secs_f64() / 3600.0;
    let span_h = times().map(hours).fold(0.0, f64::max);
    let (span, unit) = if span_h < 1.0 { (60.0 * span_h, "minutes") } else { (span_h, "hours") };
    let scale = if span_h < 1.0 { 60.0 } else { 1.0 };
    let axis = Axis { from: 0.0, to: if span > 0.0 { span } else { 1.0 } };
    let (left, width) = (theme::MARGIN_PX + 62.0, theme::PAGE_PX - 2.0 * theme::MARGIN_PX - 62.0);

    let mut page = Layer::new("timelines");
    page.add(heading);
    let mut bottom = top;
    for (index, strip) in strips.iter().enumerate() {
        let panel = Rect::new(left, bottom + 22.0, width, STRIP_PX);
        let last = index + 1 == strips.len();
        let at = |time| scale * hours(time);
        page.add(draw_strip(strip, panel, axis, &at, last));
        bottom = panel.bottom + if last { 0.0 } else { BETWEEN_PX - 22.0 };
    }
    let words = format!("{unit} since {first:.0}");
    let middle = Px::new(left + width / 2.0, bottom + 34.0);
    page.text(middle, Anchor::Middle, theme::SMALL_PX, &words);
    Picture::new(theme::PAGE_PX, bottom + 34.0 + theme::MARGIN_PX, page)
}

/// A range that is drawn from edge to edge.
#[derive(Debug, Clone, Copy)]
struct Axis {
    from: f64,
    to: f64,
}

impl Axis {
    /// Around values with some room, and the limits if they are near.
    fn around(strip: &Timeline) -> Self {
        let values = || strip.points.iter().map(|point| point.1).filter(|value| value.is_finite());
        let (low, high) = values()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        if low > high {
            return Self { from: 0.0, to: 1.0 };
        }
        let near =
            |limit: &f64| (low - (high - low) - 1.0..=high + (high - low) + 1.0).contains(limit);
        let limits = strip.limits.into_iter().flatten().filter(near);
        let (low, high) = limits.fold((low, high), |(low, high), l| (low.min(l), high.max(l)));
        let room = if high > low { 0.12 * (high - low) } else { 0.5 };
        Self { from: low - room, to: high + room }
    }

    fn share(&self, value: f64) -> f64 {
        ((value - self.from) / (self.to - self.from)).clamp(0.0, 1.0)
    }
}

fn draw_strip(
    strip: &Timeline,
    panel: Rect,
    time: Axis,
    at: &impl Fn(Timestamp) -> f64,
    last: bool,
) -> Layer {
    let values = Axis::around(strip);
    let x = |value: f64| panel.left + time.share(value) * panel.width();
    let y = |value: f64| panel.bottom - values.share(value) * panel.height();
    let mut layer = Layer::new("timeline");
    let mut grid = Layer::new("grid").stroked(theme::GRID, theme::HAIRLINE_PX);
    let mut numbers = Layer::new("numbers").with("fill", theme::QUIET);
    let step = ticks::nice_step(values.to - values.from, panel.height() / 28.0);
    for value in ticks::multiples(values.from, values.to, step) {
        grid.line(Px::new(panel.left, y(value)), Px::new(panel.right, y(value)));
        let place = Px::new(panel.left - 5.0, y(value) + 4.0);
        numbers.text(place, Anchor::End, theme::SMALL_PX, &ticks::label(value, step));
    }
    let step = ticks::nice_step(time.to - time.from, panel.width() / 80.0);
    for value in ticks::multiples(time.from, time.to, step) {
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
    let mut marks = Layer::new("marks").with("fill", theme::BLUE).with("fill-opacity", 0.75);
    for (time, value, hint) in strip.points.iter().filter(|point| point.1.is_finite()) {
        marks.mark(Shape::Dot, Px::new(x(at(*time)), y(*value)), MARK_PX, Some(hint));
    }
    let mut border = Layer::new("border").stroked(theme::FRAME, 1.0);
    border.rect(panel, 0.0);
    layer.extend([grid, limits, marks, border, numbers]);
    let title = if strip.points.is_empty() {
        format!("{}: nothing known", strip.title)
    } else {
        strip.title.clone()
    };
    layer.text(Px::new(panel.left, panel.top - 6.0), Anchor::Start, theme::TEXT_PX, &title);
    layer
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strip(values: &[f64]) -> Timeline {
        let point = |(i, value): (usize, &f64)| {
            let time = Timestamp::UNIX_EPOCH + jiff::SignedDuration::from_mins(30 * i as i64);
            (time, *value, format!("scan {i}"))
        };
        let points = values.iter().enumerate().map(point).collect();
        Timeline { title: "temperature, C".into(), points, limits: Some([19.5, 20.5]) }
    }

    #[test]
    fn every_point_is_drawn_once_and_the_axis_holds_all_of_them() {
        let of = strip(&[20.0, 20.4, 21.2, 20.9]);
        let axis = Axis::around(&of);
        assert!(axis.from < 19.5 && axis.to > 21.2, "{axis:?}");
        let svg = draw_timelines("drift", &[], &[of, strip(&[])]).to_svg();
        assert_eq!(svg.matches("<title>scan ").count(), 4);
        assert!(svg.contains("hours since 1970") && svg.contains("nothing known"), "{svg}");
    }

    #[test]
    fn nothing_and_nonsense_are_drawn_too() {
        for values in [&[][..], &[1.0], &[f64::NAN, 2.0], &[3.0, 3.0]] {
            let svg = draw_timelines("drift", &["a line".into()], &[strip(values)]).to_svg();
            assert!(!svg.contains("NaN"), "{values:?}");
        }
    }
}

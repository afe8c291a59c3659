//! Drawing primitives, in pixels from the upper left corner of the page.
//!
//! All output passes through here: coordinates that are not finite or far off the page, and
//! characters that XML does not allow, are replaced.

use std::fmt::Write as _;

use svg::node::{
    Text as TextNode,
    element::{Circle, Element, Group, Line, Path, Rectangle, Title},
};

use super::{font, theme};
use sonard_model::geometry::DVec2;

/// Point on the page, pixels, y down.
pub type Px = DVec2;

/// Rectangle on the page.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Left edge, px.
    pub left: f64,
    /// Upper edge, px.
    pub top: f64,
    /// Right edge, px.
    pub right: f64,
    /// Lower edge, px.
    pub bottom: f64,
}

impl Rect {
    /// Rectangle from its upper left corner and size, px.
    pub fn new(left: f64, top: f64, width: f64, height: f64) -> Self {
        Self { left, top, right: left + width, bottom: top + height }
    }

    /// Width, px.
    pub fn width(&self) -> f64 {
        self.right - self.left
    }

    /// Height, px.
    pub fn height(&self) -> f64 {
        self.bottom - self.top
    }

    /// Centre, px.
    pub fn center(&self) -> Px {
        Px::new((self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0)
    }

    /// Returns `true` if a point is inside or on the edge.
    pub fn contains(&self, at: Px) -> bool {
        (self.left..=self.right).contains(&at.x) && (self.top..=self.bottom).contains(&at.y)
    }

    /// Returns `true` if another rectangle is inside or on the edge.
    pub fn encloses(&self, other: &Self) -> bool {
        self.left <= other.left
            && self.top <= other.top
            && other.right <= self.right
            && other.bottom <= self.bottom
    }

    /// Returns `true` if the interiors of both overlap.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }
}

/// Alignment of a text relative to its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Text begins at the point.
    Start,
    /// Text is centred on the point.
    Middle,
    /// Text ends at the point.
    End,
}

/// Shape of a mark; each kind of reading has its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MarkShape {
    /// Filled circle.
    Dot,
    /// Filled square.
    Square,
    /// Filled triangle.
    Triangle,
    /// Filled rhombus.
    Diamond,
    /// Two crossed lines.
    Cross,
}

/// Group of marks that share attributes.
#[derive(Debug, Clone)]
pub struct Layer {
    group: Group,
}

impl Layer {
    /// Empty layer with a class.
    pub fn new(class: &str) -> Self {
        Self { group: Group::new().set("class", class) }
    }

    /// Sets an attribute inherited by the marks.
    pub fn with(mut self, name: &str, value: impl Into<svg::node::Value>) -> Self {
        self.group = self.group.set(name, value);
        self
    }

    /// Sets colour and width of lines, without fill.
    pub fn stroked(self, colour: &str, width_px: f64) -> Self {
        self.with("stroke", colour).with("stroke-width", width_px).with("fill", "none")
    }

    /// Adds a white outline to texts, for legibility over marks and lines.
    pub fn haloed(self) -> Self {
        self.with("stroke", theme::PAPER)
            .with("stroke-width", 3.0)
            .with("stroke-linejoin", "round")
            .with("paint-order", "stroke")
    }

    /// Appends a layer.
    pub fn add(&mut self, layer: Self) {
        self.node(layer.group);
    }

    /// Appends layers in order.
    pub fn extend(&mut self, layers: impl IntoIterator<Item = Self>) {
        for layer in layers {
            self.add(layer);
        }
    }

    /// SVG group of the layer.
    pub fn into_group(self) -> Group {
        self.group
    }

    fn node(&mut self, node: impl Into<Box<dyn svg::node::Node>>) {
        svg::node::Node::append(&mut self.group, node);
    }

    /// Adds a straight line.
    pub fn line(&mut self, from: Px, to: Px) {
        let line = Line::new()
            .set("x1", tidy(from.x))
            .set("y1", tidy(from.y))
            .set("x2", tidy(to.x))
            .set("y2", tidy(to.y));
        self.node(line);
    }

    /// Adds a circle.
    pub fn circle(&mut self, center: Px, radius_px: f64) {
        let circle = Circle::new()
            .set("cx", tidy(center.x))
            .set("cy", tidy(center.y))
            .set("r", tidy(radius_px.max(0.0)));
        self.node(circle);
    }

    /// Adds a rectangle with rounded corners.
    pub fn rect(&mut self, rect: Rect, radius_px: f64) {
        let rect = Rectangle::new()
            .set("x", tidy(rect.left))
            .set("y", tidy(rect.top))
            .set("width", tidy(rect.width().max(0.0)))
            .set("height", tidy(rect.height().max(0.0)))
            .set("rx", radius_px);
        self.node(rect);
    }

    /// Adds open polylines as one path; runs of a single point are skipped.
    pub fn runs<R: AsRef<[Px]>>(&mut self, runs: impl IntoIterator<Item = R>) {
        let mut data = String::new();
        for run in runs {
            let run = run.as_ref();
            if run.len() > 1 {
                trace(&mut data, run);
            }
        }
        if !data.is_empty() {
            self.node(Path::new().set("d", data));
        }
    }

    /// Adds a closed polygon.
    pub fn polygon(&mut self, points: &[Px]) {
        self.node(closed(points));
    }

    /// Adds a closed polygon with a tooltip.
    pub fn polygon_with_hint(&mut self, points: &[Px], hint: &str) {
        self.node(with_hint(closed(points).into(), hint));
    }

    /// Adds a mark of approximately this radius, with an optional tooltip.
    pub fn mark(&mut self, shape: MarkShape, at: Px, radius_px: f64, hint: Option<&str>) {
        let node = mark(shape, at, radius_px);
        self.node(match hint {
            Some(hint) => with_hint(node, hint),
            None => node,
        });
    }

    /// Adds a line of text; `at` is on its baseline.
    pub fn text(&mut self, at: Px, anchor: Anchor, size_px: f64, text: &str) {
        self.node(text_element(at, anchor, size_px, text));
    }

    /// Adds a line of text rotated about `at`, degrees clockwise.
    pub fn turned_text(&mut self, at: Px, turn_deg: f64, size_px: f64, text: &str) {
        let mut element = text_element(at, Anchor::Middle, size_px, text);
        let turn = format!("rotate({} {} {})", tidy(turn_deg), tidy(at.x), tidy(at.y));
        element.get_attributes_mut().insert("transform".into(), turn.into());
        self.node(element);
    }

    /// Clips the layer to `rect`.
    pub fn clipped(mut self, id: &str, rect: Rect) -> Self {
        let window = Rectangle::new()
            .set("x", tidy(rect.left))
            .set("y", tidy(rect.top))
            .set("width", tidy(rect.width()))
            .set("height", tidy(rect.height()));
        let clip = svg::node::element::ClipPath::new().set("id", id).add(window);
        self.node(clip);
        self.with("clip-path", format!("url(#{id})"))
    }
}

fn mark(shape: MarkShape, at: Px, r: f64) -> Element {
    let polygon = |corners: &[(f64, f64)]| {
        let points: Vec<Px> = corners.iter().map(|(x, y)| at + r * Px::new(*x, *y)).collect();
        closed(&points).into()
    };
    match shape {
        MarkShape::Dot => {
            Circle::new().set("cx", tidy(at.x)).set("cy", tidy(at.y)).set("r", tidy(r)).into()
        }
        MarkShape::Square => polygon(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
        MarkShape::Triangle => polygon(&[(0.0, -1.3), (1.15, 0.8), (-1.15, 0.8)]),
        MarkShape::Diamond => polygon(&[(0.0, -1.35), (1.35, 0.0), (0.0, 1.35), (-1.35, 0.0)]),
        MarkShape::Cross => {
            let (w, l) = (0.35, 1.25);
            let arm = |s: f64, t: f64| ((s - t) * 0.7, (s + t) * 0.7);
            polygon(&[
                arm(l, w),
                arm(w, w),
                arm(w, l),
                arm(-w, l),
                arm(-w, w),
                arm(-l, w),
                arm(-l, -w),
                arm(-w, -w),
                arm(-w, -l),
                arm(w, -l),
                arm(w, -w),
                arm(l, -w),
            ])
        }
    }
}

fn closed(points: &[Px]) -> Path {
    let mut data = String::new();
    trace(&mut data, points);
    data.push('Z');
    Path::new().set("d", data)
}

fn with_hint(mut node: Element, hint: &str) -> Element {
    svg::node::Node::append(&mut node, Title::new(printable(hint)));
    node
}

fn text_element(at: Px, anchor: Anchor, size_px: f64, text: &str) -> Element {
    let mut element = Element::new("text");
    let attributes = element.get_attributes_mut();
    attributes.insert("x".into(), tidy(at.x).into());
    attributes.insert("y".into(), tidy(at.y).into());
    if size_px != theme::TEXT_PX {
        attributes.insert("font-size".into(), size_px.into());
    }
    match anchor {
        Anchor::Start => {}
        Anchor::Middle => drop(attributes.insert("text-anchor".into(), "middle".into())),
        Anchor::End => drop(attributes.insert("text-anchor".into(), "end".into())),
    }
    // Viewers without the bundled font fit theirs into its width, in which a run of spaces is one.
    let printable = printable(text);
    let shown = printable.split_whitespace().collect::<Vec<_>>().join(" ");
    let width_px = text_width_px(&shown, size_px);
    if shown.chars().nth(1).is_some() {
        attributes.insert("textLength".into(), tidy(width_px).into());
        attributes.insert("lengthAdjust".into(), "spacingAndGlyphs".into());
    }
    svg::node::Node::append(&mut element, TextNode::new(printable));
    element
}

fn trace(data: &mut String, points: &[Px]) {
    for (i, point) in points.iter().enumerate() {
        let letter = if i == 0 { 'M' } else { 'L' };
        // Writing to a String does not fail.
        let _ = write!(data, "{letter}{} {}", tidy(point.x), tidy(point.y));
    }
}

/// Rounds to hundredths of a pixel and limits the magnitude: renderers use 32-bit coordinates.
fn tidy(value: f64) -> f64 {
    const FAR_PX: f64 = 1e5;
    if value.is_nan() {
        return -FAR_PX;
    }
    // Adding zero turns -0 into 0.
    (value.clamp(-FAR_PX, FAR_PX) * 100.0).round() / 100.0 + 0.0
}

/// Replaces characters that XML 1.0 does not allow, even escaped.
fn printable(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '\t' | '\n' => ' ',
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => '\u{fffd}',
            c => c,
        })
        .collect()
}

/// Width of a text in the bundled font, without kerning.
pub fn text_width_px(text: &str, size_px: f64) -> f64 {
    size_px * text.chars().map(font::advance_em).sum::<f64>()
}

/// Wraps a text into lines that fit the width.
pub fn wrap(text: &str, size_px: f64, width_px: f64) -> Vec<String> {
    // A word is as long as in the font, and at most as long as the line.
    let (mut lines, mut line) = (Vec::new(), String::new());
    let mut words: Vec<String> = text.split_whitespace().rev().map(str::to_owned).collect();
    while let Some(word) = words.pop() {
        let longer = if line.is_empty() { word.clone() } else { format!("{line} {word}") };
        if text_width_px(&longer, size_px) <= width_px {
            line = longer;
        } else if line.is_empty() {
            let (head, tail) = split_at_width(&word, size_px, width_px);
            lines.push(head);
            words.extend(tail);
        } else {
            lines.push(std::mem::take(&mut line));
            words.push(word);
        }
    }
    if !line.is_empty() || lines.is_empty() {
        lines.push(line);
    }
    lines
}

/// Splits a word that is wider than a line.
fn split_at_width(word: &str, size_px: f64, width_px: f64) -> (String, Option<String>) {
    let mut used_px = 0.0;
    let end = word.char_indices().skip(1).find_map(|(at, character)| {
        used_px += size_px * font::advance_em(character);
        (used_px > width_px - size_px).then_some(at)
    });
    match end {
        Some(end) => (word[..end].to_owned(), Some(word[end..].to_owned())),
        None => (word.to_owned(), None),
    }
}

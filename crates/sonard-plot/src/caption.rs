//! Caption above a picture.

use super::{
    canvas::{Anchor, Layer, Px, Rect, text_width_px, wrap},
    theme,
};

/// Draws a title, a badge to its right and the lines below, each wrapped to the page. Returns
/// the layer and the y coordinate below it.
pub fn draw(title: &str, badge: Option<&str>, lines: &[String]) -> (Layer, f64) {
    let width_px = theme::PAGE_PX - 2.0 * theme::MARGIN_PX;
    let badge_px = badge.map_or(0.0, |text| text_width_px(text, theme::TEXT_PX) + 40.0);
    let mut layer = Layer::new("caption");
    let mut y = theme::MARGIN_PX;
    // The bundled font is light: an outline makes the title bold.
    let mut heading = Layer::new("title").with("stroke", theme::INK).with("stroke-width", 0.45);
    for line in wrap(title, theme::TITLE_PX, width_px - badge_px) {
        y += theme::TITLE_PX;
        heading.text(Px::new(theme::MARGIN_PX, y - 2.0), Anchor::Start, theme::TITLE_PX, &line);
        y += 4.0;
    }
    layer.add(heading);
    layer.extend(badge.map(draw_badge));
    let mut rest = Layer::new("lines").with("fill", theme::QUIET);
    for line in lines.iter().flat_map(|line| wrap(line, theme::TEXT_PX, width_px)) {
        y += theme::TEXT_PX + 4.0;
        rest.text(Px::new(theme::MARGIN_PX, y - 3.0), Anchor::Start, theme::TEXT_PX, &line);
    }
    layer.add(rest);
    (layer, y + 6.0)
}

/// Draws a framed note in the upper right corner.
fn draw_badge(text: &str) -> Layer {
    let width = text_width_px(text, theme::TEXT_PX) + 16.0;
    let left = theme::PAGE_PX - theme::MARGIN_PX - width;
    let frame = Rect::new(left, theme::MARGIN_PX, width, theme::TEXT_PX + 10.0);
    let mut layer = Layer::new("provenance");
    let mut back = Layer::new("frame").stroked(theme::VERMILLION, 1.4);
    back.rect(frame, 4.0);
    layer.add(back);
    let mut label = Layer::new("label")
        .with("fill", theme::VERMILLION)
        .with("stroke", theme::VERMILLION)
        .with("stroke-width", 0.35);
    let base = Px::new(frame.center().x, frame.bottom - 7.5);
    label.text(base, Anchor::Middle, theme::TEXT_PX, text);
    layer.add(label);
    layer
}

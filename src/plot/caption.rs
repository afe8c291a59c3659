//! The lines above a picture.

use super::{
    canvas::{Anchor, Layer, Px, wrap},
    theme,
};

/// Draws a title and the lines under it, each wrapped to the page; returns the layer and the
/// y coordinate below them.
pub(super) fn draw(title: &str, lines: &[String]) -> (Layer, f64) {
    let width_px = theme::PAGE_PX - 2.0 * theme::MARGIN_PX;
    let mut layer = Layer::new("caption");
    let mut y = theme::MARGIN_PX;
    // The bundled font is a light one: an outline makes the title stand out.
    let mut heading = Layer::new("title").with("stroke", theme::INK).with("stroke-width", 0.45);
    for line in wrap(title, theme::TITLE_PX, width_px) {
        y += theme::TITLE_PX;
        heading.text(Px::new(theme::MARGIN_PX, y - 2.0), Anchor::Start, theme::TITLE_PX, &line);
        y += 4.0;
    }
    layer.add(heading);
    let mut rest = Layer::new("lines").with("fill", theme::QUIET);
    for line in lines.iter().flat_map(|line| wrap(line, theme::TEXT_PX, width_px)) {
        y += theme::TEXT_PX + 4.0;
        rest.text(Px::new(theme::MARGIN_PX, y - 3.0), Anchor::Start, theme::TEXT_PX, &line);
    }
    layer.add(rest);
    (layer, y + 6.0)
}

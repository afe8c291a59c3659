//! Finished picture and its output formats.

use std::sync::{Arc, LazyLock};

use resvg::{
    tiny_skia,
    usvg::{self, fontdb},
};
use thiserror::Error;

use super::{canvas::Layer, theme};

/// Maximum width of a PNG, pixels.
pub const MAX_WIDTH_PX: u32 = 16_384;

/// Drawing, ready to be written as SVG or PNG.
#[derive(Debug, Clone)]
pub struct Picture {
    document: svg::Document,
    /// Height per width.
    aspect: f64,
}

/// Failure of the conversion to PNG.
#[derive(Debug, Error)]
pub enum PlotError {
    /// Width of zero or beyond the memory limit.
    #[error("a width of {0} pixels cannot be drawn: choose 1 to {MAX_WIDTH_PX}")]
    Width(u32),
    /// Height of zero or beyond the memory limit at the requested width.
    #[error("at {width_px} pixels wide the picture would be {height_px} pixels high")]
    Height {
        /// Requested width, pixels.
        width_px: u32,
        /// Resulting height, pixels.
        height_px: f64,
    },
    /// Document rejected by the rasterizer.
    #[error("the rasterizer rejected the drawing: {0}")]
    Drawing(#[from] usvg::Error),
    /// Failure of the PNG encoder.
    #[error("the image could not be encoded as PNG: {0}")]
    Encoding(String),
}

impl Picture {
    /// Page of the given size with a layer on it.
    pub fn new(width_px: f64, height_px: f64, content: Layer) -> Self {
        let page = svg::node::element::Rectangle::new()
            .set("width", width_px)
            .set("height", height_px)
            .set("fill", theme::PAPER);
        let document = document(width_px, height_px).add(page).add(content.into_group());
        Self { document, aspect: height_px / width_px }
    }

    /// Picture without a white page, to be drawn over another.
    pub(super) fn without_page(width_px: f64, height_px: f64, content: Layer) -> Self {
        let document = document(width_px, height_px).add(content.into_group());
        Self { document, aspect: height_px / width_px }
    }

    /// Formats the picture as an SVG document.
    #[must_use]
    pub fn to_svg(&self) -> String {
        format!("{}\n", self.document)
    }

    /// Renders a PNG file, `width_px` wide with the height of the picture's aspect ratio.
    ///
    /// # Errors
    /// Size out of bounds, or a failure of the rasterizer.
    pub fn to_png(&self, width_px: u32) -> Result<Vec<u8>, PlotError> {
        let pixels = self.to_pixels(width_px)?;
        pixels.encode_png().map_err(|error| PlotError::Encoding(error.to_string()))
    }

    /// Renders pixels, `width_px` wide with the height of the picture's aspect ratio.
    pub(super) fn to_pixels(&self, width_px: u32) -> Result<tiny_skia::Pixmap, PlotError> {
        if !(1..=MAX_WIDTH_PX).contains(&width_px) {
            return Err(PlotError::Width(width_px));
        }
        let tree = self.tree()?;
        let scale = width_px as f32 / tree.size().width();
        let height_px = (scale * tree.size().height()).round();
        let mut pixels = Some(height_px)
            .filter(|height| (1.0..=MAX_WIDTH_PX as f32).contains(height))
            .and_then(|height| tiny_skia::Pixmap::new(width_px, height as u32))
            .ok_or(PlotError::Height { width_px, height_px: f64::from(height_px) })?;
        let transform = tiny_skia::Transform::from_scale(scale, scale);
        resvg::render(&tree, transform, &mut pixels.as_mut());
        Ok(pixels)
    }

    /// Height of the picture per width.
    pub(super) const fn aspect(&self) -> f64 {
        self.aspect
    }

    /// Draws the picture over pixels, scaled to their width.
    pub(super) fn draw_onto(&self, pixels: &mut tiny_skia::Pixmap) -> Result<(), PlotError> {
        let tree = self.tree()?;
        let scale = pixels.width() as f32 / tree.size().width();
        let transform = tiny_skia::Transform::from_scale(scale, scale);
        resvg::render(&tree, transform, &mut pixels.as_mut());
        Ok(())
    }

    fn tree(&self) -> Result<usvg::Tree, PlotError> {
        let options = usvg::Options { fontdb: FONTS.clone(), ..usvg::Options::default() };
        Ok(usvg::Tree::from_str(&self.to_svg(), &options)?)
    }
}

/// Empty page with the common text attributes.
fn document(width_px: f64, height_px: f64) -> svg::Document {
    svg::Document::new()
        .set("viewBox", (0.0, 0.0, width_px, height_px))
        .set("width", width_px)
        .set("height", height_px)
        .set("font-family", theme::FONT_FAMILY)
        .set("font-size", theme::TEXT_PX)
        .set("fill", theme::INK)
}

/// Fonts of the rasterizer.
#[cfg(test)]
pub(super) fn fonts() -> Arc<fontdb::Database> {
    FONTS.clone()
}

/// Bundled font, under its own name and as every generic family, so that a PNG looks the
/// same on every machine.
static FONTS: LazyLock<Arc<fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
    let family = fonts
        .faces()
        .find_map(|face| face.families.first().map(|(name, _)| name.clone()))
        .unwrap_or_default();
    fonts.set_sans_serif_family(family.clone());
    fonts.set_serif_family(family.clone());
    fonts.set_monospace_family(family);
    Arc::new(fonts)
});

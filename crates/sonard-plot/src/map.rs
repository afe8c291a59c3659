//! Occupancy grids as images.

use resvg::tiny_skia::{
    Color, LineCap, Paint, PathBuilder, Pixmap, PremultipliedColorU8, Stroke, Transform,
};

use super::PlotError;
use sonard_interpret::interpret::grid::Grid;
use sonard_model::{geometry::DVec2, scene::Scene};

/// Widest image, pixels.
const MOST_PX: usize = 4096;

/// A map as a PNG: free is white, occupied black, unknown grey; so many pixels a cell (fewer if
/// the image would be too large). Over it the walls of `scene`, thin and blue, and the way of the
/// robot, orange.
///
/// # Errors
/// When the image can't be made or encoded.
pub fn draw_map(
    grid: &Grid,
    scene: Option<&Scene>,
    way: &[DVec2],
    cell_px: usize,
) -> Result<Vec<u8>, PlotError> {
    let shape = grid.shape();
    let cell_px = cell_px.clamp(1, (MOST_PX / shape.width.max(shape.height)).max(1));
    let (width, height) = (shape.width * cell_px, shape.height * cell_px);
    let mut image =
        Pixmap::new(width as u32, height as u32).ok_or(PlotError::Width(width as u32))?;
    for (at, pixel) in image.pixels_mut().iter_mut().enumerate() {
        let (column, row) = (at % width / cell_px, shape.height - 1 - at / width / cell_px);
        let shade = (255.0 * (1.0 - grid.probability(row * shape.width + column))) as u8;
        if let Some(grey) = PremultipliedColorU8::from_rgba(shade, shade, shade, 255) {
            *pixel = grey;
        }
    }
    let px = |at: DVec2| {
        let place = (at - shape.origin) / shape.resolution_m * cell_px as f64;
        (place.x as f32, height as f32 - place.y as f32)
    };
    let walls = scene.iter().flat_map(|scene| &scene.walls).map(|wall| vec![wall.a, wall.b]);
    for wall in walls {
        stroke(&mut image, &wall, px, Color::from_rgba8(0, 114, 178, 255), 1.5);
    }
    stroke(&mut image, way, px, Color::from_rgba8(230, 159, 0, 255), 1.5);
    image.encode_png().map_err(|error| PlotError::Encoding(error.to_string()))
}

fn stroke(
    image: &mut Pixmap,
    points: &[DVec2],
    px: impl Fn(DVec2) -> (f32, f32),
    colour: Color,
    width_px: f32,
) {
    let mut builder = PathBuilder::new();
    for (number, point) in points.iter().filter(|point| point.is_finite()).enumerate() {
        let (x, y) = px(*point);
        if number == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
    }
    let Some(path) = builder.finish() else { return };
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color(colour);
    let stroke = Stroke { width: width_px, line_cap: LineCap::Round, ..Stroke::default() };
    image.stroke_path(&path, &paint, &stroke, Transform::identity(), None);
}

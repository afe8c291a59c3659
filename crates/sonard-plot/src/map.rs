//! Occupancy grids with axes, scale, legend and provenance badge.

use resvg::tiny_skia::{Pixmap, PremultipliedColorU8};

use super::{
    PlotError,
    canvas::{Layer, Px, Rect},
    caption,
    legend::{self, LegendEntry, LegendSample},
    picture::Picture,
    plan::{Bounds, PlanProjection},
    theme,
};
use sonard_interpret::interpret::grid::Grid;
use sonard_model::{geometry::DVec2, scene::Scene};

/// Pixels per cell, as long as the picture stays within [`MAX_SIDE_PX`].
const CELL_PX: f64 = 4.0;
const MAX_SIDE_PX: f64 = 4096.0;

/// Map with its caption and overlays.
#[derive(Debug, Clone)]
pub struct MapView<'a> {
    /// Title above the picture.
    pub title: String,
    /// Lines below the title.
    pub lines: Vec<String>,
    /// Provenance of the readings, unless from hardware ([`badge_for`](crate::badge_for)).
    pub badge: Option<&'static str>,
    /// Occupancy grid.
    pub grid: &'a Grid,
    /// Scene whose walls are overlaid.
    pub scene: Option<&'a Scene>,
    /// Trajectory of the robot, metres.
    pub trajectory: &'a [DVec2],
}

/// Draws a map as a PNG: free is white, occupied black, unknown grey. Overlaid are the walls of the
/// scene, thin and blue, and the trajectory of the robot, orange.
///
/// # Errors
/// Failure of rendering or encoding.
pub fn draw_map(view: &MapView) -> Result<Vec<u8>, PlotError> {
    let (heading, top) = caption::draw(&view.title, view.badge, &view.lines);
    let (left, right) = (theme::MARGIN_PX + 38.0, theme::PAGE_PX - theme::MARGIN_PX);
    let region = region(view.grid);
    let height = PlanProjection::height_for(&region, right - left, [160.0, 1400.0]);
    let plan = PlanProjection::fit(region, Rect::new(left, top + 22.0, right - left, height));
    let below = Px::new(left, plan.panel.bottom + 24.0);
    let (key, key_height) = legend::draw(&entries(view), below, right - left);
    let page_px = below.y + key_height + theme::MARGIN_PX / 2.0;

    let mut under = Layer::new("map");
    under.add(heading);
    under.add(plan.frame());
    under.add(key);
    under.add(plan.scale_bar());
    let mut over = Layer::new("inside").clipped("map-window", plan.panel);
    over.add(walls(view, &plan));
    over.add(trajectory(view, &plan));

    let mut pixels =
        Picture::new(theme::PAGE_PX, page_px, under).to_pixels(width_px(view, &plan))?;
    paint(&mut pixels, view.grid, &plan);
    Picture::without_page(theme::PAGE_PX, page_px, over).draw_onto(&mut pixels)?;
    pixels.encode_png().map_err(|error| PlotError::Encoding(error.to_string()))
}

fn region(grid: &Grid) -> Bounds {
    let shape = grid.shape();
    let size = DVec2::new(shape.width as f64, shape.height as f64) * shape.resolution_m;
    Bounds { min: shape.origin, max: shape.origin + size }
}

/// Width at which single cells are visible, within bounds.
fn width_px(view: &MapView, plan: &PlanProjection) -> u32 {
    let cell_px = plan.length_px(view.grid.shape().resolution_m);
    let desired = theme::PAGE_PX * (CELL_PX / cell_px).max(1.0);
    let max_width = MAX_SIDE_PX * theme::PAGE_PX / (plan.panel.bottom + 100.0);
    desired.min(MAX_SIDE_PX).min(max_width.max(theme::PAGE_PX)).round() as u32
}

/// Paints the cells into the panel, darker for a higher probability of occupancy.
fn paint(pixels: &mut Pixmap, grid: &Grid, plan: &PlanProjection) {
    let (width, scale) = (pixels.width() as usize, f64::from(pixels.width()) / theme::PAGE_PX);
    let shape = grid.shape();
    for (at, pixel) in pixels.pixels_mut().iter_mut().enumerate() {
        let centre = Px::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5) / scale;
        if !plan.panel.contains(centre) {
            continue;
        }
        let Some(cell) = shape.index_at(plan.place(centre)) else { continue };
        let shade = (255.0 * (1.0 - grid.probability(cell))) as u8;
        if let Some(grey) = PremultipliedColorU8::from_rgba(shade, shade, shade, 255) {
            *pixel = grey;
        }
    }
}

fn walls(view: &MapView, plan: &PlanProjection) -> Layer {
    let mut layer = Layer::new("walls").stroked(theme::BLUE, WALL_PX);
    for wall in view.scene.iter().flat_map(|scene| &scene.walls) {
        layer.line(plan.px(wall.a), plan.px(wall.b));
    }
    for cylinder in view.scene.iter().flat_map(|scene| &scene.cylinders) {
        layer.circle(plan.px(cylinder.center), plan.length_px(cylinder.radius_m));
    }
    layer
}

const WALL_PX: f64 = 1.2;

fn trajectory(view: &MapView, plan: &PlanProjection) -> Layer {
    let mut layer = Layer::new("trajectory").stroked(theme::ORANGE, 1.4);
    let points: Vec<Px> =
        view.trajectory.iter().filter(|at| at.is_finite()).map(|at| plan.px(*at)).collect();
    if let (Some(start), 1) = (points.first(), points.len()) {
        layer.circle(*start, 3.0);
    }
    layer.runs([points]);
    layer
}

fn entries(view: &MapView) -> Vec<LegendEntry> {
    let line = |colour, width_px| LegendSample::Line { colour, width_px, dash: "none" };
    let mut entries = vec![
        LegendEntry::new(LegendSample::Patch { colour: theme::PAPER }, "free"),
        LegendEntry::new(LegendSample::Patch { colour: UNKNOWN }, "unknown"),
        LegendEntry::new(LegendSample::Patch { colour: "#000000" }, "occupied"),
    ];
    if view.scene.is_some() {
        entries.push(LegendEntry::new(line(theme::BLUE, WALL_PX), "walls of the scene"));
    }
    if !view.trajectory.is_empty() {
        entries.push(LegendEntry::new(line(theme::ORANGE, 1.4), "trajectory"));
    }
    entries
}

/// Shade of a cell at probability 0.5.
const UNKNOWN: &str = "#7f7f7f";

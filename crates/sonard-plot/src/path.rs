//! The propagation path of one beam, on the floor plan.

use super::{
    canvas::{Anchor, Layer, Px, Rect},
    caption,
    labels::Labels,
    legend::{self, LegendEntry, LegendSample},
    legend_entries,
    picture::Picture,
    plan::{Bounds, PlanProjection},
    theme,
};
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};

/// Beam with the propagation path of its echo.
#[derive(Debug, Clone)]
pub struct PathView<'a> {
    /// Title above the picture.
    pub title: String,
    /// Lines below the title: reading and path.
    pub lines: Vec<String>,
    /// Provenance of the readings, unless from hardware ([`badge_for`](crate::badge_for)).
    pub badge: Option<&'static str>,
    /// Scene without the robot.
    pub scene: &'a Scene,
    /// Pose of the ranger.
    pub pose: Pose,
    /// Position of the transducer; its heading is the beam direction.
    pub transducer: Pose,
    /// Beam direction, degrees from the scan's heading.
    pub azimuth_deg: f64,
    /// Reported range, metres.
    pub range_m: Option<f64>,
    /// Points of the path from the transmitter over each interaction to the receiver, metres.
    pub points: Vec<DVec2>,
}

/// Draws the propagation path of a beam on the floor plan: reflections and edges numbered in order,
/// an arrow on each segment, the beam axis and the reported range.
#[must_use]
pub fn draw_path(view: &PathView) -> Picture {
    let (heading, top) = caption::draw(&view.title, view.badge, &view.lines);
    let (left, right) = (theme::MARGIN_PX + 38.0, theme::PAGE_PX - theme::MARGIN_PX);
    let region = region(view);
    let height = PlanProjection::height_for(&region, right - left, [300.0, 700.0]);
    let plan = PlanProjection::fit(region, Rect::new(left, top + 22.0, right - left, height));
    let mut labels = plan.labels(Some(view.scene));
    let mut page = Layer::new("path-of-a-beam");
    page.add(heading);
    page.add(plan.frame());
    let mut inside = Layer::new("inside").clipped("plan-window", plan.panel);
    inside.add(beam(view, &plan));
    inside.add(plan.walls(view.scene));
    inside.add(plan.body(view.scene, &view.pose));
    inside.add(path(view, &plan, &mut labels));
    inside.add(plan.pose(&view.pose));
    page.add(inside);
    page.add(plan.names(view.scene, &mut labels));
    page.add(plan.scale_bar());
    let below = Px::new(left, plan.panel.bottom + 24.0);
    let mut entries = vec![
        LegendEntry::new(line(theme::VERMILLION, "none"), "propagation path"),
        LegendEntry::new(line(theme::SKY, "5 4"), "beam axis"),
    ];
    if view.range_m.is_some() {
        entries
            .push(LegendEntry::new(LegendSample::Ring { colour: theme::BLUE }, "reported range"));
    }
    entries.extend(legend_entries::materials(view.scene));
    let (key, key_height) = legend::draw(&entries, below, right - left);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + key_height + theme::MARGIN_PX / 2.0, page)
}

const fn line(colour: &'static str, dash: &'static str) -> LegendSample {
    LegendSample::Line { colour, width_px: 2.0, dash }
}

/// Bounds of the path and the reading with a margin, and of the near part of the room.
fn region(view: &PathView) -> Bounds {
    let read = view.range_m.map(|range_m| view.transducer.point_at(0.0, range_m));
    let here = [view.pose.position()].into_iter().chain(read).chain(view.points.iter().copied());
    let path = Bounds::around(here).unwrap_or(Bounds { min: DVec2::ZERO, max: DVec2::ONE });
    let reach = path.size().max_element().max(0.1);
    let near = path.grown(1.5 * reach);
    let walls = view.scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    path.including(walls.map(|end| end.clamp(near.min, near.max))).grown(0.12 * reach)
}

fn beam(view: &PathView, plan: &PlanProjection) -> Layer {
    let reach_m = view.range_m.unwrap_or_else(|| plan.view.size().max_element());
    let from = plan.px(view.transducer.position());
    let to = view.transducer.point_at(0.0, reach_m);
    let mut layer = Layer::new("axis").stroked(theme::SKY, 2.0).with("stroke-dasharray", "5 4");
    layer.line(from, plan.px(to));
    let mut ring = Layer::new("reading").stroked(theme::BLUE, 1.6);
    if view.range_m.is_some() {
        ring.circle(plan.px(to), 6.0);
    }
    layer.add(ring.with("stroke-dasharray", "none"));
    layer
}

fn path(view: &PathView, plan: &PlanProjection, labels: &mut Labels) -> Layer {
    let stretches = apart(&view.points.iter().map(|point| plan.px(*point)).collect::<Vec<_>>());
    stretches.iter().for_each(|&(from, to)| labels.keep_off(from, to));
    plan.avoid_pose(&view.pose, labels);
    let mut layer = Layer::new("path").stroked(theme::VERMILLION, 1.8);
    let mut heads = Layer::new("heads").with("fill", theme::VERMILLION).with("stroke", "none");
    for &(from, to) in &stretches {
        layer.line(from, to);
        let along = (to - from).normalize_or_zero();
        let (nose, side) = (from + 0.58 * (to - from), 4.0 * along.perp());
        if from.distance(to) > 16.0 {
            heads.polygon(&[nose, nose - 10.0 * along + side, nose - 10.0 * along - side]);
        }
    }
    layer.add(heads);
    let mut numbers = Layer::new("order").with("fill", theme::INK).haloed();
    let bends = view.points.len().saturating_sub(2);
    for (number, point) in (1..).zip(view.points.iter().skip(1).take(bends)) {
        let text = format!("{number}");
        let at = plan.px(*point);
        let places =
            [(7.0, -7.0), (-12.0, -7.0), (7.0, 16.0), (-12.0, 16.0), (20.0, -7.0), (20.0, 16.0)];
        let place = places
            .iter()
            .map(|&(x, y)| at + Px::new(x, y))
            .find(|place| labels.place(*place, Anchor::Start, theme::TEXT_PX, &text));
        if let Some(place) = place {
            numbers.text(place, Anchor::Start, theme::TEXT_PX, &text);
        }
    }
    layer.add(numbers.with("stroke-width", 3.0));
    layer
}

/// Segments shifted slightly to their left, so that the path out and the path back are distinct.
fn apart(points: &[Px]) -> Vec<(Px, Px)> {
    let shift = |from: Px, to: Px| -2.2 * (to - from).normalize_or_zero().perp();
    points
        .windows(2)
        .filter(|pair| pair[0].distance(pair[1]) > 1e-6)
        .map(|pair| (pair[0] + shift(pair[0], pair[1]), pair[1] + shift(pair[0], pair[1])))
        .collect()
}

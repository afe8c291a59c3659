//! A floor plan with the readings as small dots, for what is found in them to be drawn over.

use super::{
    canvas::{Layer, Px, Rect, Shape},
    caption,
    legend::{self, Entry},
    picture::Picture,
    plan::{Bounds, Plan},
    readings::Readings,
    region, theme, words,
};
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};
use sonard_records::ScanView;

/// Around what was found, where nothing else is drawn, metres.
const MARGIN_M: f64 = 0.5;

/// Draws scans small, in their scene; `finding` is a line under the title, `found` are places that
/// must be in view, `over` draws clipped to the plan, `beside` over its frame.
pub(super) fn draw(
    scans: &[ScanView],
    scene: Option<&Scene>,
    finding: String,
    found: &[DVec2],
    over: impl FnOnce(&Plan) -> Vec<Layer>,
    beside: impl FnOnce(&Plan) -> Option<Layer>,
    entries: &[Entry],
) -> Picture {
    let readings: Vec<Readings> = scans.iter().map(Readings::of).collect();
    let placed: Vec<(Pose, &Readings)> = scans
        .iter()
        .zip(&readings)
        .filter_map(|(view, r)| Some((words::pose_of(view)?, r)))
        .collect();
    let lines = [words::lines(scans), vec![finding]].concat();
    let (heading, top) = caption::draw(&words::title(scans, scene), words::badge(scans), &lines);
    let around = match (placed.is_empty() && scene.is_none(), Bounds::around(found.iter().copied()))
    {
        (true, Some(around)) => around.grown(MARGIN_M),
        _ => region::region(&placed, scene),
    };
    let region = around.including(found.iter().copied());
    let (left, right) = (theme::MARGIN_PX + 38.0, theme::PAGE_PX - theme::MARGIN_PX);
    let height = Plan::height_for(&region, right - left, [320.0, 760.0]);
    let plan = Plan::fit(region, Rect::new(left, top + 22.0, right - left, height));

    let mut inside = Layer::new("inside").clipped("overlay-window", plan.panel);
    inside.extend(scene.map(|scene| plan.walls(scene)));
    inside.extend(placed.iter().map(|(pose, r)| dots(&plan, pose, r)));
    inside.extend(placed.iter().map(|(pose, _)| plan.pose(pose)));
    inside.extend(over(&plan));

    let mut page = Layer::new("overlay");
    page.add(heading);
    page.add(plan.frame());
    page.add(inside);
    page.extend(beside(&plan));
    page.add(plan.scale_bar());
    let below = Px::new(left, plan.panel.bottom + 24.0);
    let (key, key_height) = legend::draw(entries, below, right - left);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + key_height + theme::MARGIN_PX / 2.0, page)
}

fn dots(plan: &Plan, pose: &Pose, readings: &Readings) -> Layer {
    let mut layer = Layer::new("readings").with("fill", theme::SILENT);
    for beam in &readings.beams {
        if let Some(range_m) = beam.range_m {
            let at = plan.px(beam.point(pose, range_m));
            layer.mark(Shape::Dot, at, 1.4, None);
        }
    }
    layer
}

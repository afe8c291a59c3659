//! Floor plan with the readings as small dots, as background of findings.

use super::{
    canvas::{Layer, MarkShape, Px, Rect},
    caption,
    legend::{self, LegendEntry},
    picture::Picture,
    plan::{Bounds, PlanProjection},
    readings::PlottedScan,
    region, scan_caption, theme,
};
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};
use sonard_records::ScanView;

/// Margin around findings if nothing else is drawn, metres.
const MARGIN_M: f64 = 0.5;

/// Draws scans as small dots in their scene. `finding` is a line below the title, `found` are
/// points that must be in view, `over` is clipped to the plan, `labels` drawn over its frame.
pub(super) fn draw(
    scans: &[ScanView],
    scene: Option<&Scene>,
    finding: String,
    found: &[DVec2],
    over: impl FnOnce(&PlanProjection) -> Vec<Layer>,
    labels: impl FnOnce(&PlanProjection) -> Option<Layer>,
    entries: &[LegendEntry],
) -> Picture {
    let readings: Vec<PlottedScan> = scans.iter().map(PlottedScan::from_scan).collect();
    let placed: Vec<(Pose, &PlottedScan)> = scans
        .iter()
        .zip(&readings)
        .filter_map(|(view, r)| Some((scan_caption::pose_of(view)?, r)))
        .collect();
    let lines = [scan_caption::lines(scans), vec![finding]].concat();
    let (heading, top) =
        caption::draw(&scan_caption::title(scans, scene), scan_caption::badge(scans), &lines);
    let around = match (placed.is_empty() && scene.is_none(), Bounds::around(found.iter().copied()))
    {
        (true, Some(around)) => around.grown(MARGIN_M),
        _ => region::region(&placed, scene),
    };
    let region = around.including(found.iter().copied());
    let (left, right) = (theme::MARGIN_PX + 38.0, theme::PAGE_PX - theme::MARGIN_PX);
    let height = PlanProjection::height_for(&region, right - left, [320.0, 760.0]);
    let plan = PlanProjection::fit(region, Rect::new(left, top + 22.0, right - left, height));

    let mut inside = Layer::new("inside").clipped("overlay-window", plan.panel);
    inside.extend(scene.map(|scene| plan.walls(scene)));
    inside.extend(placed.iter().map(|(pose, r)| dots(&plan, pose, r)));
    inside.extend(placed.iter().map(|(pose, _)| plan.pose(pose)));
    inside.extend(over(&plan));

    let mut page = Layer::new("overlay");
    page.add(heading);
    page.add(plan.frame());
    page.add(inside);
    page.extend(labels(&plan));
    page.add(plan.scale_bar());
    let below = Px::new(left, plan.panel.bottom + 24.0);
    let (key, key_height) = legend::draw(entries, below, right - left);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + key_height + theme::MARGIN_PX / 2.0, page)
}

fn dots(plan: &PlanProjection, pose: &Pose, readings: &PlottedScan) -> Layer {
    let mut layer = Layer::new("readings").with("fill", theme::NO_ECHO);
    for beam in &readings.beams {
        if let Some(range_m) = beam.range_m {
            let at = plan.px(beam.point(pose, range_m));
            layer.mark(MarkShape::Dot, at, 1.4, None);
        }
    }
    layer
}

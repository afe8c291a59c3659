//! Scans of one position side by side, for comparison of engines.

use super::{
    canvas::{Anchor, Layer, Px, Rect},
    caption,
    floor::Floor,
    legend, legend_entries,
    picture::Picture,
    plan::PlanProjection,
    readings::PlottedScan,
    region, scan_caption, theme,
};
use sonard_interpret::compare::agrees;
use sonard_model::{geometry::Pose, scene::Scene};
use sonard_records::{Ping, PingStatus, ScanView};

/// Maximum number of panels.
const MAX_PANELS: usize = 3;

const GAP_PX: f64 = 40.0;

/// Draws each scan (the first three) on a floor plan of its own, under the name of its engine, with
/// the number of beams that differ from the first scan: an echo in only one of them, or ranges
/// apart by more than [`agrees`] allows.
#[must_use]
pub fn draw_side_by_side(scans: &[ScanView], scene: Option<&Scene>) -> Picture {
    let shown = &scans[..scans.len().min(MAX_PANELS)];
    let readings: Vec<PlottedScan> = shown.iter().map(PlottedScan::from_scan).collect();
    let (heading, top) = caption::draw(
        &scan_caption::title(shown, scene),
        scan_caption::badge(shown),
        &[notes(shown)],
    );
    let placed: Vec<(Pose, &PlottedScan)> = shown
        .iter()
        .zip(&readings)
        .filter_map(|(view, r)| Some((scan_caption::pose_of(view)?, r)))
        .collect();
    let region = region::region(&placed[..placed.len().min(1)], scene);

    let mut page = Layer::new("side-by-side");
    page.add(heading);
    let left = theme::MARGIN_PX + 34.0;
    let room = theme::PAGE_PX - theme::MARGIN_PX - left + GAP_PX;
    let width = room / shown.len().max(1) as f64 - GAP_PX;
    let height = PlanProjection::height_for(&region, width, [180.0, 420.0]);
    for (i, view) in shown.iter().enumerate() {
        let panel = Rect::new(left + i as f64 * (width + GAP_PX), top + 40.0, width, height);
        let plan = PlanProjection::fit(region, panel);
        page.add(floor(&plan, i, view, &readings[i], scene));
        let mut titles = Layer::new("engine");
        let above = |rise: f64| Px::new(panel.left, panel.top - rise);
        titles.text(above(24.0), Anchor::Start, theme::TEXT_PX, &engine(view));
        titles.text(above(7.0), Anchor::Start, theme::SMALL_PX, &difference(&shown[0], view, i));
        page.add(titles);
    }
    let below = Px::new(theme::MARGIN_PX, top + 40.0 + height + 28.0);
    let entries = legend_entries::all(&readings, scene, 0, true);
    let (key, key_height) = legend::draw(&entries, below, theme::PAGE_PX - 2.0 * theme::MARGIN_PX);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + key_height + theme::MARGIN_PX / 2.0, page)
}

fn floor(
    plan: &PlanProjection,
    number: usize,
    view: &ScanView,
    scan: &PlottedScan,
    scene: Option<&Scene>,
) -> Layer {
    let mut inside = Layer::new("inside").clipped(&format!("window-{number}"), plan.panel);
    let mut layer = Layer::new("floor-plan");
    layer.add(plan.frame());
    let pose = scan_caption::pose_of(view);
    let floor = pose.map(|pose| Floor { plan, pose, scan });
    inside.extend(floor.map(|floor| floor.model()));
    inside.extend(scene.map(|scene| plan.walls(scene)));
    inside.extend(scene.zip(pose).map(|(scene, pose)| plan.body(scene, &pose)));
    inside.extend(floor.map(|floor| floor.min_range()));
    inside.extend(floor.map(|floor| floor.marks(1.0)));
    inside.extend(pose.map(|pose| plan.pose(&pose)));
    layer.add(inside);
    layer.extend(floor.map(|floor| floor.border_ticks()));
    layer
}

fn notes(scans: &[ScanView]) -> String {
    let beams = scans.first().map_or(0, |scan| scan.pings.len());
    format!("{beams} beams each; counts are totals of all panels")
}

fn engine(view: &ScanView) -> String {
    let model = view.session.as_ref().and_then(|session| session.model.as_ref());
    model.map_or_else(|| "measured".to_owned(), |model| model.engine.clone())
}

/// Number of beams that differ from the first scan, as text.
fn difference(first: &ScanView, other: &ScanView, number: usize) -> String {
    if number == 0 {
        let echoes = first.pings.iter().filter(|ping| ping.range_m.is_some()).count();
        return format!("{echoes} echoes");
    }
    let twin = |ping: &&Ping| first.pings.iter().find(|known| known.index == ping.index);
    let differing = other.pings.iter();
    let differing = differing.filter(|ping| twin(ping).is_none_or(|known| !same(known, ping)));
    let count = differing.count();
    let percent = 100.0 * count as f64 / other.pings.len().max(1) as f64;
    format!("{count} beams differ from {} ({percent:.0} %)", engine(first))
}

fn same(a: &Ping, b: &Ping) -> bool {
    let echo_m = |ping: &Ping| ping.range_m.filter(|_| ping.status != PingStatus::NoEcho);
    match (echo_m(a), echo_m(b)) {
        (Some(a_m), Some(b_m)) => agrees(a_m, b_m),
        (None, None) => true,
        _ => false,
    }
}

//! Scans of one place beside each other: what one engine sees and another does not.

use super::{
    canvas::{Anchor, Layer, Px, Rect},
    caption,
    floor::Floor,
    keys, legend,
    picture::Picture,
    plan::Plan,
    readings::Readings,
    region, theme, words,
};
use sonard_interpret::compare::agrees;
use sonard_model::{geometry::Pose, scene::Scene};
use sonard_records::{Ping, PingStatus, ScanView};

/// Most panels beside each other.
const MOST: usize = 3;

const GAP_PX: f64 = 40.0;

/// Draws each scan (the first three) on a floor plan of its own, under the name of its engine, with
/// the number of its beams that differ from the first scan's: heard by one and not by the other, or
/// ranges apart by more than [`agrees`] allows.
#[must_use]
pub fn draw_side_by_side(scans: &[ScanView], scene: Option<&Scene>) -> Picture {
    let shown = &scans[..scans.len().min(MOST)];
    let readings: Vec<Readings> = shown.iter().map(Readings::of).collect();
    let (heading, top) =
        caption::draw(&words::title(shown, scene), words::badge(shown), &[notes(shown)]);
    let placed: Vec<(Pose, &Readings)> = shown
        .iter()
        .zip(&readings)
        .filter_map(|(view, r)| Some((words::pose_of(view)?, r)))
        .collect();
    let region = region::region(&placed[..placed.len().min(1)], scene);

    let mut page = Layer::new("side-by-side");
    page.add(heading);
    let left = theme::MARGIN_PX + 34.0;
    let room = theme::PAGE_PX - theme::MARGIN_PX - left + GAP_PX;
    let width = room / shown.len().max(1) as f64 - GAP_PX;
    let height = Plan::height_for(&region, width, [180.0, 420.0]);
    for (i, view) in shown.iter().enumerate() {
        let panel = Rect::new(left + i as f64 * (width + GAP_PX), top + 40.0, width, height);
        let plan = Plan::fit(region, panel);
        page.add(floor(&plan, i, view, &readings[i], scene));
        let mut titles = Layer::new("engine");
        let above = |rise: f64| Px::new(panel.left, panel.top - rise);
        titles.text(above(24.0), Anchor::Start, theme::TEXT_PX, &engine(view));
        titles.text(above(7.0), Anchor::Start, theme::SMALL_PX, &difference(&shown[0], view, i));
        page.add(titles);
    }
    let below = Px::new(theme::MARGIN_PX, top + 40.0 + height + 28.0);
    let entries = keys::all(&readings, scene, 0);
    let (key, key_height) = legend::draw(&entries, below, theme::PAGE_PX - 2.0 * theme::MARGIN_PX);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + key_height + theme::MARGIN_PX / 2.0, page)
}

fn floor(
    plan: &Plan,
    number: usize,
    view: &ScanView,
    scan: &Readings,
    scene: Option<&Scene>,
) -> Layer {
    let mut inside = Layer::new("inside").clipped(&format!("window-{number}"), plan.panel);
    let mut layer = Layer::new("floor-plan");
    layer.add(plan.frame());
    let pose = words::pose_of(view);
    let floor = pose.map(|pose| Floor { plan, pose, scan });
    inside.extend(floor.map(|floor| floor.model()));
    inside.extend(scene.map(|scene| plan.walls(scene)));
    inside.extend(scene.zip(pose).map(|(scene, pose)| plan.body(scene, &pose)));
    inside.extend(floor.map(|floor| floor.min_range()));
    inside.extend(floor.map(|floor| floor.marks(1.0)));
    inside.extend(pose.map(|pose| plan.pose(&pose)));
    layer.add(inside);
    layer.extend(floor.map(|floor| floor.silent_ticks()));
    layer
}

fn notes(scans: &[ScanView]) -> String {
    let beams = scans.first().map_or(0, |scan| scan.pings.len());
    format!("{beams} beams each; the legend counts those of all")
}

fn engine(view: &ScanView) -> String {
    let model = view.session.as_ref().and_then(|session| session.model.as_ref());
    model.map_or_else(|| "measured".to_owned(), |model| model.engine.clone())
}

/// How many beams differ from the first scan's.
fn difference(first: &ScanView, other: &ScanView, number: usize) -> String {
    if number == 0 {
        let heard = first.pings.iter().filter(|ping| ping.range_m.is_some()).count();
        return format!("{heard} beams heard");
    }
    let twin = |ping: &&Ping| first.pings.iter().find(|known| known.index == ping.index);
    let wrong = other.pings.iter().filter(|ping| twin(ping).is_none_or(|known| !same(known, ping)));
    let wrong = wrong.count();
    let percent = 100.0 * wrong as f64 / other.pings.len().max(1) as f64;
    format!("{wrong} beams differ from {} ({percent:.0} %)", engine(first))
}

fn same(one: &Ping, other: &Ping) -> bool {
    let heard = |ping: &Ping| ping.range_m.filter(|_| ping.status != PingStatus::NoEcho);
    match (heard(one), heard(other)) {
        (Some(one_m), Some(other_m)) => agrees(one_m, other_m),
        (None, None) => true,
        _ => false,
    }
}

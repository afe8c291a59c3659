//! Picture of a robot's trajectory through a scene and its map.

use crate::explore::{Exploration, Sensing, Stop};
use sonard_interpret::interpret::lines::LaserScan;
use sonard_model::{geometry::DVec2, scene::Scene};
use sonard_plot::{
    Picture,
    canvas::{Anchor, Layer, MarkShape, Px, Rect},
    caption,
    legend::{self, LegendEntry, LegendSample},
    lines,
    plan::{Bounds, PlanProjection},
    theme,
};

/// Maximum range of the drawn laser fields of view, metres.
const VIEW_M: f64 = 2.0;
/// Number of readings that outline a laser field of view.
const VIEW_POINTS: usize = 40;
const GAP_PX: f64 = 40.0;
/// Margin around walls and trajectory, metres.
const MARGIN_M: f64 = 0.4;

/// Draws the first `stops` stops of an exploration.
///
/// Laser fields of view are grey, as in the figures of the just-in-time paper. The trajectory is
/// orange. Map lines are styled by their kind, with confirmed endpoints as dots.
#[must_use]
pub fn draw_exploration(
    exploration: &Exploration,
    stops: usize,
    sensing: Sensing,
    scene: Option<&Scene>,
) -> Picture {
    let shown = &exploration.stops[..stops.clamp(1, exploration.stops.len())];
    let name = scene.map_or("unknown", |scene| scene.name.as_str());
    let title = format!("{name}, explored with {}", sensing_label(sensing));
    let (heading, top) =
        caption::draw(&title, Some("SIMULATED, nothing measured"), &[statistics(shown)]);
    let region = region(&exploration.stops, scene);
    let (left, right) = (theme::MARGIN_PX + 38.0, theme::PAGE_PX - theme::MARGIN_PX);
    let height = PlanProjection::height_for(&region, right - left, [320.0, 760.0]);
    let plan = PlanProjection::fit(region, Rect::new(left, top + 22.0, right - left, height));
    let mut page = Layer::new("exploration");
    page.add(heading);
    page.add(floor(&plan, 0, shown, scene));
    page.add(plan.scale_bar());
    let below = Px::new(left, plan.panel.bottom + 24.0);
    let (key, key_height) = legend::draw(&entries(shown), below, right - left);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + key_height + theme::MARGIN_PX / 2.0, page)
}

/// Draws finished explorations of reading scene side by side.
#[must_use]
pub fn draw_explorations(made: &[(Sensing, &Exploration)], scene: Option<&Scene>) -> Picture {
    let name = scene.map_or("unknown", |scene| scene.name.as_str());
    let (heading, top) =
        caption::draw(&format!("{name}, explored"), Some("SIMULATED, nothing measured"), &[]);
    let stops = || made.iter().flat_map(|(_, exploration)| &exploration.stops);
    let region = region(stops(), scene);
    let left = theme::MARGIN_PX + 34.0;
    let room = theme::PAGE_PX - theme::MARGIN_PX - left + GAP_PX;
    let width = room / made.len().max(1) as f64 - GAP_PX;
    let height = PlanProjection::height_for(&region, width, [180.0, 420.0]);
    let mut page = Layer::new("explorations");
    page.add(heading);
    for (number, (sensing, exploration)) in made.iter().enumerate() {
        let at = left + number as f64 * (width + GAP_PX);
        let plan = PlanProjection::fit(region, Rect::new(at, top + 40.0, width, height));
        page.add(floor(&plan, number, &exploration.stops, scene));
        let mut titles = Layer::new("sensing");
        let above = |rise: f64| Px::new(at, top + 40.0 - rise);
        titles.text(above(24.0), Anchor::Start, theme::TEXT_PX, sensing_label(*sensing));
        titles.text(above(7.0), Anchor::Start, theme::SMALL_PX, &statistics(&exploration.stops));
        page.add(titles);
    }
    let below = Px::new(theme::MARGIN_PX, top + 40.0 + height + 28.0);
    let last = made.iter().filter_map(|(_, exploration)| exploration.stops.last());
    let (key, key_height) =
        legend::draw(&entries(last), below, theme::PAGE_PX - 2.0 * theme::MARGIN_PX);
    page.add(key);
    Picture::new(theme::PAGE_PX, below.y + key_height + theme::MARGIN_PX / 2.0, page)
}

const fn sensing_label(sensing: Sensing) -> &'static str {
    match sensing {
        Sensing::Sonar => "sonar only",
        Sensing::Laser => "laser only",
        Sensing::JustInTime => "just-in-time sensing",
    }
}

fn statistics(stops: &[Stop]) -> String {
    let shots: usize = stops.iter().map(|stop| stop.laser.len()).sum();
    let lines = stops.last().map_or(0, |stop| stop.lines.len());
    let turns = stops.iter().all(|stop| stop.sonar.is_none());
    let unit = if turns { "full turns" } else { "shots" };
    format!("{} stops, {shots} laser {unit}, {lines} lines", stops.len())
}

fn region<'a>(stops: impl IntoIterator<Item = &'a Stop>, scene: Option<&Scene>) -> Bounds {
    let trajectory = Bounds::around(stops.into_iter().map(|stop| stop.pose.position()));
    let walls = scene.and_then(Bounds::from_scene);
    let both = match (walls, trajectory) {
        (Some(walls), Some(trajectory)) => Some(walls.including([trajectory.min, trajectory.max])),
        (walls, trajectory) => walls.or(trajectory),
    };
    both.unwrap_or(Bounds { min: DVec2::ZERO, max: DVec2::ONE }).grown(MARGIN_M)
}

/// Floor plan with trajectory, laser fields of view and the map at the last stop.
fn floor(plan: &PlanProjection, number: usize, stops: &[Stop], scene: Option<&Scene>) -> Layer {
    let mut inside =
        Layer::new("inside").clipped(&format!("exploration-window-{number}"), plan.panel);
    let mut views =
        Layer::new("laser-views").with("fill", theme::NO_ECHO).with("fill-opacity", 0.3);
    // Full turns at every stop would cover the plan, so only the latest is drawn.
    let turns = stops.iter().all(|stop| stop.sonar.is_none());
    let first = if turns { stops.len().saturating_sub(1) } else { 0 };
    for scan in stops[first..].iter().flat_map(|stop| &stop.laser) {
        views.polygon(&view(plan, scan));
    }
    inside.add(views);
    inside.extend(scene.map(|scene| plan.walls(scene)));
    let mut trajectory = Layer::new("trajectory").stroked(theme::ORANGE, 1.4);
    trajectory.runs([stops.iter().map(|stop| plan.px(stop.pose.position())).collect::<Vec<_>>()]);
    let mut places = Layer::new("stops").with("fill", theme::ORANGE).with("stroke", "none");
    for stop in stops {
        places.mark(MarkShape::Dot, plan.px(stop.pose.position()), 2.2, None);
    }
    inside.add(trajectory);
    inside.add(places);
    if let Some(last) = stops.last() {
        inside.extend(last.lines.iter().map(|line| lines::layer(plan, line)));
        inside.add(plan.pose(&last.pose));
    }
    let mut layer = Layer::new("floor-plan");
    layer.add(plan.frame());
    layer.add(inside);
    layer
}

/// Outline of a laser field of view.
fn view(plan: &PlanProjection, scan: &LaserScan) -> Vec<Px> {
    let every = scan.returns.len().div_ceil(VIEW_POINTS * (1 + scan.returns.len() / 512)).max(1);
    let rim = scan.returns.iter().step_by(every).map(|reading| {
        let range_m = reading.range_m.map_or(VIEW_M, |range_m| range_m.min(VIEW_M));
        plan.px(scan.pose.point_at(reading.azimuth_deg, range_m))
    });
    std::iter::once(plan.px(scan.pose.position())).chain(rim).collect()
}

fn entries<'a>(stops: impl IntoIterator<Item = &'a Stop>) -> Vec<LegendEntry> {
    let lines: Vec<_> = stops.into_iter().flat_map(|stop| &stop.lines).collect();
    let trajectory = LegendSample::Line { colour: theme::ORANGE, width_px: 1.4, dash: "none" };
    let wall = LegendSample::Line { colour: theme::WALL, width_px: theme::WALL_PX, dash: "none" };
    let dot = LegendSample::Mark { shape: MarkShape::Dot, colour: theme::NO_ECHO };
    let others = [
        LegendEntry::new(dot, "confirmed endpoint"),
        LegendEntry::new(trajectory, "trajectory and stops"),
        LegendEntry::new(wall, "wall"),
        LegendEntry::new(
            LegendSample::Mark { shape: MarkShape::Square, colour: theme::NO_ECHO },
            "laser field of view",
        ),
    ];
    lines::entries(lines).into_iter().chain(others).collect()
}

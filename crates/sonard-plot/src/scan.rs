//! Main picture: a scan on the floor plan, with strips of range and residual.

use super::{
    canvas::{Layer, Px, Rect},
    caption,
    floor::Floor,
    legend, legend_entries,
    picture::Picture,
    plan::PlanProjection,
    readings::PlottedScan,
    region, scan_caption, scan_strips,
    strip::AzimuthAxis,
    theme,
};
use sonard_model::{geometry::Pose, scene::Scene};
use sonard_records::ScanView;

/// Draws a scan. On the left is the floor plan: measured readings as marks whose shape and colour
/// indicate their kind, predictions as rays ending in rings, beams without a range as ticks on the
/// border and readings outside the view as arrows. On the right are range and residual against
/// azimuth.
///
/// A simulated log has no residual: its own readings are the marks, with the level above the
/// threshold in place of the residual. Without a scene there are no walls.
#[must_use]
pub fn draw_scan(scan: &ScanView, scene: Option<&Scene>) -> Picture {
    draw_scans(std::slice::from_ref(scan), scene)
}

/// Draws several scans over each other to show their repeatability; caption and
/// predictions are those of the first at each pose.
#[must_use]
pub fn draw_scans(scans: &[ScanView], scene: Option<&Scene>) -> Picture {
    let readings: Vec<PlottedScan> = scans.iter().map(PlottedScan::from_scan).collect();
    let placed: Vec<(Pose, &PlottedScan)> = scans
        .iter()
        .zip(&readings)
        .filter_map(|(view, r)| Some((scan_caption::pose_of(view)?, r)))
        .collect();
    let title = scan_caption::title(scans, scene);
    let (heading, top) =
        caption::draw(&title, scan_caption::badge(scans), &scan_caption::lines(scans));

    let region = region::region(&placed, scene);
    let layout = Layout::choose(&region, top + 22.0);
    let plan = PlanProjection::fit(region, layout.plan);
    let azimuths =
        AzimuthAxis::from_plan(scans.first().and_then(|s| Some(&s.start.as_ref()?.plan)));

    let mut page = Layer::new("scan");
    page.add(heading);
    let (floor, outside) = floor_plan(&plan, &placed, scene);
    page.add(floor);
    page.add(strips(&layout.strips, azimuths, &readings));
    let below = Px::new(theme::MARGIN_PX, layout.bottom + 10.0);
    let width = theme::PAGE_PX - 2.0 * theme::MARGIN_PX;
    let entries = legend_entries::all(&readings, scene, outside, true);
    let (entries, height) = legend::draw(&entries, below, width);
    page.add(entries);
    Picture::new(theme::PAGE_PX, below.y + height + theme::MARGIN_PX / 2.0, page)
}

/// Panels of the picture.
struct Layout {
    plan: Rect,
    strips: [Rect; 2],
    bottom: f64,
}

impl Layout {
    /// Strips to the right of the plan, or below it if the plan is long.
    fn choose(region: &super::plan::Bounds, top: f64) -> Self {
        let size = region.size();
        if size.x > 2.0 * size.y {
            Self::stacked(region, top)
        } else {
            Self::in_columns(region, top)
        }
    }

    fn in_columns(region: &super::plan::Bounds, top: f64) -> Self {
        let left = theme::MARGIN_PX + 36.0;
        let plan_width = 540.0;
        let height = PlanProjection::height_for(region, plan_width, [430.0, 640.0]);
        let strip_left = left + plan_width + 66.0;
        let strip_width = theme::PAGE_PX - theme::MARGIN_PX - strip_left;
        let strip_height = (height - 46.0) / 2.0;
        let strip = |y: f64| Rect::new(strip_left, y, strip_width, strip_height);
        Self {
            plan: Rect::new(left, top, plan_width, height),
            strips: [strip(top), strip(top + strip_height + 30.0)],
            bottom: top + height + 22.0,
        }
    }

    fn stacked(region: &super::plan::Bounds, top: f64) -> Self {
        let left = theme::MARGIN_PX + 50.0;
        let width = theme::PAGE_PX - theme::MARGIN_PX - left;
        let height = PlanProjection::height_for(region, width, [180.0, 460.0]);
        let strip = |y: f64| Rect::new(left, y, width, 150.0);
        let strips_top = top + height + 48.0;
        Self {
            plan: Rect::new(left, top, width, height),
            strips: [strip(strips_top), strip(strips_top + 150.0 + 30.0)],
            bottom: strips_top + 330.0 + 38.0,
        }
    }
}

/// Scans from one pose.
struct PosedScans<'a> {
    pose: Pose,
    /// Scan whose predictions are shown.
    first: &'a PlottedScan,
    /// Beams of all scans from the pose.
    all: PlottedScan,
}

impl<'a> PosedScans<'a> {
    /// Groups scans by pose, in the order of the log.
    fn gather(scans: &[(Pose, &'a PlottedScan)]) -> Vec<Self> {
        let mut by_pose: Vec<Self> = Vec::new();
        for &(pose, first) in scans {
            if by_pose.iter().all(|at_pose| at_pose.pose != pose) {
                let here = scans.iter().filter(|(other, _)| *other == pose);
                let all = PlottedScan::merged(here.map(|(_, scan)| *scan));
                by_pose.push(Self { pose, first, all });
            }
        }
        by_pose
    }

    fn predicted(&self, plan: &'a PlanProjection) -> Floor<'_> {
        Floor { plan, pose: self.pose, scan: self.first }
    }

    fn measured(&self, plan: &'a PlanProjection) -> Floor<'_> {
        Floor { plan, pose: self.pose, scan: &self.all }
    }
}

/// Floor plan, and the number of readings outside it.
fn floor_plan(
    plan: &PlanProjection,
    scans: &[(Pose, &PlottedScan)],
    scene: Option<&Scene>,
) -> (Layer, usize) {
    let by_pose = PosedScans::gather(scans);
    let mut inside = Layer::new("inside").clipped("plan-window", plan.panel);
    inside.extend(by_pose.iter().map(|at_pose| at_pose.predicted(plan).model()));
    inside.extend(scene.map(|scene| plan.walls(scene)));
    for at_pose in &by_pose {
        inside.extend(scene.map(|scene| plan.body(scene, &at_pose.pose)));
        inside.add(at_pose.predicted(plan).min_range());
    }
    let opacity = if scans.len() > 1 { 0.6 } else { 1.0 };
    inside.extend(by_pose.iter().map(|at_pose| at_pose.measured(plan).marks(opacity)));
    inside.extend(by_pose.iter().map(|at_pose| plan.pose(&at_pose.pose)));

    let mut labels = plan.labels(scene);
    by_pose.iter().for_each(|at_pose| at_pose.measured(plan).avoid_marks(&mut labels));
    let mut layer = Layer::new("floor-plan");
    layer.add(plan.frame());
    layer.add(inside);
    for floor in by_pose.iter().map(|at_pose| at_pose.measured(plan)) {
        layer.add(floor.border_ticks());
        layer.add(floor.outside(&mut labels));
    }
    layer.extend(scene.map(|scene| plan.names(scene, &mut labels)));
    layer.add(plan.scale_bar());
    (layer, by_pose.iter().map(|at_pose| at_pose.measured(plan).count_outside()).sum())
}

fn strips(panels: &[Rect; 2], azimuths: AzimuthAxis, scans: &[PlottedScan]) -> Layer {
    let mut layer = Layer::new("strips");
    let has_residuals = scans.iter().any(|scan| scan.residuals().next().is_some());
    let has_margins =
        scans.iter().flat_map(|scan| &scan.beams).any(|beam| beam.margin_db.is_some());
    let [upper, lower] = *panels;
    let second = if has_residuals {
        Some(scan_strips::residual(lower, azimuths, scans, true))
    } else if has_margins {
        Some(scan_strips::margin(lower, azimuths, scans, true))
    } else {
        None
    };
    match second {
        Some(second) => {
            layer.add(scan_strips::range(upper, azimuths, scans, false));
            layer.add(second);
        }
        None => {
            let whole = Rect { bottom: lower.bottom, ..upper };
            layer.add(scan_strips::range(whole, azimuths, scans, true));
        }
    }
    layer
}

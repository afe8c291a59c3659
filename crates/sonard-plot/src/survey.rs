//! Floor plan of a survey: walls by certainty, corners with their intervals, course and echoes.

use super::{
    canvas::{Layer, MarkShape, Px, Rect},
    caption,
    legend::{self, LegendEntry, LegendSample},
    picture::Picture,
    plan::{Bounds, PlanProjection},
    theme,
};
use sonard_model::geometry::{DVec2, Pose};

/// Certainty of a stretch of wall or of a post.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WallCertainty {
    /// Echoes come from it.
    Observed,
    /// Readings require it.
    Implied,
    /// Readings hardly depend on it.
    Conjectured,
}

/// Cause of an echo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EchoCause {
    /// A single mirror reflection.
    First,
    /// Several mirror reflections.
    Multiple,
    /// Diffraction at an edge.
    Edge,
    /// None that the plan has.
    Unexplained,
}

/// Survey with its caption.
#[derive(Debug, Clone)]
pub struct SurveyView<'a> {
    /// Title above the picture.
    pub title: String,
    /// Lines below the title.
    pub lines: Vec<String>,
    /// Provenance of the readings, unless from hardware ([`badge_for`](crate::badge_for)).
    pub badge: Option<&'static str>,
    /// Stretches of walls, metres.
    pub walls: &'a [(WallCertainty, [DVec2; 2])],
    /// Posts by certainty, centre and radius, metres.
    pub posts: &'a [(WallCertainty, DVec2, f64)],
    /// Corners with the radius of their 95 % interval, metres.
    pub corners: &'a [(DVec2, f64)],
    /// Poses in the order of the course.
    pub poses: &'a [Pose],
    /// Echoes at their range and azimuth, metres.
    pub echoes: &'a [(DVec2, EchoCause)],
    /// Place from which a further sweep resolves most of what is open, metres.
    pub next_view: Option<DVec2>,
}

const WALLS: [(WallCertainty, &str, &str, f64, &str); 3] = [
    (WallCertainty::Observed, "observed wall or post", theme::WALL, 3.2, "none"),
    (WallCertainty::Implied, "implied wall", theme::BLUE, 2.4, "9 3"),
    (WallCertainty::Conjectured, "conjectured wall or post", theme::FRAME, 2.0, "1.5 3"),
];
const ECHOES: [(EchoCause, &str, &str, MarkShape); 4] = [
    (EchoCause::First, "echo by one reflection", theme::GREEN, MarkShape::Dot),
    (EchoCause::Multiple, "by several", theme::SKY, MarkShape::Dot),
    (EchoCause::Edge, "by an edge", theme::PURPLE, MarkShape::Diamond),
    (EchoCause::Unexplained, "unexplained", theme::VERMILLION, MarkShape::Cross),
];
/// Space around the walls, metres.
const AROUND_M: f64 = 0.4;
/// Radius at which the interval of a corner is legible, px.
const LEGIBLE_PX: f64 = 6.0;
const COURSE_PX: f64 = 1.4;
/// Mark of the next view.
const NEXT_VIEW: MarkShape = MarkShape::Triangle;
const NEXT_VIEW_PX: f64 = 8.0;

/// Draws the walls over the echoes that they explain. Echoes of several reflections appear behind
/// the walls. Intervals of corners are enlarged by a power of ten, which the legend states.
#[must_use]
pub fn draw_survey(view: &SurveyView) -> Picture {
    let (heading, top) = caption::draw(&view.title, view.badge, &view.lines);
    let (left, right) = (theme::MARGIN_PX + 38.0, theme::PAGE_PX - theme::MARGIN_PX);
    let region = region(view);
    let height = PlanProjection::height_for(&region, right - left, [160.0, 1400.0]);
    let plan = PlanProjection::fit(region, Rect::new(left, top + 22.0, right - left, height));
    let factor = enlargement(view, &plan);
    let below = Px::new(left, plan.panel.bottom + 24.0);
    let (key, key_height) = legend::draw(&entries(view, factor), below, right - left);
    let page_px = below.y + key_height + theme::MARGIN_PX / 2.0;
    let mut page = Layer::new("survey");
    page.add(heading);
    page.add(plan.frame());
    page.add(key);
    let mut inside = Layer::new("inside").clipped("survey-window", plan.panel);
    inside.add(echoes(view, &plan));
    inside.add(walls(view, &plan));
    inside.add(corners(view, &plan, factor));
    inside.add(course(view, &plan));
    inside.add(next_view(view, &plan));
    page.add(inside);
    page.add(plan.scale_bar());
    Picture::new(theme::PAGE_PX, page_px, page)
}

fn region(view: &SurveyView) -> Bounds {
    let ends = view.walls.iter().flat_map(|(_, ends)| *ends);
    let posts = view.posts.iter().map(|(_, center, _)| *center);
    let places = view.poses.iter().map(Pose::position).chain(view.next_view);
    let around = Bounds::around(ends.chain(posts).chain(places).filter(|at| at.is_finite()));
    let nothing = Bounds { min: DVec2::ZERO, max: DVec2::ONE };
    around.unwrap_or(nothing).grown(AROUND_M)
}

/// Power of ten by which the intervals of corners are enlarged.
fn enlargement(view: &SurveyView, plan: &PlanProjection) -> f64 {
    let mut radii: Vec<f64> = view.corners.iter().map(|(_, radius_m)| *radius_m).collect();
    radii.sort_by(f64::total_cmp);
    let middle_px = radii.get(radii.len() / 2).map_or(LEGIBLE_PX, |m| plan.length_px(*m));
    let factor = 10_f64.powf((LEGIBLE_PX / middle_px.max(1e-6)).log10().ceil());
    factor.clamp(1.0, 1e4)
}

fn entries(view: &SurveyView, factor: f64) -> Vec<LegendEntry> {
    let has_wall = |certainty| {
        view.walls.iter().any(|(of, _)| *of == certainty)
            || view.posts.iter().any(|(of, ..)| *of == certainty)
    };
    let has_echo = |cause| view.echoes.iter().any(|(_, of)| *of == cause);
    let walls = WALLS.into_iter().filter(|(certainty, ..)| has_wall(*certainty));
    let walls = walls.map(|(_, name, colour, width_px, dash)| {
        LegendEntry::new(LegendSample::Line { colour, width_px, dash }, name)
    });
    let marks = ECHOES.into_iter().filter(|(cause, ..)| has_echo(*cause));
    let marks = marks.map(|(_, name, colour, shape)| {
        LegendEntry::new(LegendSample::Mark { shape, colour }, name)
    });
    let mut entries: Vec<LegendEntry> = walls.chain(marks).collect();
    if !view.corners.is_empty() {
        let enlarged =
            if factor > 1.0 { format!(", {factor} times enlarged") } else { String::new() };
        let ring = LegendSample::Ring { colour: theme::VERMILLION };
        entries.push(LegendEntry::new(ring, format!("95 % interval of a corner{enlarged}")));
    }
    let line = LegendSample::Line { colour: theme::ORANGE, width_px: COURSE_PX, dash: "none" };
    entries.push(LegendEntry::new(line, "course"));
    if view.next_view.is_some() {
        let mark = LegendSample::Mark { shape: NEXT_VIEW, colour: theme::BLUE };
        entries.push(LegendEntry::new(mark, "next view"));
    }
    entries
}

fn walls(view: &SurveyView, plan: &PlanProjection) -> Layer {
    let mut all = Layer::new("walls");
    for (certainty, _, colour, width_px, dash) in WALLS {
        let mut layer = Layer::new("walls-of-one-status").stroked(colour, width_px);
        layer = layer.with("stroke-dasharray", dash);
        for (_, [a, b]) in view.walls.iter().filter(|(of, _)| *of == certainty) {
            layer.line(plan.px(*a), plan.px(*b));
        }
        for (_, center, radius_m) in view.posts.iter().filter(|(of, ..)| *of == certainty) {
            layer.circle(plan.px(*center), plan.length_px(*radius_m));
        }
        all.add(layer);
    }
    all
}

fn corners(view: &SurveyView, plan: &PlanProjection, factor: f64) -> Layer {
    let mut layer = Layer::new("corners").stroked(theme::VERMILLION, 1.2);
    for (at, radius_m) in view.corners {
        layer.circle(plan.px(*at), plan.length_px(factor * radius_m));
    }
    layer
}

fn course(view: &SurveyView, plan: &PlanProjection) -> Layer {
    let mut layer = Layer::new("course").stroked(theme::ORANGE, COURSE_PX);
    let places: Vec<Px> = view.poses.iter().map(|pose| plan.px(pose.position())).collect();
    layer.runs([places]);
    for pose in view.poses {
        layer.circle(plan.px(pose.position()), 4.0);
        layer.line(plan.px(pose.position()), plan.px(pose.point_at(0.0, 0.12)));
    }
    layer
}

fn next_view(view: &SurveyView, plan: &PlanProjection) -> Layer {
    let mut layer = Layer::new("next-view")
        .with("fill", theme::BLUE)
        .with("stroke", theme::PAPER)
        .with("stroke-width", 1.0);
    if let Some(at) = view.next_view {
        layer.mark(NEXT_VIEW, plan.px(at), NEXT_VIEW_PX, None);
    }
    layer
}

fn echoes(view: &SurveyView, plan: &PlanProjection) -> Layer {
    let mut all = Layer::new("echoes");
    for (cause, _, colour, shape) in ECHOES {
        let mut layer = Layer::new("echoes-of-one-cause")
            .with("fill", colour)
            .with("stroke", colour)
            .with("stroke-width", 0.8);
        for (at, _) in view.echoes.iter().filter(|(_, of)| *of == cause) {
            layer.mark(shape, plan.px(*at), 1.6, None);
        }
        all.add(layer);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners whose intervals differ by orders of magnitude have legible circles all the same.
    #[test]
    fn intervals_are_enlarged_to_be_legible() {
        let room = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]].map(DVec2::from);
        let walls: Vec<_> =
            (0..4).map(|at| (WallCertainty::Observed, [room[at], room[(at + 1) % 4]])).collect();
        for radius_m in [3e-5, 4e-4, 0.02, 0.3] {
            let corners = room.map(|corner| (corner, radius_m));
            let pose = Pose { x_m: 1.0, y_m: 1.0, heading_deg: 30.0 };
            let view = SurveyView {
                title: "room".to_owned(),
                lines: Vec::new(),
                badge: None,
                walls: &walls,
                posts: &[],
                corners: &corners,
                poses: &[pose],
                echoes: &[(DVec2::new(1.0, 3.0), EchoCause::First)],
                next_view: (radius_m > 1e-3).then_some(DVec2::new(2.0, 2.0)),
            };
            let plan = PlanProjection::fit(region(&view), Rect::new(0.0, 0.0, 900.0, 700.0));
            let factor = enlargement(&view, &plan);
            let drawn_px = plan.length_px(factor * radius_m);
            assert!(drawn_px >= LEGIBLE_PX && (factor == 1.0 || drawn_px < 11.0 * LEGIBLE_PX));
            let svg = draw_survey(&view).to_svg();
            assert_eq!(svg.contains("times enlarged"), factor > 1.0, "{radius_m}");
            assert_eq!(svg.matches("next view").count(), usize::from(radius_m > 1e-3));
            assert!(svg.contains("observed wall") && !svg.contains("conjectured wall"));
        }
    }
}

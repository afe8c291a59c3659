//! Merging of lines that belong to one wall.

use super::{LineKind, MapLine};
use sonard_model::geometry::DVec2;

/// Settings of the merging of lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeSettings {
    /// Maximum angle between nearly parallel lines, degrees.
    pub parallel_deg: f64,
    /// Critical distance `d`, metres.
    pub distance_m: f64,
    /// Maximum gap along the wall, metres.
    pub gap_m: f64,
}

impl Default for MergeSettings {
    /// The paper's critical distance of 5 cm.
    fn default() -> Self {
        Self { parallel_deg: 10.0, distance_m: 0.05, gap_m: 0.15 }
    }
}

/// Merges two lines if they are nearly parallel and close.
///
/// A sonar line is projected onto a laser or complex one. Otherwise the new slope is
/// `g m_i + (1 - g) m_j`, equation (1), where `m_i` belongs to the line with the larger product
/// `l f` of length and confidence, and `g = max(l1 / (l1 + l2) f1, l2 / (l1 + l2) f2)`. Slopes are
/// relative to line i, so that none is infinite. The result passes through the intersection of the
/// two, or else through the point between their nearest ends, weighted by `g`.
///
/// A confirmed end keeps its position: a line with one passes through it, a line with two connects
/// them. If both confirm the same end, the midpoint is used.
#[must_use]
pub fn merge(a: &MapLine, b: &MapLine, settings: &MergeSettings) -> Option<MapLine> {
    let weight = |line: &MapLine| line.length_m() * line.confidence;
    let (main, minor) = if weight(a) >= weight(b) { (a, b) } else { (b, a) };
    if !are_close(main, minor, settings) {
        return None;
    }
    Some(match (main.kind, minor.kind) {
        (LineKind::Sonar, LineKind::Laser | LineKind::Complex) => project(main, minor),
        (LineKind::Laser | LineKind::Complex, LineKind::Sonar) => project(minor, main),
        _ => blend(main, minor),
    })
}

fn are_close(main: &MapLine, minor: &MapLine, settings: &MergeSettings) -> bool {
    let (along, across) = (main.direction(), minor.direction());
    let sine = along.perp_dot(across).abs();
    if along == DVec2::ZERO
        || across == DVec2::ZERO
        || sine > settings.parallel_deg.to_radians().sin()
    {
        return false;
    }
    let places = minor.ends.map(|end| along.dot(end - main.ends[0]));
    let (low, high) = (places[0].min(places[1]), places[0].max(places[1]));
    let length_m = main.length_m();
    // They must be close where they overlap, or else at their nearest ends.
    let from = low.clamp(0.0, length_m);
    let to = high.clamp(0.0, length_m);
    let offsets = minor.ends.map(|end| along.perp_dot(end - main.ends[0]));
    let run = places[1] - places[0];
    let offset_at = |place: f64| {
        let share = if run == 0.0 { 0.5 } else { (place - places[0]) / run };
        offsets[0] + share.clamp(0.0, 1.0) * (offsets[1] - offsets[0])
    };
    let near = |place: f64| offset_at(place).abs() < settings.distance_m;
    let gap_m = (low - length_m).max(-high).max(0.0);
    gap_m <= settings.gap_m && near(from) && near(to)
}

/// Projects a sonar line onto a better one, extended where the sonar line reaches beyond it.
fn project(sonar: &MapLine, better: &MapLine) -> MapLine {
    let weight = sonar.length_m() + better.length_m();
    let confidence =
        (sonar.length_m() * sonar.confidence + better.length_m() * better.confidence) / weight;
    lay_on(better.ends[0], better.direction(), better, sonar, LineKind::Complex, confidence)
}

/// Weighted combination of both lines (1).
fn blend(main: &MapLine, minor: &MapLine) -> MapLine {
    let (l1, l2) = (main.length_m(), minor.length_m());
    let gamma = (l1 / (l1 + l2) * main.confidence).max(l2 / (l1 + l2) * minor.confidence);
    let (along, across) = (main.direction(), minor.direction());
    let across = if across.dot(along) < 0.0 { -across } else { across };
    let slope = (1.0 - gamma) * along.perp_dot(across) / along.dot(across);
    let turned = (along + slope * along.perp()).normalize();
    let through = crossing(main, minor).unwrap_or_else(|| {
        let pairs = main.ends.iter().flat_map(|a| minor.ends.iter().map(move |b| (*a, *b)));
        let nearest = pairs.min_by(|p, q| p.0.distance(p.1).total_cmp(&q.0.distance(q.1)));
        let (a, b) = nearest.unwrap_or((main.ends[0], minor.ends[0]));
        gamma * a + (1.0 - gamma) * b
    });
    let kind = if main.kind == minor.kind { main.kind } else { LineKind::Complex };
    let confidence = (l1 * main.confidence + l2 * minor.confidence) / (l1 + l2);
    lay_on(through, turned, main, minor, kind, confidence)
}

/// Intersection of two segments.
fn crossing(a: &MapLine, b: &MapLine) -> Option<DVec2> {
    let (u, v) = (a.ends[1] - a.ends[0], b.ends[1] - b.ends[0]);
    let across = u.perp_dot(v);
    if across == 0.0 {
        return None;
    }
    let between = b.ends[0] - a.ends[0];
    let (s, t) = (between.perp_dot(v) / across, between.perp_dot(u) / across);
    let inside = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
    inside.then(|| a.ends[0] + s * u)
}

/// Maximum distance of confirmed ends taken for one, metres; otherwise the outer one is used.
const SAME_END_M: f64 = 0.15;

/// Line through a point that reaches as far as two others do, or to their confirmed ends.
fn lay_on(
    through: DVec2,
    along: DVec2,
    first: &MapLine,
    second: &MapLine,
    kind: LineKind,
    confidence: f64,
) -> MapLine {
    let place_m = |point: DVec2| along.dot(point - through);
    let spans = [first, second].map(|line| {
        let mut ends = [0, 1].map(|end| (line.ends[end], line.terminal[end]));
        if place_m(ends[0].0) > place_m(ends[1].0) {
            ends.swap(0, 1);
        }
        ends
    });
    let choose = |end: usize, outwards: f64| {
        let [(a, a_confirmed), (b, b_confirmed)] = [spans[0][end], spans[1][end]];
        let outer = if outwards * (place_m(a) - place_m(b)) > 0.0 { a } else { b };
        match (a_confirmed, b_confirmed) {
            (true, false) => (a, true),
            (false, true) => (b, true),
            (true, true) if a.distance(b) < SAME_END_M => (a.midpoint(b), true),
            (both, _) => (outer, both),
        }
    };
    let ((low, low_confirmed), (high, high_confirmed)) = (choose(0, -1.0), choose(1, 1.0));
    // A confirmed end anchors the line.
    let anchor = match (low_confirmed, high_confirmed) {
        (true, _) => low,
        (_, true) => high,
        _ => through,
    };
    let placed = |point: DVec2, is_confirmed: bool| {
        if is_confirmed { point } else { anchor + along.dot(point - anchor) * along }
    };
    MapLine {
        ends: [placed(low, low_confirmed), placed(high, high_confirmed)],
        terminal: [low_confirmed, high_confirmed],
        kind,
        confidence,
        seen_from: first.seen_from,
    }
}

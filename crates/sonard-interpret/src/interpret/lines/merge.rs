//! Merging lines that are one wall.

use super::{LineKind, MapLine};
use sonard_model::geometry::DVec2;

/// Settings of the merging of lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeSettings {
    /// Nearly parallel: at most this angle, degrees.
    pub parallel_deg: f64,
    /// The critical distance `d`, metres.
    pub distance_m: f64,
    /// Greatest gap along the wall, metres.
    pub gap_m: f64,
}

impl Default for MergeSettings {
    /// With the paper's 5 cm.
    fn default() -> Self {
        Self { parallel_deg: 10.0, distance_m: 0.05, gap_m: 0.15 }
    }
}

/// One line of two, if they are nearly parallel and close.
///
/// A sonar line is projected onto a laser or complex one. Otherwise the new slope is
/// `g m_i + (1 - g) m_j`, equation (1), where `m_i` is of the line with more length times
/// confidence, `l f`, and `g = max(l1 / (l1 + l2) f1, l2 / (l1 + l2) f2)`; slopes are counted
/// from line i, so that none is infinite. It goes through the crossing of the two, or else through
/// the point between their nearest ends, weighted alike. A confirmed end stays one and stays
/// where it is: a line with one goes through it, a line with two is the line between them. Of two
/// that confirm the same end, the middle counts.
#[must_use]
pub fn merge(one: &MapLine, other: &MapLine, settings: &MergeSettings) -> Option<MapLine> {
    let weight = |line: &MapLine| line.length_m() * line.confidence;
    let (main, minor) = if weight(one) >= weight(other) { (one, other) } else { (other, one) };
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
    // Where they lie beside each other, or else where they come nearest, they must be close.
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

/// The sonar line on the better one: that one, longer where the sonar line reaches beyond it.
fn project(sonar: &MapLine, better: &MapLine) -> MapLine {
    let weight = sonar.length_m() + better.length_m();
    let confidence =
        (sonar.length_m() * sonar.confidence + better.length_m() * better.confidence) / weight;
    lay_on(better.ends[0], better.direction(), better, sonar, LineKind::Complex, confidence)
}

/// Both with their weights (1).
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

/// Where two segments cross.
fn crossing(one: &MapLine, other: &MapLine) -> Option<DVec2> {
    let (u, v) = (one.ends[1] - one.ends[0], other.ends[1] - other.ends[0]);
    let across = u.perp_dot(v);
    if across == 0.0 {
        return None;
    }
    let between = other.ends[0] - one.ends[0];
    let (s, t) = (between.perp_dot(v) / across, between.perp_dot(u) / across);
    let inside = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
    inside.then(|| one.ends[0] + s * u)
}

/// Ends confirmed twice are one end if they are so close, metres; else the outer one holds.
const SAME_END_M: f64 = 0.15;

/// A line through a point that reaches as far as two others do, or to their confirmed ends.
fn lay_on(
    through: DVec2,
    along: DVec2,
    one: &MapLine,
    other: &MapLine,
    kind: LineKind,
    confidence: f64,
) -> MapLine {
    let place_m = |point: DVec2| along.dot(point - through);
    let spans = [one, other].map(|line| {
        let mut ends = [0, 1].map(|end| (line.ends[end], line.terminal[end]));
        if place_m(ends[0].0) > place_m(ends[1].0) {
            ends.swap(0, 1);
        }
        ends
    });
    let choose = |end: usize, outwards: f64| {
        let [(a, a_holds), (b, b_holds)] = [spans[0][end], spans[1][end]];
        let outer = if outwards * (place_m(a) - place_m(b)) > 0.0 { a } else { b };
        match (a_holds, b_holds) {
            (true, false) => (a, true),
            (false, true) => (b, true),
            (true, true) if a.distance(b) < SAME_END_M => (a.midpoint(b), true),
            (both, _) => (outer, both),
        }
    };
    let ((low, low_holds), (high, high_holds)) = (choose(0, -1.0), choose(1, 1.0));
    // The line is shifted onto a confirmed end, if there is one.
    let anchor = match (low_holds, high_holds) {
        (true, _) => low,
        (_, true) => high,
        _ => through,
    };
    let laid = |point: DVec2, holds: bool| {
        if holds { point } else { anchor + along.dot(point - anchor) * along }
    };
    MapLine {
        ends: [laid(low, low_holds), laid(high, high_holds)],
        terminal: [low_holds, high_holds],
        kind,
        confidence,
        seen_from: one.seen_from,
    }
}

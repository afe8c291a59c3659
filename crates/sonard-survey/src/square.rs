//! Rooms whose walls are mostly square to each other.

use sonard_model::geometry::{DVec2, Pose};

use crate::{
    arrangement::Segment,
    line::{Line, off_square_rad, square_axis},
};

/// Deviation from the square axis up to which a line is tied to it, radians.
pub(crate) const MAX_OFF_RAD: f64 = 0.12;
/// Maximum price of an oblique line, nats.
const OBLIQUE_NATS: f64 = 6.0;

/// Price of directions of lines off a common square axis, nats: half the square of the deviation in
/// standard deviations, up to that of an oblique line.
pub(crate) fn oblique_price(segments: &[Segment], sigma_rad: f64) -> f64 {
    let Some(axis_rad) = axis_of(segments) else { return 0.0 };
    let mut lines: Vec<&Segment> = segments.iter().collect();
    lines.sort_by_key(|segment| segment.line);
    lines.dedup_by_key(|segment| segment.line);
    let of_line = |segment: &&Segment| {
        let off = off_square_rad((segment.b - segment.a).to_angle(), axis_rad) / sigma_rad;
        (0.5 * off * off).min(OBLIQUE_NATS)
    };
    lines.iter().map(of_line).sum()
}

/// Square axis of walls, weighted by length, radians modulo a quarter turn.
fn axis_of(segments: &[Segment]) -> Option<f64> {
    let sum = segments.iter().fold(DVec2::ZERO, |sum, segment| {
        let along = segment.b - segment.a;
        sum + along.length() * DVec2::from_angle(4.0 * along.to_angle())
    });
    (sum.length() > 1e-9).then(|| 0.25 * sum.to_angle())
}

/// Turns lines to the nearest direction of a common square axis.
pub(crate) fn square_lines(lines: &mut [Line], poses: &[Pose]) {
    let supported: Vec<Line> = lines.iter().filter(|line| line.support >= 2).cloned().collect();
    let Some(axis_rad) = square_axis(&supported) else { return };
    let center = poses.iter().map(Pose::position).sum::<DVec2>() / poses.len().max(1) as f64;
    for line in lines {
        let off_rad = off_square_rad(line.normal_rad, axis_rad);
        if off_rad.abs() < MAX_OFF_RAD {
            *line = line.turned(-off_rad, center, poses);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_off_the_axis_have_a_price() {
        let corners = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]];
        let turn = DVec2::from_angle(0.3);
        let side = |at: usize| Segment {
            line: at,
            a: turn.rotate(corners[at].into()),
            b: turn.rotate(corners[(at + 1) % 4].into()),
        };
        let mut walls: Vec<Segment> = (0..4).map(side).collect();
        let sigma_rad = 2_f64.to_radians();
        assert!(oblique_price(&walls, sigma_rad) < 1e-9);
        assert!(oblique_price(&[], sigma_rad) < 1e-9);
        // A short wall hardly moves the axis: two standard deviations cost two nats.
        let by = DVec2::from_angle(2.0 * sigma_rad);
        walls.push(Segment { line: 4, a: walls[0].a, b: walls[0].a + 0.01 * by.rotate(turn) });
        assert!((oblique_price(&walls, sigma_rad) - 2.0).abs() < 0.05);
        // However oblique, a line costs no more than 6.
        walls[4].b = walls[4].a + 0.01 * DVec2::from_angle(0.3 + 0.7);
        assert!((oblique_price(&walls, sigma_rad) - 6.0).abs() < 0.05);
    }
}

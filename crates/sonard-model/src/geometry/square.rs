//! Corners that were meant to be right.

use rstar::{RTree, primitives::GeomWithData};

use super::{DVec2, SNAP_M};

/// Corners are moved by this much at most, metres: what rounding to tenths of a millimetre does.
const MOST_M: f64 = 1e-4;

/// Moves below this are rounding of the arithmetic, metres.
const LEAST_M: f64 = 1e-13;

/// Moving one corner turns the next one's sides; a chain of them settles quickly.
const ROUNDS: usize = 50;

/// Makes corners of two segments right-angled where moving them by 0.1 mm or less does it.
///
/// A corner turned in a plan and written down to a tenth of a millimetre is 90.003 degrees, say.
/// Sound cannot tell, but a mirror image can: above 90 degrees no ray comes back by both walls,
/// below it two do.
pub fn square_up(segments: &mut [(DVec2, DVec2)]) {
    let corners = corners(segments);
    for _ in 0..ROUNDS {
        let mut moved = false;
        for &[one, other] in &corners {
            let corner = end(segments, one);
            let place = right_angled(corner, end(segments, one ^ 1), end(segments, other ^ 1));
            let distance_m = place.distance(corner);
            if (LEAST_M..=MOST_M).contains(&distance_m) {
                *end_mut(segments, one) = place;
                *end_mut(segments, other) = place;
                moved = true;
            }
        }
        if !moved {
            break;
        }
    }
}

/// Ends are numbered: `2 i` and `2 i + 1` for segment `i`.
fn end(segments: &[(DVec2, DVec2)], number: usize) -> DVec2 {
    let (a, b) = segments[number / 2];
    if number.is_multiple_of(2) { a } else { b }
}

fn end_mut(segments: &mut [(DVec2, DVec2)], number: usize) -> &mut DVec2 {
    let (a, b) = &mut segments[number / 2];
    if number.is_multiple_of(2) { a } else { b }
}

/// Pairs of ends at the same point, where no third segment ends.
fn corners(segments: &[(DVec2, DVec2)]) -> Vec<[usize; 2]> {
    let ends = (0..2 * segments.len())
        .map(|number| GeomWithData::new(end(segments, number).to_array(), number));
    let tree = RTree::bulk_load(ends.collect());
    let pair = |number: usize| {
        let place = end(segments, number).to_array();
        let mut others = tree
            .locate_within_distance(place, SNAP_M * SNAP_M)
            .map(|near| near.data)
            .filter(|&other| other != number);
        let other = others.next()?;
        (others.next().is_none() && other > number && other / 2 != number / 2)
            .then_some([number, other])
    };
    (0..2 * segments.len()).filter_map(pair).collect()
}

/// The point nearest to `corner` that sees `a` and `b` at a right angle: on Thales' circle.
fn right_angled(corner: DVec2, a: DVec2, b: DVec2) -> DVec2 {
    let (middle, radius) = (0.5 * (a + b), 0.5 * a.distance(b));
    middle + radius * (corner - middle).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angle_deg(segments: &[(DVec2, DVec2)], i: usize) -> f64 {
        let (one, other) = (segments[i], segments[(i + 1) % segments.len()]);
        (one.0 - one.1).angle_to(other.1 - other.0).abs().to_degrees()
    }

    fn ring(corners: &[DVec2]) -> Vec<(DVec2, DVec2)> {
        let next = corners.iter().cycle().skip(1);
        corners.iter().copied().zip(next.copied()).collect()
    }

    #[test]
    fn a_turned_room_written_to_tenths_of_millimetres_becomes_right() {
        let frame = DVec2::from_angle(0.317);
        let written = |x: f64, y: f64| (DVec2::new(x, y).rotate(frame) * 1e4).round() / 1e4;
        let mut room =
            ring(&[written(0.0, 0.0), written(3.0, 0.0), written(3.0, 2.0), written(0.0, 2.0)]);
        let before = room.clone();
        square_up(&mut room);
        for i in 0..4 {
            assert!((angle_deg(&room, i) - 90.0).abs() < 1e-9, "{}", angle_deg(&room, i));
            assert!(room[i].0.distance(before[i].0) < 3e-4);
        }
    }

    #[test]
    fn other_corners_stay() {
        let mut plan = ring(&[DVec2::ZERO, DVec2::new(2.0, 0.0), DVec2::new(2.001, 2.0)]);
        let before = plan.clone();
        square_up(&mut plan);
        assert_eq!(plan, before);
        // Three walls at a point: it is not theirs to move.
        let point = DVec2::new(1.0, 1e-5);
        let mut star = vec![(DVec2::ZERO, point), (point, DVec2::X), (point, DVec2::new(1.0, 3.0))];
        let before = star.clone();
        square_up(&mut star);
        assert_eq!(star, before);
    }
}

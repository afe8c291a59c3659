//! Approximation of circular arcs by walls.

#[cfg(feature = "dxf")]
use std::f64::consts::PI;

#[cfg(feature = "dxf")]
use sonard_model::geometry::DVec2;

/// Maximum deviation of walls from a curve, metres.
pub(crate) const MAX_CURVE_ERROR_M: f64 = 1e-3;
/// Minimum and maximum number of walls of a full circle.
#[cfg(feature = "dxf")]
const CIRCLE_WALLS: (f64, f64) = (12.0, 360.0);

/// Corners along a circular arc from `from` (exclusive) by an angle about a centre, radians,
/// counter-clockwise.
#[cfg(feature = "dxf")]
pub(crate) fn arc(center: DVec2, from: DVec2, turn_rad: f64) -> impl Iterator<Item = DVec2> {
    let radius = from - center;
    let (min, max) = CIRCLE_WALLS;
    let step_rad = 2.0 * (1.0 - MAX_CURVE_ERROR_M / radius.length().max(MAX_CURVE_ERROR_M)).acos();
    let parts = turn_rad.abs() * (1.0 / step_rad).clamp(min / (2.0 * PI), max / (2.0 * PI));
    let parts = parts.ceil().max(1.0) as usize;
    (1..=parts).map(move |part| {
        center + DVec2::from_angle(turn_rad * part as f64 / parts as f64).rotate(radius)
    })
}

#[cfg(all(test, feature = "dxf"))]
mod tests {
    use super::*;

    #[test]
    fn arc_is_approximated() {
        let center = DVec2::new(1.0, 2.0);
        for (radius_m, turn_rad) in [(0.05, 6.0), (1.0, -1.5), (8.0, 0.01), (500.0, 3.0)] {
            let from = center + DVec2::new(radius_m, 0.0);
            let corners: Vec<DVec2> =
                std::iter::once(from).chain(arc(center, from, turn_rad)).collect();
            let end = center + radius_m * DVec2::from_angle(turn_rad);
            assert!(corners[corners.len() - 1].distance(end) < 1e-9);
            assert!((2..=362).contains(&corners.len()), "{radius_m}: {}", corners.len());
            for ends in corners.windows(2) {
                let sag_m = radius_m - center.distance(ends[0].midpoint(ends[1]));
                // The walls of a large arc are at least a degree long.
                let max_m = MAX_CURVE_ERROR_M.max(radius_m * (1.0 - (PI / 360.0).cos()));
                assert!(sag_m < 1.01 * max_m, "{radius_m}: {sag_m}");
            }
        }
    }
}

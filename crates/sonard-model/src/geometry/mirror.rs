//! Reflection of points and directions at a line.

use super::DVec2;

/// Mirror line for points and directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mirror {
    /// Unit normal of the line.
    pub normal: DVec2,
    /// Dot product `normal . p` of any point `p` on the line, metres.
    pub offset_m: f64,
}

impl Mirror {
    /// Creates the line through two different points.
    #[must_use]
    pub fn through(a: DVec2, b: DVec2) -> Self {
        let normal = (b - a).perp().normalize();
        // Uses the midpoint, so that rounding favours neither end.
        Self { normal, offset_m: normal.dot(0.5 * (a + b)) }
    }

    /// Signed distance of a point from the line, positive on the side of the normal, metres.
    #[must_use]
    pub fn signed_distance_m(&self, point: DVec2) -> f64 {
        self.normal.dot(point) - self.offset_m
    }

    /// Mirror image of a point.
    #[must_use]
    pub fn image(&self, point: DVec2) -> DVec2 {
        point - 2.0 * self.signed_distance_m(point) * self.normal
    }

    /// Mirror image of a direction.
    #[must_use]
    pub fn image_of_direction(&self, direction: DVec2) -> DVec2 {
        direction - 2.0 * self.normal.dot(direction) * self.normal
    }

    /// Unit complex number `u` such that the image of a direction `d` is `u conj(d)`.
    #[must_use]
    pub fn rotor(&self) -> DVec2 {
        let along = self.normal.perp();
        along.rotate(along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn image_is_an_involution() {
        let (a, b) = (DVec2::new(0.3, -1.0), DVec2::new(2.0, 0.7));
        let mirror = Mirror::through(a, b);
        let point = DVec2::new(-0.4, 5.0);
        assert!((mirror.image(mirror.image(point)) - point).length() < 1e-14);
        assert!((mirror.image(b) - b).length() < 1e-14);
        assert!((mirror.image(point) - point).dot(b - a).abs() < 1e-13);
    }

    #[test]
    fn rotor_matches_reflection() {
        let mirror = Mirror::through(DVec2::ZERO, DVec2::new(1.0, 3.0));
        let direction = DVec2::from_angle(0.4);
        let conjugate = DVec2::new(direction.x, -direction.y);
        assert!(
            (mirror.rotor().rotate(conjugate) - mirror.image_of_direction(direction)).length()
                < 1e-15
        );
    }
}

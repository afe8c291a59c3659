//! Beams, rays, and the geometry of a reflected beam.

use crate::{
    geometry::{DVec2, Mirror},
    model::paths::tolerance::TIE_M,
};

/// All rays from an image of the start between two directions, in one triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayBeam {
    /// Mirror image of the start.
    pub(crate) image: DVec2,
    /// Clockwise border, any length.
    pub(crate) right: DVec2,
    /// Counter-clockwise border, any length.
    pub(crate) left: DVec2,
    /// Rotation back to the start's own frame, together with `mirrored`; see
    /// [`RayBeam::departure`].
    pub(crate) turn: DVec2,
    /// Product of the reflectances.
    pub(crate) gain: f64,
    /// Length beyond which paths are too weak, metres.
    pub(crate) detectable_m: f64,
    /// Node of the last reflection, for [`super::Beams::walls_back`].
    pub(crate) node: u32,
    pub(crate) triangle: u32,
    /// Side through which the beam entered the triangle.
    pub(crate) side: u8,
    /// `true` after an odd number of reflections.
    pub(crate) mirrored: bool,
    /// `true` if rays at the transducer's own height, which do not climb, reach this triangle.
    pub(crate) is_level: bool,
    pub(crate) order: u16,
    /// Possible slopes of the rays, by number in [`super::Beams::slopes`].
    pub(crate) slopes: u32,
}

/// A path by mirror reflections, unfolded: a straight ray from an image of the start.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UnfoldedRay {
    /// Vector from the image to the end, metres.
    pub(crate) run: DVec2,
    /// Unit vector of departure.
    pub(crate) departure: DVec2,
    pub(crate) gain: f64,
    pub(crate) node: u32,
    pub(crate) order: u16,
    /// Possible slopes; see [`RayBeam::slopes`].
    pub(crate) slopes: u32,
}

/// Minimal description of a ray from the start, from which its walls are reconstructed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayLeg {
    pub(crate) node: u32,
    pub(crate) run: DVec2,
}

impl From<&UnfoldedRay> for RayLeg {
    fn from(ray: &UnfoldedRay) -> Self {
        Self { node: ray.node, run: ray.run }
    }
}

impl RayBeam {
    /// Direction in which a ray left the start that now runs along `direction`.
    pub(crate) fn departure(&self, direction: DVec2) -> DVec2 {
        let direction =
            if self.mirrored { DVec2::new(direction.x, -direction.y) } else { direction };
        self.turn.rotate(direction)
    }

    /// Returns the beam behind a mirror: geometry only, without gain and node.
    pub(crate) fn reflected(&self, mirror: &Mirror, rotor: DVec2) -> Self {
        Self {
            image: mirror.image(self.image),
            right: mirror.image_of_direction(self.left),
            left: mirror.image_of_direction(self.right),
            turn: self.departure(rotor),
            mirrored: !self.mirrored,
            order: self.order + 1,
            ..*self
        }
    }

    /// Returns the ray of this beam to a point.
    pub(crate) fn ray_to(&self, point: DVec2) -> UnfoldedRay {
        let run = point - self.image;
        UnfoldedRay {
            run,
            departure: self.departure(run.normalize_or_zero()),
            gain: self.gain,
            node: self.node,
            order: self.order,
            slopes: self.slopes,
        }
    }

    /// Returns `true` if the ray towards `run` is in the beam, borders included. A beam without
    /// borders is the initial one, which covers all directions.
    pub(crate) fn holds(&self, run: DVec2) -> bool {
        if self.right == DVec2::ZERO {
            return true;
        }
        // Within less than half a turn a ray is less than a right angle from the nearer border.
        // Each border is tested separately: in a sum the longer one would decide.
        let is_ahead = run.dot(self.right) > 0.0 || run.dot(self.left) > 0.0;
        is_ahead && reaches(self.right, run) && reaches(run, self.left)
    }

    /// Merges the neighbouring beam `next`, which left the start counter-clockwise of this one, if
    /// it has reached the same image through the same side. Returns `false` if the beams differ.
    pub(crate) fn merge(&mut self, next: &Self) -> bool {
        let same = self.triangle == next.triangle
            && self.side == next.side
            && self.is_level == next.is_level
            && self.image.distance_squared(next.image) < TIE_M * TIE_M
            && (self.gain - next.gain).abs() <= 1e-12 * self.gain;
        if !same {
            return false;
        }
        let (mine, others) =
            if self.mirrored { (self.right, next.left) } else { (self.left, next.right) };
        if !(reaches(mine, others) && reaches(others, mine) && mine.dot(others) > 0.0) {
            return false;
        }
        if self.mirrored {
            self.right = next.right;
        } else {
            self.left = next.left;
        }
        true
    }
}

/// Returns `true` if `v` is counter-clockwise of the ray along `border`, or its end within
/// [`TIE_M`] of that ray.
pub(crate) fn reaches(border: DVec2, v: DVec2) -> bool {
    let cross = border.perp_dot(v);
    // |cross| / |border| is the distance; with the shorter of the two no third case is needed.
    cross >= 0.0 || cross * cross <= TIE_M * TIE_M * border.length_squared().min(v.length_squared())
}

/// Returns `true` if `v` is counter-clockwise of the ray along `border` by more than [`TIE_M`].
pub(crate) fn reaches_well(border: DVec2, v: DVec2) -> bool {
    !reaches(v, border)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beam(right: f64, left: f64) -> RayBeam {
        let turn = |deg: f64| 2.0 * DVec2::from_angle(deg.to_radians());
        RayBeam {
            image: DVec2::new(1.0, 2.0),
            right: turn(right),
            left: turn(left),
            turn: DVec2::X,
            gain: 0.8,
            detectable_m: 10.0,
            node: 0,
            triangle: 3,
            side: 1,
            mirrored: false,
            is_level: true,
            order: 1,
            slopes: 0,
        }
    }

    #[test]
    fn adjacent_beams_merge() {
        let mut first = beam(10.0, 30.0);
        assert!(first.merge(&beam(30.0, 45.0)));
        assert_eq!((first.right, first.left), (beam(10.0, 45.0).right, beam(10.0, 45.0).left));
        // In a mirror the next beam counter-clockwise lies clockwise.
        let mirrored = |right, left| RayBeam { mirrored: true, ..beam(right, left) };
        let mut first = mirrored(30.0, 45.0);
        assert!(first.merge(&mirrored(10.0, 30.0)));
        assert_eq!((first.right, first.left), (beam(10.0, 45.0).right, beam(10.0, 45.0).left));
    }

    #[test]
    fn different_beams_stay_apart() {
        let next = beam(30.0, 45.0);
        for other in [
            beam(31.0, 45.0),
            beam(210.0, 225.0),
            RayBeam { gain: 0.81, ..next },
            RayBeam { gain: 0.4, ..next },
            RayBeam { triangle: 4, ..next },
            RayBeam { side: 2, ..next },
            RayBeam { is_level: false, ..next },
            RayBeam { image: DVec2::new(1.0, 2.001), ..next },
        ] {
            let mut first = beam(10.0, 30.0);
            assert!(!first.merge(&other), "{other:?}");
            assert_eq!(first.left, beam(10.0, 30.0).left);
        }
    }

    #[test]
    fn reflection_keeps_departure() {
        let mirror = Mirror { normal: DVec2::X, offset_m: 4.0 };
        // Reflected at x = 4, a ray's angle is subtracted from half a turn.
        let rotor = DVec2::from_angle(std::f64::consts::PI);
        let behind = beam(10.0, 30.0).reflected(&mirror, rotor);
        assert_eq!((behind.image, behind.order, behind.mirrored), (DVec2::new(7.0, 2.0), 2, true));
        let off = |a: DVec2, deg: f64| a.distance(2.0 * DVec2::from_angle(deg.to_radians()));
        assert!(off(behind.right, 150.0) < 1e-12 && off(behind.left, 170.0) < 1e-12, "{behind:?}");
        let left = behind.departure(DVec2::from_angle(160_f64.to_radians()));
        assert!(left.distance(DVec2::from_angle(20_f64.to_radians())) < 1e-12, "{left}");
        for (deg, inside) in
            [(149.0, false), (151.0, true), (169.0, true), (171.0, false), (340.0, false)]
        {
            assert_eq!(behind.holds(DVec2::from_angle(f64::to_radians(deg))), inside, "{deg}");
        }
    }
}

//! Beams and rays.

use crate::{
    geometry::{DVec2, Mirror},
    model::paths::tolerance::TIE_M,
};

/// All rays from an image of the start between two directions, in one triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beam {
    /// Mirror image of the start.
    pub(crate) image: DVec2,
    /// Its clockwise border, any length.
    pub(crate) right: DVec2,
    /// Its counter-clockwise border, any length.
    pub(crate) left: DVec2,
    /// With `mirrored`, the rotation back to the start's own frame: see [`Beam::departure`].
    pub(crate) turn: DVec2,
    /// Product of the reflectances.
    pub(crate) gain: f64,
    /// Paths longer than this are too weak, metres.
    pub(crate) audible_m: f64,
    /// The node of its last reflection, for [`super::Beams::walls_back`].
    pub(crate) node: u32,
    pub(crate) triangle: u32,
    /// The side it came in by.
    pub(crate) side: u8,
    /// Whether it was reflected an odd number of times.
    pub(crate) mirrored: bool,
    /// Whether rays at the transducer's own height, which do not climb, come so far.
    pub(crate) is_level: bool,
    pub(crate) order: u16,
    /// How steeply its rays can climb, by number in [`super::Beams::slopes`].
    pub(crate) slopes: u32,
}

/// A path by mirror reflections, unfolded: a straight ray from an image of the start.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    /// From the image to the end, metres.
    pub(crate) run: DVec2,
    /// Unit vector in which it leaves.
    pub(crate) departure: DVec2,
    pub(crate) gain: f64,
    pub(crate) node: u32,
    pub(crate) order: u16,
    /// See [`Beam::slopes`].
    pub(crate) slopes: u32,
}

/// A ray from the start by what its walls follow from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leg {
    pub(crate) node: u32,
    pub(crate) run: DVec2,
}

impl From<&Ray> for Leg {
    fn from(ray: &Ray) -> Self {
        Self { node: ray.node, run: ray.run }
    }
}

impl Beam {
    /// The direction in which a ray left that now runs along `direction`.
    pub(crate) fn departure(&self, direction: DVec2) -> DVec2 {
        let direction =
            if self.mirrored { DVec2::new(direction.x, -direction.y) } else { direction };
        self.turn.rotate(direction)
    }

    /// The beam behind a mirror, as far as geometry goes.
    pub(crate) fn reflected(&self, mirror: &Mirror, rotor: DVec2) -> Self {
        Self {
            image: mirror.image(self.image),
            right: mirror.turn(self.left),
            left: mirror.turn(self.right),
            turn: self.departure(rotor),
            mirrored: !self.mirrored,
            order: self.order + 1,
            ..*self
        }
    }

    /// The ray of this beam to a point.
    pub(crate) fn ray_to(&self, point: DVec2) -> Ray {
        let run = point - self.image;
        Ray {
            run,
            departure: self.departure(run.normalize_or_zero()),
            gain: self.gain,
            node: self.node,
            order: self.order,
            slopes: self.slopes,
        }
    }

    /// Whether the ray towards `run` is in the beam, borders included. A beam without borders is
    /// the one that starts in all directions.
    pub(crate) fn holds(&self, run: DVec2) -> bool {
        if self.right == DVec2::ZERO {
            return true;
        }
        // Within less than half a turn a ray is less than a right angle from the nearer border. Each is asked by
        // itself: of a sum the longer one would decide.
        let is_ahead = run.dot(self.right) > 0.0 || run.dot(self.left) > 0.0;
        is_ahead && reaches(self.right, run) && reaches(run, self.left)
    }

    /// Merges a beam that leaves the start beside this one (`next` is counter-clockwise of it there)
    /// and has come to the same image through the same side; false if it is not so.
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

/// Whether `v` is counter-clockwise of the ray along `border`, or its end within [`TIE_M`] of it.
pub(crate) fn reaches(border: DVec2, v: DVec2) -> bool {
    let cross = border.perp_dot(v);
    // |cross| / |border| is the distance; with the shorter of the two it needs no third case.
    cross >= 0.0 || cross * cross <= TIE_M * TIE_M * border.length_squared().min(v.length_squared())
}

/// Whether `v` is counter-clockwise of the ray along `border` by more than [`TIE_M`].
pub(crate) fn reaches_well(border: DVec2, v: DVec2) -> bool {
    !reaches(v, border)
}

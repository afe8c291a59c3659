//! Beams and rays.

use crate::geometry::{DVec2, Mirror};

/// Rays this close to a corner pass through it, metres: on either side of it and over it. Above
/// rounding (1e-14 over tens of metres), below anything that sound could tell.
pub(super) const TIE_M: f64 = 1e-9;

/// All rays from an image of the start between two directions, in one triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beam {
    /// Mirror image of the start.
    pub(super) image: DVec2,
    /// Its clockwise border, any length.
    pub(super) right: DVec2,
    /// Its counter-clockwise border, any length.
    pub(super) left: DVec2,
    /// With `mirrored`, the way back to the start's own frame: see [`Beam::departure`].
    pub(super) turn: DVec2,
    /// Product of the reflectances.
    pub(super) gain: f64,
    /// Paths longer than this are too weak, metres.
    pub(super) audible_m: f64,
    /// Where it was reflected last, for [`super::trace::Tree::walls_back`].
    pub(super) node: u32,
    pub(super) triangle: u32,
    /// The side it came in by.
    pub(super) side: u8,
    /// Whether it was reflected an odd number of times.
    pub(super) mirrored: bool,
    pub(super) order: u16,
}

/// One way by mirror reflections, unfolded: a straight ray from an image of the start.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    /// From the image to the end, metres.
    pub(super) run: DVec2,
    /// Unit vector in which it leaves.
    pub(super) departure: DVec2,
    pub(super) gain: f64,
    pub(super) node: u32,
    pub(super) order: u16,
}

impl Beam {
    /// The direction in which a ray left that now runs along `direction`.
    pub(super) fn departure(&self, direction: DVec2) -> DVec2 {
        let direction =
            if self.mirrored { DVec2::new(direction.x, -direction.y) } else { direction };
        self.turn.rotate(direction)
    }

    /// The beam behind a mirror, as far as geometry goes.
    pub(super) fn reflected(&self, mirror: &Mirror, rotor: DVec2) -> Self {
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
    pub(super) fn ray_to(&self, point: DVec2) -> Ray {
        let run = point - self.image;
        Ray {
            run,
            departure: self.departure(run.normalize_or_zero()),
            gain: self.gain,
            node: self.node,
            order: self.order,
        }
    }

    /// Whether the ray towards `run` is in the beam, borders included. A beam without borders is
    /// the one that starts in all directions.
    pub(super) fn holds(&self, run: DVec2) -> bool {
        if self.right == DVec2::ZERO {
            return true;
        }
        reaches(self.right, run) && reaches(run, self.left) && run.dot(self.right + self.left) > 0.0
    }

    /// Joins a beam that leaves the start beside this one (`next` is counter-clockwise of it there)
    /// and has come to the same image through the same side; false if it is not so.
    pub(super) fn join(&mut self, next: &Self) -> bool {
        let same = self.triangle == next.triangle
            && self.side == next.side
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
pub(super) fn reaches(border: DVec2, v: DVec2) -> bool {
    let cross = border.perp_dot(v);
    // |cross| / |border| is the distance; with the shorter of the two it needs no third case.
    cross >= 0.0 || cross * cross <= TIE_M * TIE_M * border.length_squared().min(v.length_squared())
}

/// Whether `v` is counter-clockwise of the ray along `border` by more than [`TIE_M`].
pub(super) fn reaches_well(border: DVec2, v: DVec2) -> bool {
    !reaches(v, border)
}

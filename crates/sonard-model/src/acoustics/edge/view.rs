//! An edge seen from points beside one another.

use num_complex::Complex64;

use super::{Aspect, Wedge};

/// The change of an edge's echo across a face that is not small beside the boundaries of light.
///
/// Where a wall ends less than the face's width off the foot of the perpendicular, some points of the face
/// see a mirrored echo of others and some do not. The mirrored echo is taken as it is between the
/// middles; what is missing or too much of it is the edge's, whose coefficient then runs on over the
/// boundary without a jump. By Kouyoumjian and Pathak's coefficient alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeView {
    /// The air around the edge.
    pub wedge: Wedge,
    /// From the middle of the face and back to it.
    pub aspect: Aspect,
    /// Wave number `2 pi f / c`, radians a metre.
    pub wave_number_per_m: f64,
    /// From the face to the edge and from the edge to the face, metres.
    pub legs_m: [f64; 2],
    /// Whether mirrors on either leg swap left and right.
    pub swapped: [bool; 2],
}

impl EdgeView {
    /// Field beside that from middle to middle, without the difference of the paths' lengths: from a point
    /// of the face so many metres to the left, as one looks to where the sound goes, back to one so many
    /// to the left, as one looks to where it comes from.
    pub fn shares(&self) -> impl Fn(f64, f64) -> Complex64 + use<> {
        let view = *self;
        let field =
            move |aspect: &Aspect| view.wedge.uniform(aspect, &view.aspect, view.wave_number_per_m);
        let middle = field(&view.aspect);
        move |sent_m, heard_m| {
            if middle == Complex64::ZERO {
                return Complex64::ONE;
            }
            field(&view.aspect_from(sent_m, heard_m)) / middle
        }
    }

    /// By how much longer the paths are, metres, to second order: what distance adds to the slant.
    #[must_use]
    pub fn bend_m(&self, sent_m: f64, heard_m: f64) -> f64 {
        let [out_m, back_m] = self.legs_m;
        sent_m * sent_m / (2.0 * out_m) + heard_m * heard_m / (2.0 * back_m)
    }

    /// As the edge is seen from two such points, at the same distance parameter.
    pub(super) fn aspect_from(&self, sent_m: f64, heard_m: f64) -> Aspect {
        Aspect {
            in_rad: self.seen_rad(self.aspect.in_rad, 0, sent_m),
            out_rad: self.seen_rad(self.aspect.out_rad, 1, heard_m),
            ..self.aspect
        }
    }

    /// The direction in which a point to the left of the face's middle is seen from the edge, at the end of a leg.
    fn seen_rad(&self, middle_rad: f64, leg: usize, left_m: f64) -> f64 {
        let turn_rad = left_m / self.legs_m[leg];
        let seen_rad =
            if self.swapped[leg] { middle_rad + turn_rad } else { middle_rad - turn_rad };
        seen_rad.clamp(0.0, self.wedge.opening_rad)
    }
}

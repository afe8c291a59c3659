//! Variation of an edge's echo across the transducer's face.

use num_complex::Complex64;

use super::{Aspect, LitImages, Wedge};

/// Edge echo as a function of position on a face that is not small compared with the boundary
/// regions.
///
/// Where a wall ends within the face's width of the foot of the perpendicular, the mirror echo is
/// visible from some points of the face and not from others. The mirror echo is evaluated between
/// the middles of the face. The difference is attributed to the edge, whose coefficient is
/// continued across the boundary without a jump. Uses Kouyoumjian and Pathak's coefficient only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeView {
    /// Wedge of air around the edge.
    pub wedge: Wedge,
    /// Aspect from the middle of the face and back.
    pub aspect: Aspect,
    /// Images that are visible from the middle of the face.
    pub lit: LitImages,
    /// Wave number `2 pi f / c`, radians per metre.
    pub wave_number_per_m: f64,
    /// Distances from the face to the edge and from the edge to the face, metres.
    pub legs_m: [f64; 2],
    /// Left and right are swapped by mirrors on either leg.
    pub swapped: [bool; 2],
}

impl EdgeView {
    /// Field relative to that from middle to middle, without the phase of the path difference. The
    /// arguments are the points of departure and arrival on the face, metres to the left when
    /// facing the direction of departure and of arrival.
    pub fn relative_field(&self) -> impl Fn(f64, f64) -> Complex64 + use<> {
        let view = *self;
        let field = move |aspect: &Aspect| {
            view.wedge.uniform(aspect, &view.aspect, view.lit, view.wave_number_per_m)
        };
        let middle = field(&view.aspect);
        move |sent_m, received_m| {
            if middle == Complex64::ZERO {
                return Complex64::ONE;
            }
            field(&view.aspect_from(sent_m, received_m)) / middle
        }
    }

    /// Path excess due to wavefront curvature, metres, to second order.
    #[must_use]
    pub fn curvature_m(&self, sent_m: f64, received_m: f64) -> f64 {
        let [out_m, back_m] = self.legs_m;
        sent_m * sent_m / (2.0 * out_m) + received_m * received_m / (2.0 * back_m)
    }

    /// Aspect of the edge from two such points, at the same distance parameter.
    pub(super) fn aspect_from(&self, sent_m: f64, received_m: f64) -> Aspect {
        Aspect {
            in_rad: self.direction_rad(self.aspect.in_rad, 0, sent_m),
            out_rad: self.direction_rad(self.aspect.out_rad, 1, received_m),
            ..self.aspect
        }
    }

    /// Direction from the edge to a point left of the face's middle, at the end of a leg.
    fn direction_rad(&self, middle_rad: f64, leg: usize, left_m: f64) -> f64 {
        let turn_rad = left_m / self.legs_m[leg];
        let direction_rad =
            if self.swapped[leg] { middle_rad + turn_rad } else { middle_rad - turn_rad };
        direction_rad.clamp(0.0, self.wedge.opening_rad)
    }
}

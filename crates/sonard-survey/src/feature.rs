//! Virtual features: mirror images of walls, corners and edges.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};
use sonard_model::geometry::{DVec2, Pose};

use crate::arc::Arc;

/// Mirror image of a part of a room, as the readings of one path determine it.
///
/// Mirrors `m1..mk` of a path compose to an isometry `M` of the plane, and the path from `p` back
/// to `p` has the range `|p - M p| / 2`. An odd number of mirrors gives a reflection or a glide
/// reflection, whose axis is a line; an even number gives a rotation about a point. So an echo of
/// any order is a landmark, without knowledge of its path.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VirtualFeature {
    /// Axis of a (glide) reflection, such as a wall or its image: `n . x = distance_m` with
    /// `n = (cos normal_rad, sin normal_rad)`.
    Line {
        /// Direction of the normal, radians.
        normal_rad: f64,
        /// Signed distance of the origin, metres.
        distance_m: f64,
        /// Displacement along the axis, metres; 0 for a reflection.
        glide_m: f64,
    },
    /// Centre of a rotation, such as a square corner or its image, or an edge.
    Point {
        /// Position, metres.
        position: DVec2,
        /// Sine of half the angle of rotation, which scales ranges; 1 for a half turn.
        sine: f64,
    },
}

/// Kind of a virtual feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FeatureKind {
    Line,
    Point,
}

impl VirtualFeature {
    /// Reflection axis of a normal direction in radians and a distance in metres.
    pub(crate) const fn line(normal_rad: f64, distance_m: f64) -> Self {
        Self::Line { normal_rad, distance_m, glide_m: 0.0 }
    }

    /// Centre of a half turn.
    pub(crate) const fn point(position: DVec2) -> Self {
        Self::Point { position, sine: 1.0 }
    }

    /// Feature of the composition of mirrors, each a line `n . x = d` given by the direction of its
    /// normal in radians and its distance in metres; `None` for a translation, which is independent
    /// of the position.
    #[must_use]
    pub fn from_mirrors(mirrors: &[(f64, f64)]) -> Option<Self> {
        const MIN_TURN_RAD: f64 = 1e-9;
        let image = |point: DVec2| {
            mirrors.iter().fold(point, |point, &(normal_rad, distance_m)| {
                let normal = DVec2::from_angle(normal_rad);
                point + 2.0 * (distance_m - normal.dot(point)) * normal
            })
        };
        let (origin, along) = (image(DVec2::ZERO), image(DVec2::X) - image(DVec2::ZERO));
        let turn_rad = along.to_angle();
        if mirrors.len() % 2 == 1 {
            let normal_rad = 0.5 * (turn_rad + PI);
            let normal = DVec2::from_angle(normal_rad);
            let glide_m = normal.perp().dot(origin).abs();
            return Some(Self::Line { normal_rad, distance_m: 0.5 * normal.dot(origin), glide_m });
        }
        let sine = (0.5 * turn_rad).sin().abs();
        // The centre c is fixed: c = origin + R c.
        let cotangent = 1.0 / (0.5 * turn_rad).tan();
        let position = 0.5 * (origin + cotangent * origin.perp());
        (sine > MIN_TURN_RAD).then_some(Self::Point { position, sine })
    }

    /// Line and point that one arc suggests: both explain it, and a second place decides.
    pub(crate) fn of_arc(arc: &Arc, pose: &Pose) -> [Self; 2] {
        let normal_rad = pose.direction_rad(arc.azimuth_deg);
        let position = arc.point_at(pose, arc.range_m);
        [Self::line(normal_rad, position.dot(DVec2::from_angle(normal_rad))), Self::point(position)]
    }

    pub(crate) const fn kind(&self) -> FeatureKind {
        match self {
            Self::Line { .. } => FeatureKind::Line,
            Self::Point { .. } => FeatureKind::Point,
        }
    }

    /// Range, metres, and world bearing, radians, of the feature from a place.
    #[must_use]
    pub fn predict(&self, from: DVec2) -> (f64, f64) {
        match *self {
            Self::Line { normal_rad, distance_m, glide_m } => {
                let ahead_m = distance_m - from.dot(DVec2::from_angle(normal_rad));
                let bearing_rad = if ahead_m < 0.0 { normal_rad + PI } else { normal_rad };
                (ahead_m.hypot(0.5 * glide_m), bearing_rad)
            }
            Self::Point { position, sine } => {
                let toward = position - from;
                (sine * toward.length(), toward.to_angle())
            }
        }
    }

    /// Derivatives of range and bearing by the two numbers of the feature (normal direction and
    /// distance, or x and y), and by the place, for a plain line or point.
    pub(crate) fn derivatives(&self, from: DVec2) -> FeatureDerivatives {
        match *self {
            Self::Line { normal_rad, distance_m, .. } => {
                let normal = DVec2::from_angle(normal_rad);
                let ahead_m = distance_m - from.dot(normal);
                let sign = if ahead_m < 0.0 { -1.0 } else { 1.0 };
                FeatureDerivatives {
                    range_by_feature: [-sign * from.dot(normal.perp()), sign],
                    range_by_place: -sign * normal,
                    bearing_by_feature: [1.0, 0.0],
                    bearing_by_place: DVec2::ZERO,
                }
            }
            Self::Point { position, .. } => {
                let toward = position - from;
                let range_m = toward.length().max(1e-6);
                let unit = toward / range_m;
                let across = unit.perp() / range_m;
                FeatureDerivatives {
                    range_by_feature: unit.to_array(),
                    range_by_place: -unit,
                    bearing_by_feature: across.to_array(),
                    bearing_by_place: -across,
                }
            }
        }
    }

    /// Feature after a change of its two numbers.
    pub(crate) fn moved(&self, by: [f64; 2]) -> Self {
        match *self {
            Self::Line { normal_rad, distance_m, glide_m } => Self::Line {
                normal_rad: normal_rad + by[0],
                distance_m: distance_m + by[1],
                glide_m,
            },
            Self::Point { position, sine } => {
                Self::Point { position: position + DVec2::from_array(by), sine }
            }
        }
    }
}

/// Derivatives of range (metres) and bearing (radians) of a feature.
pub(crate) struct FeatureDerivatives {
    pub(crate) range_by_feature: [f64; 2],
    pub(crate) range_by_place: DVec2,
    pub(crate) bearing_by_feature: [f64; 2],
    pub(crate) bearing_by_place: DVec2,
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    const FROM: DVec2 = DVec2::new(0.4, -0.3);

    fn range_by_images(mirrors: &[(f64, f64)]) -> f64 {
        let image = mirrors.iter().fold(FROM, |point, &(normal_rad, distance_m)| {
            let normal = DVec2::from_angle(normal_rad);
            point + 2.0 * (distance_m - normal.dot(point)) * normal
        });
        0.5 * image.distance(FROM)
    }

    #[test]
    fn wall_in_a_wall_is_its_mirror_image() {
        // Walls x = 2 and y = 1.5 with y = 1.5 on both sides of x = 2: the line y = 1.5 again.
        let [a, b] = [(0.0, 2.0), (0.7, 1.9)];
        let feature = VirtualFeature::from_mirrors(&[a, b, a]).expect("a line");
        // The normal of b mirrored in x = 2, through a mirrored point of b.
        let VirtualFeature::Line { normal_rad, distance_m, glide_m } = feature else {
            panic!("{feature:?}")
        };
        let normal = DVec2::from_angle(normal_rad);
        let on_b = 1.9 * DVec2::from_angle(0.7);
        let image = DVec2::new(4.0 - on_b.x, on_b.y);
        assert!((normal.dot(image) - distance_m).abs() < 1e-12, "{feature:?}");
        let expected = DVec2::from_angle(PI - 0.7);
        assert!(normal.perp_dot(expected).abs() < 1e-12 && glide_m.abs() < 1e-12, "{feature:?}");
    }

    #[test]
    fn square_corner_is_a_point() {
        let feature = VirtualFeature::from_mirrors(&[(0.0, 2.0), (FRAC_PI_2, 1.5)]);
        let Some(VirtualFeature::Point { position, sine }) = feature else { panic!("{feature:?}") };
        assert!(position.distance(DVec2::new(2.0, 1.5)) < 1e-12, "{position}");
        assert!((sine - 1.0).abs() < 1e-12);
        let parallel = VirtualFeature::from_mirrors(&[(0.0, 2.0), (0.0, -1.0)]);
        assert_eq!(parallel, None);
    }

    #[test]
    fn ranges_are_those_of_the_image_of_the_place() {
        let mirrors = [(0.1, 2.0), (1.6, 1.5), (3.0, 1.2), (-1.7, 0.8)];
        for count in 1..=4 {
            let feature = VirtualFeature::from_mirrors(&mirrors[..count]).expect("no translation");
            let (range_m, _) = feature.predict(FROM);
            assert!((range_m - range_by_images(&mirrors[..count])).abs() < 1e-12, "{feature:?}");
        }
    }

    #[test]
    fn derivatives_are_differences() {
        let features =
            [VirtualFeature::line(0.6, 1.4), VirtualFeature::point(DVec2::new(1.5, 0.9))];
        for feature in features {
            let rates = feature.derivatives(FROM);
            let step = 1e-6;
            let (range_m, bearing_rad) = feature.predict(FROM);
            for at in 0..2 {
                let mut by = [0.0; 2];
                by[at] = step;
                let place = FROM + DVec2::from_array(by);
                let (moved_m, turned_rad) = feature.moved(by).predict(FROM);
                let (from_m, from_rad) = feature.predict(place);
                let close = |found: f64, by: f64| (found - by / step).abs() < 1e-5;
                assert!(close(rates.range_by_feature[at], moved_m - range_m), "{feature:?}");
                assert!(close(rates.bearing_by_feature[at], turned_rad - bearing_rad));
                assert!(close(rates.range_by_place[at], from_m - range_m));
                assert!(close(rates.bearing_by_place[at], from_rad - bearing_rad));
            }
        }
    }
}

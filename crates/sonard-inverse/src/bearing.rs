//! Derivatives of the departure and arrival directions of a path.

use smallvec::SmallVec;
use sonard_model::{
    geometry::DVec2,
    model::{Diffractor, Mechanism, Path, Reflector},
    scene::Scene,
};

use crate::motion::SceneMotion;

/// Curvature below which a point is not constrained, reciprocal metres.
const MIN_BEND: f64 = 1e-9;
/// Minimum distance of distinct points, metres; smaller for a transducer touching a wall.
const MIN_LEG_M: f64 = 1e-6;

/// Derivatives of a path's departure and arrival directions with respect to motion of its ends and
/// of the scene.
///
/// A path is stationary in its points (Fermat). A point on a wall or a cylinder moves along it by
/// `s` such that `dL/ds = t . (u_in - u_out)` stays zero: `H ds = -r`. Here `H` is the Hessian of
/// the length (tridiagonal, because a point has two neighbours), and `r` the change of `dL/ds` by
/// explicit motion. The direction at an end rotates by the transverse motion of the next point. `H`
/// is solved once for the two adjoint vectors, so each parameter costs only a sum over the moved
/// points. Floor and ceiling don't bend a path in the plan. Tests verify finite differences to
/// 1e-4.
pub(crate) struct Bearing {
    points: SmallVec<[PathVertex; 4]>,
    legs: SmallVec<[PathLeg; 5]>,
}

/// Interaction point of a path, in the plan.
struct PathVertex {
    mechanism: Mechanism,
    at: DVec2,
    /// Tangent of the surface, if the point can slide along it.
    along: Option<DVec2>,
    /// Adjoints: derivatives of the departure and arrival directions with respect to `-dL/ds`.
    adjoint: DVec2,
}

/// Leg of a path between neighbouring points, or between a point and an end.
#[derive(Clone, Copy)]
struct PathLeg {
    unit: DVec2,
    length_m: f64,
}

impl PathLeg {
    fn new(from: DVec2, to: DVec2) -> Self {
        let length_m = from.distance(to).max(MIN_LEG_M);
        Self { unit: (to - from) / length_m, length_m }
    }

    /// Change of the unit vector for a relative displacement of the ends.
    fn turn(&self, by: DVec2) -> DVec2 {
        (by - self.unit.dot(by) * self.unit) / self.length_m
    }
}

impl Bearing {
    /// Prepares a path between transmitter and receiver; `None` if its points don't fix its
    /// directions.
    pub(crate) fn new(path: &Path, ends: [DVec2; 2], scene: &Scene) -> Option<Self> {
        let mut points: SmallVec<[PathVertex; 4]> = SmallVec::new();
        for interaction in path.interactions.iter() {
            let along = match interaction.mechanism {
                Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling) => continue,
                // The strip of a rough wall follows the beam, not the transducer.
                Mechanism::Scattering { .. } => return None,
                Mechanism::Reflection(Reflector::Wall(wall))
                | Mechanism::Diffraction(Diffractor::Level { wall, .. }) => {
                    let wall = scene.walls.get(wall as usize)?;
                    Some((wall.b - wall.a).normalize_or_zero())
                }
                Mechanism::Reflection(Reflector::Cylinder(cylinder)) => {
                    let center = scene.cylinders.get(cylinder as usize)?.center;
                    Some((interaction.point - center).normalize_or_zero().perp())
                }
                Mechanism::Diffraction(_) | Mechanism::Transducer => None,
            };
            points.push(PathVertex {
                mechanism: interaction.mechanism,
                at: interaction.point,
                along,
                adjoint: DVec2::ZERO,
            });
        }
        let places = || {
            let inner = points.iter().map(|point| point.at);
            std::iter::once(ends[0]).chain(inner).chain([ends[1]])
        };
        let legs =
            places().zip(places().skip(1)).map(|(from, to)| PathLeg::new(from, to)).collect();
        let mut bearing = Self { points, legs };
        bearing.solve(scene)?;
        Some(bearing)
    }

    /// Derivatives of the departure and arrival directions with respect to a parameter with the
    /// given motion, radians per unit.
    pub(crate) fn derivatives(&self, scene: &Scene, motion: &SceneMotion) -> [f64; 2] {
        let last = self.points.len() - 1;
        let velocity =
            |at: usize| motion.of_plan(scene, self.points[at].mechanism, self.points[at].at);
        let [leaves, comes] = self.across();
        let mut before = motion.transducer[0];
        let mut here = velocity(0);
        let mut rates = DVec2::new(leaves.dot(here - before), 0.0);
        for (at, point) in self.points.iter().enumerate() {
            let after = if at == last { motion.transducer[1] } else { velocity(at + 1) };
            if let Some(along) = point.along {
                let (there, on) = (&self.legs[at], &self.legs[at + 1]);
                let turned = there.turn(here - before) - on.turn(after - here);
                let slope = motion.turn_of(scene, point.mechanism) * along.perp();
                rates -= (along.dot(turned) + slope.dot(there.unit - on.unit)) * point.adjoint;
            }
            if at == last {
                rates.y += comes.dot(here - after);
            }
            (before, here) = (here, after);
        }
        rates.to_array()
    }

    /// Derivatives of the departure direction by the first point, and of the arrival direction by
    /// the last.
    fn across(&self) -> [DVec2; 2] {
        let [leaves, comes] = [self.legs[0], self.legs[self.legs.len() - 1]];
        // The arrival direction points back to the source, against the propagation.
        [leaves.unit.perp() / leaves.length_m, -comes.unit.perp() / comes.length_m]
    }

    /// Solves for the adjoints with the Thomas algorithm for tridiagonal matrices, with one right
    /// side per direction. Fixed points have an identity row.
    fn solve(&mut self, scene: &Scene) -> Option<()> {
        let last = self.points.len().checked_sub(1)?;
        let [leaves, comes] = self.across();
        // Per row: eliminated diagonal and right sides, and the coupling to the next row.
        let mut rows: SmallVec<[(f64, DVec2, f64); 4]> = SmallVec::new();
        for (at, point) in self.points.iter().enumerate() {
            let Some(along) = point.along else {
                rows.push((1.0, DVec2::ZERO, 0.0));
                continue;
            };
            let (there, on) = (&self.legs[at], &self.legs[at + 1]);
            let mut diagonal = along.dot(there.turn(along) + on.turn(along)) + self.bend(scene, at);
            let mut right = DVec2::ZERO;
            if at == 0 {
                right.x += along.dot(leaves);
            }
            if at == last {
                right.y += along.dot(comes);
            }
            let next = self.points.get(at + 1).and_then(|next| next.along);
            let beyond = next.map_or(0.0, |next| -along.dot(on.turn(next)));
            if let Some(&(pivot, before, coupled)) = rows.last() {
                diagonal -= coupled * coupled / pivot;
                right -= coupled / pivot * before;
            }
            if diagonal < MIN_BEND {
                return None;
            }
            rows.push((diagonal, right, beyond));
        }
        let mut after = DVec2::ZERO;
        for (point, (diagonal, right, beyond)) in self.points.iter_mut().zip(rows).rev() {
            after = (right - beyond * after) / diagonal;
            point.adjoint = after;
        }
        Some(())
    }

    /// Contribution of a curved surface to the second derivative of the length: on a circle a point
    /// leaves the tangent towards the centre.
    fn bend(&self, scene: &Scene, at: usize) -> f64 {
        let point = &self.points[at];
        let Mechanism::Reflection(Reflector::Cylinder(cylinder)) = point.mechanism else {
            return 0.0;
        };
        let Some(cylinder) = scene.cylinders.get(cylinder as usize) else { return 0.0 };
        let inwards = (cylinder.center - point.at).normalize_or_zero() / cylinder.radius_m;
        (self.legs[at].unit - self.legs[at + 1].unit).dot(inwards)
    }
}

//! How the directions in which a path leaves and comes back change where the world or the transducer moves.

use smallvec::SmallVec;
use sonard_model::{
    geometry::DVec2,
    model::{Diffractor, Mechanism, Path, Reflector},
    scene::Scene,
};

use crate::motion::Motion;

/// Below this much of a bend no point is held in its place, reciprocal metres.
const LEAST_BEND: f64 = 1e-9;
/// Points nearer than this are one, metres: a transducer that leans on a wall.
const LEAST_LEG_M: f64 = 1e-6;

/// What a path's two directions, of departure and of arrival, gain where its ends and what it meets move.
///
/// A path is stationary in its points (Fermat). One on a wall or a cylinder moves along it by `s`, by as much as
/// keeps `dL/ds = t . (u_in - u_out)` zero: `H ds = -r`, with the Hessian of the length by all points (tridiagonal, because a
/// point has two neighbours) and `r` what `dL/ds` gains by what moves explicitly. An end's direction turns by how far the
/// next point moves across it. So that each parameter costs a sum over what it moves, `H` is solved once, for the two
/// directions (their adjoints). Floor and ceiling bend no path in the plan. Held to finite differences in the tests, 1e-4.
pub(crate) struct Bearing {
    points: SmallVec<[Point; 4]>,
    legs: SmallVec<[Leg; 5]>,
}

/// Where a path meets something, in the plan.
struct Point {
    mechanism: Mechanism,
    at: DVec2,
    /// Along what it meets, if the path's point is free to move there.
    along: Option<DVec2>,
    /// What the directions of departure and of arrival gain with `-dL/ds` there.
    adjoint: DVec2,
}

/// From one point to the next, or from or to an end.
#[derive(Clone, Copy)]
struct Leg {
    unit: DVec2,
    length_m: f64,
}

impl Leg {
    fn new(from: DVec2, to: DVec2) -> Self {
        let length_m = from.distance(to).max(LEAST_LEG_M);
        Self { unit: (to - from) / length_m, length_m }
    }

    /// What its unit vector gains where its second end moves, less its first.
    fn turn(&self, by: DVec2) -> DVec2 {
        (by - self.unit.dot(by) * self.unit) / self.length_m
    }
}

impl Bearing {
    /// Of a path between transmitter and receiver; `None` if it has no direction that follows from what it meets.
    pub(crate) fn new(path: &Path, ends: [DVec2; 2], scene: &Scene) -> Option<Self> {
        let mut points: SmallVec<[Point; 4]> = SmallVec::new();
        for met in path.interactions.iter() {
            let along = match met.mechanism {
                Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling) => continue,
                // Which strip of a rough wall is heard follows from the beam, and not from where it is.
                Mechanism::Scattering { .. } => return None,
                Mechanism::Reflection(Reflector::Wall(wall))
                | Mechanism::Diffraction(Diffractor::Level { wall, .. }) => {
                    let wall = scene.walls.get(wall as usize)?;
                    Some((wall.b - wall.a).normalize_or_zero())
                }
                Mechanism::Reflection(Reflector::Cylinder(cylinder)) => {
                    let center = scene.cylinders.get(cylinder as usize)?.center;
                    Some((met.point - center).normalize_or_zero().perp())
                }
                Mechanism::Diffraction(_) | Mechanism::Transducer => None,
            };
            points.push(Point {
                mechanism: met.mechanism,
                at: met.point,
                along,
                adjoint: DVec2::ZERO,
            });
        }
        let places = || {
            let met = points.iter().map(|point| point.at);
            std::iter::once(ends[0]).chain(met).chain([ends[1]])
        };
        let legs = places().zip(places().skip(1)).map(|(from, to)| Leg::new(from, to)).collect();
        let mut bearing = Self { points, legs };
        bearing.solve(scene)?;
        Some(bearing)
    }

    /// What the directions of departure and of arrival gain for each unit of a parameter that moves scene and transducer
    /// so, radians.
    pub(crate) fn rates(&self, scene: &Scene, motion: &Motion) -> [f64; 2] {
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

    /// What the direction of departure gains where the first point moves, and that of arrival where the last one does.
    fn across(&self) -> [DVec2; 2] {
        let [leaves, comes] = [self.legs[0], self.legs[self.legs.len() - 1]];
        // An arrival's direction is told towards where the sound comes from, against its way.
        [leaves.unit.perp() / leaves.length_m, -comes.unit.perp() / comes.length_m]
    }

    /// Finds the adjoints: Gauss' elimination of a tridiagonal matrix (Thomas), with a right side for each direction, in
    /// which fixed points have a row of their own that says nothing.
    fn solve(&mut self, scene: &Scene) -> Option<()> {
        let last = self.points.len().checked_sub(1)?;
        let [leaves, comes] = self.across();
        // Of the row before: its diagonal and right sides, once those before it are eliminated, and what couples it.
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
            if diagonal < LEAST_BEND {
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

    /// What a curved surface adds to the second derivative of the length: by the arc of a circle a point leaves its tangent
    /// towards the centre.
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

//! Derivative of the length of a propagation path with respect to motion of the scene or
//! transducer.

mod height;
mod post;
mod scattered;

use glam::DVec3;
use sonard_model::{
    geometry::DVec2,
    model::{Diffractor, Edge, Mechanism, Path, Reflector},
    scene::Scene,
};

/// Velocities of the scene and transducer with respect to one parameter, metres per unit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SceneMotion {
    /// Velocities of transmitter and receiver, in the plane.
    pub transducer: [DVec2; 2],
    /// Upward velocity of both.
    pub up: f64,
    /// Velocities of the ends of walls, by their index in the scene.
    pub walls: Vec<(u32, [DVec2; 2])>,
    /// Velocities of the axes of cylinders, and the growth of their radii.
    pub cylinders: Vec<(u32, DVec2, f64)>,
}

impl SceneMotion {
    /// Motion of the transducer as a whole.
    #[must_use]
    pub fn for_transducer(velocity: DVec2) -> Self {
        Self { transducer: [velocity; 2], ..Self::default() }
    }

    fn of_wall(&self, wall: u32) -> [DVec2; 2] {
        self.walls.iter().find(|moved| moved.0 == wall).map_or([DVec2::ZERO; 2], |moved| moved.1)
    }

    /// Velocity and growth of a moving cylinder.
    fn of_cylinder(&self, cylinder: u32) -> Option<(DVec2, f64)> {
        let moved = self.cylinders.iter().find(|moved| moved.0 == cylinder);
        moved.map(|&(_, velocity, growth)| (velocity, growth))
    }

    /// Velocity of the point of a wall nearest to `point`.
    fn on_wall(&self, scene: &Scene, wall: u32, point: DVec2) -> DVec2 {
        let [at_a, at_b] = self.of_wall(wall);
        let Some(wall) = scene.walls.get(wall as usize) else { return DVec2::ZERO };
        let along = wall.b - wall.a;
        let share = ((point - wall.a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        at_a.lerp(at_b, share)
    }

    fn velocity(&self, scene: &Scene, mechanism: Mechanism, point: DVec2) -> DVec3 {
        let up = if mechanism == Mechanism::Transducer { self.up } else { 0.0 };
        self.of_plan(scene, mechanism, point).extend(up)
    }

    /// Velocity of the surface at an interaction point, in the plan.
    pub(crate) fn of_plan(&self, scene: &Scene, mechanism: Mechanism, point: DVec2) -> DVec2 {
        let is_fixed = self.walls.is_empty() && self.cylinders.is_empty();
        if is_fixed && mechanism != Mechanism::Transducer {
            return DVec2::ZERO;
        }
        match mechanism {
            Mechanism::Reflection(Reflector::Wall(wall))
            | Mechanism::Scattering { wall }
            | Mechanism::Diffraction(Diffractor::Level { wall, .. }) => {
                self.on_wall(scene, wall, point)
            }
            Mechanism::Diffraction(Diffractor::Upright(Edge { wall, at_b })) => {
                self.of_wall(wall)[usize::from(at_b)]
            }
            // The path runs to the axis of the post.
            Mechanism::Diffraction(Diffractor::Post { cylinder }) => {
                self.of_cylinder(cylinder).map_or(DVec2::ZERO, |(velocity, _)| velocity)
            }
            Mechanism::Reflection(Reflector::Cylinder(cylinder)) => {
                let Some((velocity, growth)) = self.of_cylinder(cylinder) else {
                    return DVec2::ZERO;
                };
                let center = scene.cylinders.get(cylinder as usize).map_or(point, |c| c.center);
                velocity + growth * (point - center).normalize_or_zero()
            }
            Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling) => DVec2::ZERO,
            Mechanism::Transducer => 0.5 * (self.transducer[0] + self.transducer[1]),
        }
    }

    /// Rotation of the wall at an interaction, radians per unit.
    pub(crate) fn turn_of(&self, scene: &Scene, mechanism: Mechanism) -> f64 {
        let (Mechanism::Reflection(Reflector::Wall(wall))
        | Mechanism::Diffraction(Diffractor::Level { wall, .. })) = mechanism
        else {
            return 0.0;
        };
        let [at_a, at_b] = self.of_wall(wall);
        let along = scene.walls.get(wall as usize).map_or(DVec2::X, |wall| wall.b - wall.a);
        along.perp_dot(at_b - at_a) / along.length_squared()
    }
}

/// Derivative of the two-way length of a path with respect to a parameter that moves the scene and
/// the transducer, metres per unit; `ends` are transmitter and receiver, at the height `z_m` in a
/// scene with heights.
///
/// A path is stationary in the points of its interactions (Fermat), so only explicit motion counts:
/// `dL = sum dp . (u_in - u_out)` with the unit directions of propagation before and after each
/// point, and `-u . dx` for an end with departure or arrival direction `u`. A scattered path is not
/// stationary: it ends at the strip of a rough wall under the beam, in a fixed direction of
/// departure. A pulse from a post returns from its surface. Tests verify finite differences to 1e-5, relative to a metre per unit.
#[must_use]
pub fn length_derivative(
    path: &Path,
    ends: [DVec2; 2],
    z_m: f64,
    scene: &Scene,
    motion: &SceneMotion,
) -> f64 {
    let interactions = &path.interactions;
    let point = |at: usize| interactions[at].point.extend(interactions[at].z_m.unwrap_or(z_m));
    let (Some(last), [transmitter, receiver]) =
        (interactions.len().checked_sub(1), ends.map(|end| end.extend(z_m)))
    else {
        return 0.0;
    };
    if let Some(strip) = scattered::strip(path) {
        return scattered::length_derivative(path, strip, ends, z_m, scene, motion);
    }
    let toward = |from: DVec3, to: DVec3| (to - from).normalize_or_zero();
    let velocity = |velocity: DVec2| velocity.extend(motion.up);
    let mut rate = -toward(transmitter, point(0)).dot(velocity(motion.transducer[0]))
        - toward(receiver, point(last)).dot(velocity(motion.transducer[1]));
    for (at, interaction) in interactions.iter().enumerate() {
        let velocity = motion.velocity(scene, interaction.mechanism, interaction.point);
        if velocity == DVec3::ZERO {
            continue;
        }
        let before = if at == 0 { transmitter } else { point(at - 1) };
        let after = if at == last { receiver } else { point(at + 1) };
        let turn = toward(before, point(at)) - toward(point(at), after);
        rate += turn.dot(velocity);
    }
    match post::PostContact::find(path) {
        Some(post) => {
            let rise = height::rise(path, ends, z_m, motion);
            rate - post.lead_derivative(path, ends, scene, motion, (&rise, rate))
        }
        None => rate,
    }
}

//! Derivative of the length of a path that a rough wall scatters back.

use sonard_model::{
    geometry::DVec2,
    model::{Interaction, Mechanism, Path, Reflector},
    scene::Scene,
};

use super::{SceneMotion, height::rise};

/// Index of the interaction with the rough wall; `None` for other paths.
pub(super) fn strip(path: &Path) -> Option<usize> {
    path.interactions.iter().position(|met| matches!(met.mechanism, Mechanism::Scattering { .. }))
}

/// Ray in the plan with the derivatives of its state by a parameter.
struct MovingRay {
    at: DVec2,
    /// Unit direction of propagation.
    along: DVec2,
    moved: DVec2,
    turned: DVec2,
    length_m: f64,
    longer_m: f64,
}

impl MovingRay {
    /// Runs to a wall at `point`, which moves with `velocity`.
    fn run_to(&mut self, point: DVec2, normal: DVec2, velocity: DVec2) {
        let leg_m = self.at.distance(point);
        let offset = normal.dot(velocity - self.moved - leg_m * self.turned);
        let longer_m = offset / normal.dot(self.along);
        self.moved += leg_m * self.turned + longer_m * self.along;
        self.length_m += leg_m;
        self.longer_m += longer_m;
        self.at = point;
    }

    /// Reflects at a wall that rotates by `turn_rad` per unit.
    fn reflect(&mut self, normal: DVec2, turn_rad: f64) {
        let rotated = turn_rad * normal.perp();
        let mirrored = |direction: DVec2| direction - 2.0 * normal.dot(direction) * normal;
        self.turned = mirrored(self.turned)
            - 2.0 * (rotated.dot(self.along) * normal + normal.dot(self.along) * rotated);
        self.along = mirrored(self.along);
    }
}

/// Derivative of the two-way length, metres per unit, for a fixed direction of departure. The path
/// returns along itself, by way of walls, floor and ceiling.
pub(super) fn length_derivative(
    path: &Path,
    strip: usize,
    ends: [DVec2; 2],
    z_m: f64,
    scene: &Scene,
    motion: &SceneMotion,
) -> f64 {
    let [transmitter, _] = ends;
    let mut ray = MovingRay {
        at: transmitter,
        along: DVec2::ZERO,
        moved: motion.transducer[0],
        turned: DVec2::ZERO,
        length_m: 0.0,
        longer_m: 0.0,
    };
    for Interaction { mechanism, point, .. } in path.interactions.iter().take(strip + 1) {
        let (Mechanism::Reflection(Reflector::Wall(number))
        | Mechanism::Scattering { wall: number }) = *mechanism
        else {
            continue;
        };
        let Some(wall) = scene.walls.get(number as usize) else { continue };
        let normal = (wall.b - wall.a).normalize_or_zero().perp();
        if ray.length_m == 0.0 {
            ray.along = (*point - transmitter).normalize_or_zero();
        }
        ray.run_to(*point, normal, motion.on_wall(scene, number, *point));
        ray.reflect(normal, motion.turn_of(scene, Mechanism::Reflection(Reflector::Wall(number))));
    }
    let rise = rise(path, ends, z_m, motion);
    let [cosine, sine] = rise.cosine_and_sine();
    2.0 * cosine * ray.longer_m + sine * rise.climb
}

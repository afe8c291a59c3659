//! Rise of paths by way of floor and ceiling.

use sonard_model::{
    geometry::DVec2,
    model::{Interaction, Mechanism, Path, Reflector},
};

use super::SceneMotion;

/// Rise of a path with floor and ceiling as windows.
pub(super) struct Rise {
    /// Length in the plan, metres.
    pub(super) plan_m: f64,
    /// Height gained, metres.
    pub(super) rise_m: f64,
    /// Derivative of the height gained by a parameter.
    pub(super) climb: f64,
}

impl Rise {
    /// Length in space, metres.
    pub(super) fn length_m(&self) -> f64 {
        self.plan_m.hypot(self.rise_m)
    }

    /// Shares of the plan and of the rise in the length.
    pub(super) fn cosine_and_sine(&self) -> [f64; 2] {
        let length_m = self.length_m();
        match length_m > 0.0 {
            true => [self.plan_m / length_m, self.rise_m / length_m],
            false => [1.0, 0.0],
        }
    }
}

/// Rise of a path between ends at the height `z_m`: each reflection at floor or ceiling adds twice
/// its distance.
pub(super) fn rise(path: &Path, [from, to]: [DVec2; 2], z_m: f64, motion: &SceneMotion) -> Rise {
    let (mut rise_m, mut climb, mut sign) = (0.0, 0.0, 1.0);
    let is_level = |met: &&Interaction| {
        matches!(met.mechanism, Mechanism::Reflection(Reflector::Floor | Reflector::Ceiling))
    };
    for met in path.interactions.iter().filter(is_level) {
        let limit_m = met.z_m.unwrap_or(z_m);
        rise_m += 2.0 * sign * (limit_m - z_m);
        climb -= 2.0 * sign * motion.up;
        sign = -sign;
    }
    let inner = path.interactions.iter().map(|met| met.point);
    let points = std::iter::once(from).chain(inner).chain([to]);
    let plan_m = points.clone().zip(points.skip(1)).map(|(a, b)| a.distance(b)).sum();
    Rise { plan_m, rise_m, climb }
}
